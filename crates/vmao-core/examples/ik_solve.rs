//! Our side of `benches/peers/ik.py`: solves batches that come on standard input and says what CPU time they took.
//!
//! The argument is a robot's name; poses are of its flange. A batch is a line with its number of targets, and a line for
//! each: position, quaternion (w x y z), seed. The answer is a line of joint positions for each target, empty if it was
//! not solved, and a line of the CPU time of all and of the median target (seconds).

use std::{io::BufRead, time::Instant};
use vmao_core::{
    geometry::{Pose, pose},
    inverse_kinematics::{IkSettings, InverseKinematics},
    robots::RobotModel,
};

/// CPU time of this process (s), which has one thread.
fn cpu_seconds() -> Result<f64, Box<dyn std::error::Error>> {
    // the kernel adds a running thread's time when it gives up the processor
    std::thread::yield_now();
    let nanoseconds: f64 = std::fs::read_to_string("/proc/self/schedstat")?.split(' ').next().ok_or("empty")?.parse()?;
    Ok(nanoseconds / 1e9)
}

#[expect(clippy::print_stdout, reason = "the answer is printed")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).ok_or("which robot?")?;
    let robot = RobotModel::named(&name).ok_or("no such robot")?;
    let arm = InverseKinematics::new(robot.flange_chain(), &IkSettings::default());
    let mut lines = std::io::stdin().lock().lines();
    while let Some(line) = lines.next() {
        let count: usize = line?.trim().parse()?;
        let mut targets: Vec<(Pose, Vec<f64>)> = Vec::with_capacity(count);
        for _ in 0..count {
            let line = lines.next().ok_or("a target is missing")??;
            let numbers = line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
            let [x, y, z, qw, qx, qy, qz, seed @ ..] = numbers.as_slice() else { return Err("a target is too short".into()) };
            targets.push((pose([*x, *y, *z], [*qw, *qx, *qy, *qz]), seed.to_vec()));
        }
        let solve = || -> Vec<_> { targets.iter().map(|(pose, seed)| arm.solve(pose, seed)).collect() };
        // once without the clock: the caches hold what the side before has left there
        std::hint::black_box(solve());
        let start = cpu_seconds()?;
        let answers = solve();
        let all = cpu_seconds()? - start;
        // a single solution is too short for the kernel's clock; the median of wall time leaves interruptions out
        let mut single: Vec<f64> = Vec::with_capacity(count);
        for (pose, seed) in &targets {
            let start = Instant::now();
            std::hint::black_box(arm.solve(pose, seed));
            single.push(start.elapsed().as_secs_f64());
        }
        single.sort_by(f64::total_cmp);
        for answer in &answers {
            let q = answer.solution().unwrap_or_default();
            println!("{}", q.iter().map(|angle| format!("{angle:e}")).collect::<Vec<_>>().join(" "));
        }
        println!("{all:e} {:e}", single.get(count / 2).copied().unwrap_or_default());
    }
    Ok(())
}
