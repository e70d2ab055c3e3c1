//! Settings of the simulator one by one: what a trial costs with each and whether trials end as with the first. A Markdown table.
//!
//! Argument: trials of each of three cells.

#[path = "cells/mod.rs"]
mod cells;
#[path = "../tests/support/mod.rs"]
mod support;

use cells::{Cost, Labels, explore};
use std::error::Error;
use vmao_core::order::GraspOrder;
use vmao_core::robots::{panda, sawyer};

/// No setting of the first changes anything but sleep, the earlier state of the program.
const SETTINGS: [(&str, &[(&str, &str)]); 8] = [
    ("never asleep", &[("scene.sleep_tolerance", "0.0")]),
    ("asleep below 1e-3 m/s", &[("scene.sleep_tolerance", "1e-3")]),
    ("asleep, noslip_tolerance 1e-4", &[("scene.sleep_tolerance", "1e-3"), ("scene.noslip_tolerance", "1e-4")]),
    ("asleep, 5 noslip iterations", &[("scene.sleep_tolerance", "1e-3"), ("scene.noslip_iterations", "5")]),
    ("asleep, no noslip", &[("scene.sleep_tolerance", "1e-3"), ("scene.noslip_iterations", "0")]),
    ("asleep, steps of 3 ms", &[("scene.sleep_tolerance", "1e-3"), ("scene.timestep", "0.003")]),
    ("asleep, steps of 4 ms", &[("scene.sleep_tolerance", "1e-3"), ("scene.timestep", "0.004")]),
    (
        "asleep, arms at 0.8 of their speed and 0.6 of their acceleration",
        &[("scene.sleep_tolerance", "1e-3"), ("motion.velocity_share", "0.8"), ("motion.acceleration_share", "0.6")],
    ),
];

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let trials: u64 = std::env::args().nth(1).ok_or("expected the number of trials of each cell")?.parse()?;
    println!("| setting | CPU s a trial | steps a trial | CPU µs a step | succeeded | ended as in the first row | lost, won |");
    println!("|---|---|---|---|---|---|---|");
    let mut first: Option<Vec<Cost>> = None;
    for (name, settings) in SETTINGS {
        let mut costs = explore("pliers", &panda(), GraspOrder::Sequential, trials, Labels::Frozen, settings)?;
        costs.extend(explore("laptop", &sawyer(1), GraspOrder::Parallel, trials, Labels::Frozen, settings)?);
        costs.extend(explore("three-sticks", &panda(), GraspOrder::Sequential, trials, Labels::Frozen, settings)?);
        let before = first.get_or_insert_with(|| costs.clone());
        println!("{}", row(name, before, &costs));
    }
    Ok(())
}

fn row(name: &str, before: &[Cost], costs: &[Cost]) -> String {
    let count = costs.len() as f64;
    let (seconds, steps) = costs.iter().fold((0.0, 0), |(seconds, steps), cost| (seconds + cost.seconds, steps + cost.steps));
    let successes = costs.iter().filter(|cost| cost.outcome.is_success()).count();
    let pairs = || before.iter().zip(costs).map(|(before, after)| (before.outcome, after.outcome));
    let same = pairs().filter(|(before, after)| before.is_success() == after.is_success()).count();
    let lost = pairs().filter(|(before, after)| before.is_success() && !after.is_success()).count();
    format!(
        "| {name} | {:.3} | {:.0} | {:.1} | {successes} of {count} | {same} of {count} | {lost}, {} |",
        seconds / count,
        steps as f64 / count,
        seconds / steps as f64 * 1e6,
        costs.len() - same - lost,
    )
}
