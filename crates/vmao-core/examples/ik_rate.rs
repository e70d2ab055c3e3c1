//! Solve rate and mean time of inverse kinematics on random reachable poses.

#[path = "../tests/robots/mod.rs"]
mod robots;

use vmao_core::{
    inverse_kinematics::{IkSettings, solve, solve_nearest},
    random::Stream,
};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() {
    for (name, chain, seed) in
        [("panda", robots::panda(), robots::PANDA_HOME), ("sawyer", robots::sawyer(), robots::SAWYER_NEUTRAL)]
    {
        for trials in [1000, 10_000] {
            let mut stream = Stream::new(trials, &[]);
            let goals: Vec<_> = (0..trials).map(|_| chain.tool_pose(&chain.sample(&mut stream))).collect();
            let start = std::time::Instant::now();
            let settings = IkSettings::default();
            let solved =
                goals.iter().filter(|goal| solve(&chain, goal, &seed, &settings, &mut stream).solution().is_some()).count();
            let mean = start.elapsed().as_secs_f64() * 1e6 / trials as f64;
            println!("{name}: {solved} of {trials} solved, {mean:.1} us each");
        }
        let mut stream = Stream::new(1, &[]);
        let goals: Vec<_> = (0..1000).map(|_| chain.tool_pose(&chain.sample(&mut stream))).collect();
        let start = std::time::Instant::now();
        let solved = goals
            .iter()
            .filter(|goal| solve_nearest(&chain, goal, &seed, 12, &IkSettings::default(), &mut stream).solution().is_some())
            .count();
        println!("{name}: nearest of 12, {solved} of 1000 solved, {:.1} us each", start.elapsed().as_secs_f64() * 1e3);
    }
}
