//! The study as Markdown tables.

use crate::cells::CELLS;
use crate::study::Study;
use std::error::Error;
use vmao_core::catalogue::InstanceSet;
use vmao_core::outcome::FailureStage;
use vmao_sim::MotionMeasures;

/// The 95 % score interval of a success rate (Wilson 1927), in percent.
pub(crate) fn wilson(successes: usize, trials: usize) -> [f64; 2] {
    const Z: f64 = 1.96;
    let (n, p) = (trials as f64, successes as f64 / trials as f64);
    let middle = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt() / (1.0 + Z * Z / n);
    [middle - half, middle + half].map(|bound| 100.0 * bound.clamp(0.0, 1.0))
}

/// What is measured of a motion: name with unit, value, how many of its own units make one of that, decimals.
type Measure = (&'static str, fn(&MotionMeasures) -> f64, f64, usize);

pub(crate) const MEASURES: [Measure; 6] = [
    ("hands' ways (m)", |motion| motion.hand_path, 1.0, 3),
    ("longest way (m)", |motion| motion.longest_hand_path, 1.0, 3),
    ("joints (rad)", |motion| motion.joint_travel, 1.0, 2),
    ("part error (mm)", |motion| motion.part_error, 1e3, 2),
    ("internal, mean (N)", |motion| motion.mean_internal_force, 1.0, 2),
    ("internal, peak (N)", |motion| motion.peak_internal_force, 1.0, 2),
];

#[expect(clippy::print_stdout, reason = "the tables go where the user wants them")]
pub(crate) fn print(directory: &str, set: InstanceSet, first: u64) -> Result<(), Box<dyn Error>> {
    for cell in &CELLS {
        let Some(study) = Study::read(directory, cell, set, first)? else { continue };
        println!("\n**{}**, {} trials with each root, {} in common\n", cell.name(), study.trials(), study.common.len());
        let names: Vec<&str> = MEASURES.iter().map(|measure| measure.0).collect();
        println!(
            "| root | success | Wilson 95 % | against the best, p | failures | {} | moment (N·m) | lever (mm) |",
            names.join(" | ")
        );
        println!("|---|---|---|---|---|{}---|---|", "---|".repeat(names.len()));
        let best = &study.choices[study.best()];
        for (row, choice) in study.choices.iter().enumerate() {
            let [low, high] = wilson(choice.successes(), study.trials());
            let ([gained, lost], p) = choice.mcnemar(best);
            let against = if choice.name == best.name {
                "best".to_owned()
            } else {
                format!("+{gained} −{lost}, {p:.2}").replace("0.00", "< 0.01")
            };
            let failures: Vec<String> = FailureStage::ALL
                .iter()
                .filter(|&&stage| choice.failures(stage) > 0)
                .map(|&stage| format!("{} {}", choice.failures(stage), stage.name()))
                .collect();
            let measures: Vec<String> = MEASURES
                .iter()
                .map(|&(_, of, scale, decimals)| {
                    let (mean, count) = choice.mean(&study.common, of);
                    if 2 * count < study.common.len() { "–".to_owned() } else { format!("{:.decimals$}", mean * scale) }
                })
                .collect();
            let lever = study.levers.get(row).map_or_else(
                || choice.chosen.iter().map(usize::to_string).collect::<Vec<_>>().join(" / ") + " chosen",
                |lever| format!("{:.0}", lever * 1e3),
            );
            let moment = study.moments.get(row).map_or_else(String::new, |moments| {
                let [low, high] = moments.iter().fold([f64::INFINITY, 0.0_f64], |[low, high], m| [low.min(*m), high.max(*m)]);
                format!("{low:.2} to {high:.2}")
            });
            println!(
                "| {} | {}/{} | {low:.1} to {high:.1} | {against} | {} | {} | {moment} | {lever} |",
                choice.name,
                choice.successes(),
                study.trials(),
                failures.join(", "),
                measures.join(" | "),
            );
        }
    }
    Ok(())
}
