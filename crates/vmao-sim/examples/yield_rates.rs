//! Explores objects with both robots and prints, as a Markdown table, what is accepted and what failed trials cost.
//!
//! Arguments: trials a cell, then objects (all of the catalogue if none). CPU time is that of the thread that runs the trials.

#[path = "cells/mod.rs"]
mod cells;
#[path = "../tests/support/mod.rs"]
mod support;

use cells::{Cost, Labels, explore};
use std::error::Error;
use vmao_core::catalogue::NAMES;
use vmao_core::order::GraspOrder;
use vmao_core::outcome::TrialOutcome;
use vmao_core::robots::{RobotModel, panda, sawyer};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let trials: u64 = arguments.next().ok_or("expected the number of trials, then objects")?.parse()?;
    let mut objects: Vec<String> = arguments.collect();
    if objects.is_empty() {
        objects = NAMES.iter().map(|&name| name.to_owned()).collect();
    }
    println!(
        "| object | robots | order | accepted | rate | tuples per core-minute | CPU s a success | CPU s a failure | \
         failure / success, CPU | failure / success, steps | failures |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for object in &objects {
        for robot in [panda(), sawyer(1)] {
            for order in [GraspOrder::Parallel, GraspOrder::Sequential] {
                println!("{}", row(object, &robot, order, &explore(object, &robot, order, trials, Labels::Grow, &[])?));
            }
        }
    }
    Ok(())
}

fn row(object: &str, robot: &RobotModel, order: GraspOrder, costs: &[Cost]) -> String {
    let (successes, failures): (Vec<&Cost>, Vec<&Cost>) = costs.iter().partition(|cost| cost.outcome.is_success());
    let mean = |of: &[&Cost], value: fn(&Cost) -> f64| of.iter().map(|cost| value(cost)).sum::<f64>() / of.len() as f64;
    let cpu: fn(&Cost) -> f64 = |cost| cost.seconds;
    let steps: fn(&Cost) -> f64 = |cost| cost.steps as f64;
    let shown = |value: f64| if value.is_finite() { format!("{value:.2}") } else { "–".to_owned() };
    let mut stages: Vec<(&str, usize)> = Vec::new();
    for cost in costs {
        if let TrialOutcome::Failed(stage) = cost.outcome {
            match stages.iter_mut().find(|(name, _)| *name == stage.name()) {
                Some((_, count)) => *count += 1,
                None => stages.push((stage.name(), 1)),
            }
        }
    }
    stages.sort_by_key(|&(name, count)| (std::cmp::Reverse(count), name));
    let stages: Vec<String> = stages.iter().map(|(name, count)| format!("{count} {name}")).collect();
    let minutes = costs.iter().map(cpu).sum::<f64>() / 60.0;
    format!(
        "| `{object}` | {} | {} | {} of {} | {:.0} % | {:.0} | {} | {} | {} | {} | {} |",
        robot.name,
        format!("{order:?}").to_lowercase(),
        successes.len(),
        costs.len(),
        100.0 * successes.len() as f64 / costs.len() as f64,
        successes.len() as f64 / minutes,
        shown(mean(&successes, cpu)),
        shown(mean(&failures, cpu)),
        shown(mean(&failures, cpu) / mean(&successes, cpu)),
        shown(mean(&failures, steps) / mean(&successes, steps)),
        stages.join(", "),
    )
}
