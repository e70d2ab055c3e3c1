//! The report of a run directory: reads what the run left, runs again the few trials that are shown.

use crate::config::Config;
use crate::contact_maps::latent_maps;
use crate::dataset;
use crate::evaluation::{Evaluation, TrialLine};
use crate::failure::{Failure, OrBadInput};
use crate::json::Document;
use crate::learning::{json_lines, load_methods};
use crate::output::write_whole;
use crate::provenance::RunInfo;
use crate::report::{
    Cell, ContactMapFigure, ExplorationRound, ExplorationSummary, Provenance, ReportData, RolloutFigure, ThresholdPoint,
    TrainingCurve, TrainingEpoch, render,
};
use crate::results::{Method, Results};
use crate::training_log::{EpochLine, curves};
use anyhow::Context;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use vmao_core::catalogue::InstanceSet;
use vmao_core::order::GraspOrder;
use vmao_core::outcome::TrialOutcome;
use vmao_net::ModelKind;
use vmao_sim::Recording;

/// Latent codes shown for each scene, as in the supplement's Figure 4.
const LATENTS_SHOWN: u64 = 5;

/// Writes `report.html` into a run directory and returns its path.
pub fn write_report(directory: &Path) -> Result<PathBuf, Failure> {
    let config = Config::load(Some(&directory.join("config.toml")), &[]).or_bad_input()?;
    let info = RunInfo::load(directory).or_bad_input()?;
    let results: Results = Document::read(&directory.join("results.json")).or_bad_input()?.parse().or_bad_input()?;
    let lines: Vec<TrialLine> = json_lines(&directory.join("trials.jsonl"))?;
    let models = directory.join("models");
    let evaluation = Evaluation::new(&config, info.seed, load_methods(&models, &config)?)?;
    let (exploration, digest) = explored(&config, &directory.join("data"))?;
    let data = ReportData {
        title: format!("vmao · {} with {}", config.object_name(), config.robots.names.join(" + ")),
        summary: summary(&results),
        cells: cells(&results, &lines)?,
        contact_maps: contact_maps(&evaluation, &lines, info.seed)?,
        rollouts: rollouts(&evaluation, &lines),
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
    let page = render(&data);
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

/// The second grasp's maps for five latent codes, on the first scenes that V-MAO solved in each order.
fn contact_maps(evaluation: &Evaluation<'_>, lines: &[TrialLine], seed: u64) -> Result<Vec<ContactMapFigure>, Failure> {
    let Some(model) = evaluation.model(Method::Vmao) else { return Ok(Vec::new()) };
    let mut figures = Vec::new();
    for (order, title, caption) in [
        (
            GraspOrder::Sequential,
            "Lifted by the first gripper",
            "The first gripper holds the object at its goal; the second looks.",
        ),
        (GraspOrder::Parallel, "Lying on the table", "Nothing is grasped yet."),
    ] {
        let is_shown = |line: &&TrialLine| line.order == order && line.method == Method::Vmao && line.outcome.is_success();
        let Some(line) = lines.iter().find(is_shown) else { continue };
        let trial = evaluation.trial(order, Method::Vmao, line.index, Recording::Off);
        let Some(second) = trial.as_ref().and_then(|trial| trial.record.grasps.get(1)) else { continue };
        let part = usize::from(second.contact.part.0);
        let maps = latent_maps(model, part, &second.observation, seed, LATENTS_SHOWN)?;
        let caption = format!("Trial {}. {caption}", line.index);
        figures.push(ContactMapFigure::new(title.to_owned(), caption, &second.observation, maps));
    }
    Ok(figures)
}

/// A success of each order and the failure that got furthest.
fn rollouts(evaluation: &Evaluation<'_>, lines: &[TrialLine]) -> Vec<RolloutFigure> {
    let mut shown: Vec<&TrialLine> = Vec::new();
    for order in [GraspOrder::Sequential, GraspOrder::SequentialParallel, GraspOrder::Parallel] {
        shown.extend(lines.iter().find(|line| line.order == order && line.method == Method::Vmao && line.outcome.is_success()));
    }
    let failed = lines.iter().filter(|line| !line.outcome.is_success());
    // One that ended before anything moved has nothing to play, whoever chose its contacts.
    let telling = |line: &&TrialLine| (line.steps, line.method == Method::Vmao, std::cmp::Reverse(line.index));
    shown.extend(failed.max_by_key(telling));
    let figure = |line: &TrialLine| {
        let rollout = evaluation.trial(line.order, line.method, line.index, Recording::On)?.rollout?;
        let what = match line.outcome {
            TrialOutcome::Success => "Success".to_owned(),
            TrialOutcome::Failed(stage) => format!("Failure: {}", stage.name()),
        };
        let title = format!("{what} · {} · {}", line.order.name(), line.method.title());
        let caption = format!("Trial {}.{}{}", line.index, if line.detail.is_empty() { "" } else { " " }, line.detail);
        Some(RolloutFigure { title, caption, rollout })
    };
    shown.into_iter().filter_map(figure).collect()
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
