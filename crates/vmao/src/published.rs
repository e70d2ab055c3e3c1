//! The supplement's Table 1, and the table of a run beside it.

use crate::evaluation::TrialLine;
use crate::results::{Cell, Method, Results, wilson95};
use crate::significance::p_value;
use vmao_core::order::GraspOrder;
use vmao_core::outcome::FailureStage;

/// Runs of each cell of the supplement's Table 1.
const RUNS: u64 = 50;

/// Successes of 50 in the supplement's Table 1 (appendix D: three Sawyers, three sticks); our addition best-of-K is not in it.
pub fn table_1(order: GraspOrder, method: Method) -> Option<u64> {
    match (method, order) {
        (Method::Top1, GraspOrder::Parallel) => Some(40),
        (Method::Top1, GraspOrder::SequentialParallel)
        | (Method::Vmao, GraspOrder::Parallel | GraspOrder::SequentialParallel) => Some(43),
        (Method::Top1, GraspOrder::Sequential) => Some(45),
        (Method::Vmao, GraspOrder::Sequential) => Some(46),
        (Method::BestOfK, _) => None,
    }
}

/// Whether a cell is one of that table's: three sticks and three Sawyers.
fn is_published(cell: &Cell) -> bool {
    cell.object().starts_with("three-sticks") && cell.robots().len() == 3 && cell.robots().iter().all(|robot| robot == "sawyer")
}

fn percent(successes: u64, trials: u64) -> String {
    let [low, high] = wilson95(successes, trials).map(|bound| 100.0 * bound);
    format!("{:.1} [{low:.1}, {high:.1}]", 100.0 * successes as f64 / trials.max(1) as f64)
}

/// Scales of all thresholds together at which successes are counted again, so that no threshold flatters.
const SCALES: [f64; 6] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0];

/// The results of a run as Markdown tables; `timestep` is the simulator's (s).
///
/// First rates with Wilson 95 % intervals, the paper's, McNemar against Top-1, failures by stage, simulated seconds of a
/// trial; then rates with all thresholds scaled.
pub fn markdown(results: &Results, lines: &[TrialLine], timestep: f64) -> String {
    let stages = FailureStage::ALL.map(FailureStage::name).join(" | ");
    let mut text = format!(
        "| order | method | succeeded | rate % [95 %] | paper, of {RUNS} | against Top-1, p | {stages} | simulated s |\n"
    );
    text += &format!("|{}\n", "---|".repeat(7 + FailureStage::ALL.len()));
    for cell in &results.cells {
        let (order, method) = (cell.order(), cell.method());
        let paper = table_1(order, method).filter(|_| is_published(cell)).map_or_else(|| "–".to_owned(), |n| percent(n, RUNS));
        let against = results.comparisons.iter().find(|pair| {
            let methods = [pair.first, pair.second];
            pair.order == order && method != Method::Top1 && methods.contains(&method) && methods.contains(&Method::Top1)
        });
        let against = against.map_or_else(|| "–".to_owned(), |pair| p_value(pair.p));
        let of_cell = || lines.iter().filter(|line| line.order == order && line.method == method);
        let seconds = of_cell().map(|line| line.steps as f64 * timestep).sum::<f64>() / of_cell().count().max(1) as f64;
        let failures = FailureStage::ALL.map(|stage| cell.failures(stage).to_string()).join(" | ");
        let (successes, trials) = (cell.successes(), cell.trials());
        let (order, method, rate) = (order.name(), method.title(), percent(successes, trials));
        text += &format!(
            "| {order} | {method} | {successes}/{trials} | {rate} | {paper} | {against} | {failures} | {seconds:.1} |\n"
        );
    }
    text + "\n" + &scaled(results, lines)
}

/// Rates (%) with the thresholds of position, rotation and joints multiplied by each of [`SCALES`].
fn scaled(results: &Results, lines: &[TrialLine]) -> String {
    let heads = SCALES.map(|scale| format!("× {scale}")).join(" | ");
    let mut text = format!("| order | method, % at thresholds | {heads} |\n|{}\n", "---|".repeat(2 + SCALES.len()));
    for cell in &results.cells {
        let (order, method) = (cell.order(), cell.method());
        let factors: Vec<Option<f64>> =
            lines.iter().filter(|line| line.order == order && line.method == method).map(|line| line.threshold_factor).collect();
        let met = |scale: f64| factors.iter().flatten().filter(|factor| **factor <= scale).count();
        let rates = SCALES.map(|scale| format!("{:.1}", 100.0 * met(scale) as f64 / factors.len().max(1) as f64)).join(" | ");
        text += &format!("| {} | {} | {rates} |\n", order.name(), method.title());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_s_figures_stand_beside_its_own_cells_only() {
        let rates =
            |method| [GraspOrder::Parallel, GraspOrder::SequentialParallel, GraspOrder::Sequential].map(|o| table_1(o, method));
        // Appendix D, Table 1: 80, 86, 90 % and 86, 86, 92 % of 50.
        assert_eq!(rates(Method::Top1), [Some(40), Some(43), Some(45)]);
        assert_eq!(rates(Method::Vmao), [Some(43), Some(43), Some(46)]);
        assert_eq!(rates(Method::BestOfK), [None; 3]);
        assert_eq!(percent(40, 50), "80.0 [67.0, 88.8]");
        let cell = |object: &str, robot: &str| {
            Cell::new(object, &[robot, robot, robot].map(str::to_owned), GraspOrder::Parallel, Method::Top1, [])
        };
        assert!(is_published(&cell("three-sticks", "sawyer")));
        assert!(!is_published(&cell("three-sticks", "panda")) && !is_published(&cell("laptop", "sawyer")));
    }
}
