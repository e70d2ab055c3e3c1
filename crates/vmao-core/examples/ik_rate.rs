//! Solve rate and mean time of inverse kinematics on random reachable poses; time to find all branches, and to follow lines.

#[path = "../tests/robots/mod.rs"]
mod robots;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use vmao_core::{
    geometry::{Pose, interpolate, rotation_exp},
    inverse_kinematics::{IkOutcome, IkSettings, InverseKinematics, track},
    random::Stream,
};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() {
    for (name, chain, seed) in
        [("panda", robots::panda(), robots::PANDA_HOME), ("sawyer", robots::sawyer(), robots::SAWYER_NEUTRAL)]
    {
        let arm = InverseKinematics::new(chain.clone(), &IkSettings::default());
        for trials in [1000, 100_000] {
            let mut stream = Stream::new(trials, &[]);
            let goals: Vec<_> = (0..trials).map(|_| chain.tool_pose(&chain.sample(&mut stream))).collect();
            let start = std::time::Instant::now();
            let solved = goals.iter().filter(|goal| arm.solve(goal, &seed).solution().is_some()).count();
            let mean = start.elapsed().as_secs_f64() * 1e6 / trials as f64;
            println!("{name}: {solved} of {trials} solved, {mean:.2} us each");
        }
        let mut stream = Stream::new(1, &[]);
        let goals: Vec<_> = (0..300).map(|_| chain.tool_pose(&chain.sample(&mut stream))).collect();
        let start = std::time::Instant::now();
        let branches: usize = goals.iter().map(|goal| arm.branches(goal, &seed).len()).sum();
        let (mean, count) = (start.elapsed().as_secs_f64() * 1e6 / 300.0, branches as f64 / 300.0);
        println!("{name}: {count:.2} branches a pose, {mean:.0} us a pose");

        // poses of any orientation in a box around the arm, of which many are out of reach
        let mut stream = Stream::new(3, &[]);
        let mut counts = [0; 3];
        for _ in 0..2000 {
            let place = Vector3::new(stream.range(-1.2, 1.2), stream.range(-1.2, 1.2), stream.range(-0.6, 1.5));
            let [w, x, y, z] = [0; 4].map(|_| stream.normal());
            let goal = Pose::from_parts(place.into(), UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)));
            counts[match arm.solve(&goal, &seed) {
                IkOutcome::Solved { .. } => 0,
                IkOutcome::Unreachable { .. } => 1,
                IkOutcome::NoSolution { .. } => 2,
            }] += 1;
        }
        let [solved, proven, open] = counts;
        println!("{name}: of 2000 poses in a box {solved} solved, {proven} proven out of reach, {open} neither");

        // lines of 15 cm with a turn of 45 degrees, from anywhere well inside the limits, in 60 steps
        let mut stream = Stream::new(2, &[]);
        let (mut tracked, mut reachable, mut nanoseconds) = (0, 0, 0);
        for _ in 0..500 {
            let start: Vec<f64> =
                chain.joints.iter().map(|joint| joint.lower + (joint.upper - joint.lower) * stream.range(0.15, 0.85)).collect();
            let mut way = || Vector3::new(stream.normal(), stream.normal(), stream.normal()).normalize();
            let from = chain.tool_pose(&start);
            let to = Pose::from_parts(
                (from.translation.vector + way() * 0.15).into(),
                rotation_exp(&(way() * std::f64::consts::FRAC_PI_4)) * from.rotation,
            );
            if arm.solve(&to, &start).solution().is_none() {
                continue;
            }
            reachable += 1;
            let poses: Vec<Pose> = (1..=60).map(|i| interpolate(&from, &to, f64::from(i) / 60.0)).collect();
            let begun = std::time::Instant::now();
            tracked += usize::from(track(&chain, &poses, &start, 0.2, &IkSettings::default()).is_ok());
            nanoseconds += begun.elapsed().as_nanos();
        }
        println!(
            "{name}: {tracked} of {reachable} lines tracked whose end is reachable, {:.1} us a pose",
            nanoseconds as f64 / f64::from(reachable) / 60e3
        );
    }
}
