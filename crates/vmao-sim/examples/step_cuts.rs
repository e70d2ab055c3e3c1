//! Settings of the simulator one by one: what a trial costs with each, and whether it ends as with the shipped ones. A Markdown table.
//!
//! Arguments: trials of each of six cells; then the rows, each `section.key=value` or several of them with commas between.

#[path = "cells/mod.rs"]
mod cells;
#[path = "../tests/support/mod.rs"]
mod support;

use cells::{Cost, Labels, explore};
use std::error::Error;
use vmao_core::order::GraspOrder::{Parallel, Sequential};
use vmao_core::robots::{panda, sawyer};

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let trials: u64 = arguments.next().ok_or("expected the number of trials of each cell, then settings")?.parse()?;
    let rows: Vec<String> = std::iter::once(String::new()).chain(arguments).collect();
    let cells = [
        ("pliers", panda(), Sequential),
        ("pliers", sawyer(1), Sequential),
        ("laptop", sawyer(1), Parallel),
        ("cabinet", panda(), Parallel),
        ("three-sticks", panda(), Sequential),
        ("three-sticks", sawyer(1), Sequential),
    ];
    let mut costs: Vec<Vec<Cost>> = vec![Vec::new(); rows.len()];
    // All settings in turns on each cell, so that other work of the machine meets them alike.
    for (object, robot, order) in &cells {
        for (costs, row) in costs.iter_mut().zip(&rows) {
            let settings: Vec<(&str, &str)> = row.split(',').filter_map(|setting| setting.split_once('=')).collect();
            costs.extend(explore(object, robot, *order, trials, Labels::Frozen, &settings)?);
        }
    }
    println!(
        "| setting | CPU s a trial | steps a trial | CPU µs a step | succeeded | by cell | ended as in the first row | lost, won |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, row) in rows.iter().zip(&costs) {
        println!("{}", described(if name.is_empty() { "as shipped" } else { name }, &costs[0], row, trials as usize));
    }
    Ok(())
}

fn described(name: &str, before: &[Cost], costs: &[Cost], cell: usize) -> String {
    let count = costs.len() as f64;
    let (seconds, steps) = costs.iter().fold((0.0, 0), |(seconds, steps), cost| (seconds + cost.seconds, steps + cost.steps));
    let won = |costs: &[Cost]| costs.iter().filter(|cost| cost.outcome.is_success()).count();
    let by_cell: Vec<String> = costs.chunks(cell).map(|cell| won(cell).to_string()).collect();
    let pairs = || before.iter().zip(costs).map(|(before, after)| (before.outcome, after.outcome));
    let same = pairs().filter(|(before, after)| before.is_success() == after.is_success()).count();
    let lost = pairs().filter(|(before, after)| before.is_success() && !after.is_success()).count();
    format!(
        "| {name} | {:.3} | {:.0} | {:.1} | {} of {count} | {} | {same} of {count} | {lost}, {} |",
        seconds / count,
        steps as f64 / count,
        seconds / steps as f64 * 1e6,
        won(costs),
        by_cell.join(" "),
        costs.len() - same - lost,
    )
}
