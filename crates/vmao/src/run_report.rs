//! The report of a run directory: reads what the run left, and carries out what latent codes of a few scenes lead to.

mod live;
mod rollouts;

use crate::config::Config;
use crate::dataset;
use crate::evaluation::{Evaluation, TrialLine};
use crate::failure::{Failure, OrBadInput};
use crate::json::Document;
use crate::learning::json_lines;
use crate::output::write_whole;
use crate::provenance::RunInfo;
use crate::report::{
    Cell, ExplorationRound, ExplorationSummary, Provenance, ReportData, ThresholdPoint, TrainingCurve, TrainingEpoch, render,
};
use crate::results::Results;
use crate::rollouts::StoredRollouts;
use crate::training_log::{EpochLine, curves};
use anyhow::Context;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use vmao_core::catalogue::InstanceSet;
use vmao_core::outcome::TrialOutcome;
use vmao_net::ModelKind;

/// Writes `report.html` into a run directory and returns its path.
pub fn write_report(directory: &Path) -> Result<PathBuf, Failure> {
    let config = Config::load(Some(&directory.join("config.toml")), &[]).or_bad_input()?;
    let info = RunInfo::load(directory).or_bad_input()?;
    let results: Results = Document::read(&directory.join("results.json")).or_bad_input()?.parse().or_bad_input()?;
    let lines: Vec<TrialLine> = json_lines(&directory.join("trials.jsonl"))?;
    let models = directory.join("models");
    let evaluation = Evaluation::of_run(directory, &config, info.seed)?;
    let (exploration, digest) = explored(&config, &directory.join("data"))?;
    let motions = rollouts::motions(&evaluation, &StoredRollouts::of(directory), &lines)?;
    let data = ReportData {
        title: format!("vmao · {} with {}", config.object_name(), config.robots.names.join(" + ")),
        summary: summary(&results),
        cells: cells(&results, &lines)?,
        contact_maps: live::scenes(&evaluation, &lines, info.seed)?,
        rollouts: motions.figures,
        rollouts_note: motions.note,
        failure_classes: motions.classes,
        training: training(&models)?,
        exploration,
        provenance: Provenance {
            command: info.command.join(" "),
            version: info.version,
            commit: info.commit,
            seed: info.seed,
            digest,
            config: config.to_toml()?,
        },
    };
    let path = directory.join("report.html");
    let page = render(&data)?;
    write_whole(&path, |file| file.write_all(page.as_bytes())).with_context(|| path.display().to_string())?;
    Ok(path)
}

fn summary(results: &Results) -> String {
    let cell = |cell: &crate::results::Cell| {
        format!("{} {}: {} of {}", cell.method().title(), cell.order().name(), cell.successes(), cell.trials())
    };
    let cells = results.cells.iter().map(cell).collect::<Vec<_>>().join("; ");
    let goals = results.goals().map_or_else(String::new, |counts| format!(" Of all, {}.", counts.sentence()));
    format!("Trials that met the goal pose and joint angles. {cells}.{goals}")
}

/// The cells of the table, each with its success rate over scaled thresholds.
fn cells(results: &Results, lines: &[TrialLine]) -> Result<Vec<Cell>, Failure> {
    let shown = |cell: &crate::results::Cell| -> Result<Cell, Failure> {
        let mut shown: Cell = serde_json::from_value(serde_json::to_value(cell)?)?;
        let of_cell: Vec<&TrialLine> =
            lines.iter().filter(|line| line.order == cell.order() && line.method == cell.method()).collect();
        shown.threshold_curve = (1..=12)
            .map(|step| {
                let scale = f64::from(step) * 0.25;
                let met = of_cell.iter().filter(|line| line.threshold_factor.is_some_and(|factor| factor <= scale)).count();
                ThresholdPoint { scale, rate: met as f64 / of_cell.len().max(1) as f64 }
            })
            .collect();
        Ok(shown)
    };
    results.cells.iter().map(shown).collect()
}

fn training(models: &Path) -> Result<Vec<TrainingCurve>, Failure> {
    let mut all = Vec::new();
    for kind in ModelKind::ALL {
        let lines = curves(&models.join(kind.name()))?;
        let grasps = lines.iter().map(|line| line.grasp + 1).max().unwrap_or(0);
        for grasp in 0..grasps {
            let epoch = |line: &EpochLine| TrainingEpoch {
                train_reconstruction: f64::from(line.train_reconstruction),
                validation_reconstruction: line.validation_reconstruction.map_or(f64::NAN, f64::from),
                kl: if kind == ModelKind::Vmao { f64::from(line.train_kl) } else { f64::NAN },
                beta: if kind == ModelKind::Vmao { f64::from(line.beta) } else { f64::NAN },
            };
            let epochs = lines.iter().filter(|line| line.grasp == grasp).map(epoch).collect();
            all.push(TrainingCurve { model: format!("{}, grasp {}", kind.title(), grasp + 1), epochs });
        }
    }
    Ok(all)
}

/// How the label set of the run grew, and the digest of its records; empty without a data set.
fn explored(config: &Config, directory: &Path) -> Result<(Option<ExplorationSummary>, String), Failure> {
    if !directory.is_dir() {
        return Ok((None, String::new()));
    }
    let (mut rounds, mut failures) = (Vec::new(), BTreeMap::new());
    let mut trials = 0;
    for round in dataset::rounds(directory).or_bad_input()? {
        let round = round.or_bad_input()?;
        let successes = round.iter().filter(|record| record.outcome.is_success()).count() as u64;
        rounds.push(ExplorationRound { trials: round.len() as u64, successes });
        trials += round.len() as u64;
        for record in &round {
            if let TrialOutcome::Failed(stage) = record.outcome {
                *failures.entry(stage).or_default() += 1;
            }
        }
    }
    let demonstrations =
        crate::scenes::items(config, InstanceSet::Train)?.iter().map(|item| item.demonstrations.len() as u64).max();
    let summary = ExplorationSummary {
        trials,
        successes: rounds.iter().map(|round| round.successes).sum(),
        demonstrations: demonstrations.unwrap_or(0),
        failures,
        rounds,
    };
    Ok((Some(summary), dataset::digest_of(directory).or_bad_input()?))
}
