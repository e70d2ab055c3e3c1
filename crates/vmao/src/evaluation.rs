//! The table: every method in every order on the same trials.

use crate::config::Config;
use crate::failure::Failure;
use crate::kept_trials::KeptTrials;
use crate::learned_contacts::LearnedContacts;
use crate::learning::load_methods;
use crate::output::{progress_bar, write_whole};
use crate::provenance::RunInfo;
use crate::results::{Cell, Method, Results};
use crate::scenes::scenes;
use crate::significance::comparisons;
use anyhow::Context;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;
use vmao_core::contact_model::ContactModel;
use vmao_core::order::GraspOrder;
use vmao_core::outcome::TrialOutcome;
use vmao_core::random::Stream;
use vmao_sim::{GoalReach, Recording, Scene, Trial, run_trial, scene_of_trial};

/// Names the stream that the seed of evaluation trials is drawn from, so that none of them was explored.
const EVALUATION: u64 = 1 << 34;

/// One line of `trials.jsonl`: a trial of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialLine {
    /// The grasp order.
    pub order: GraspOrder,
    /// Who chose the contacts.
    pub method: Method,
    /// Number of the trial; the same number is the same scene and goal for every method.
    pub index: u64,
    /// How it ended.
    pub outcome: TrialOutcome,
    /// Why, if it failed.
    pub detail: String,
    /// Simulated steps.
    pub steps: u64,
    /// Largest position (m), rotation (rad) and joint error (rad or m) at the end.
    pub final_errors: [f64; 4],
    /// The factor on all thresholds at which it would have succeeded; none if it did not get so far.
    pub threshold_factor: Option<f64>,
    /// What was known of its goal before anything moved; not in files of older versions.
    #[serde(default)]
    pub goal: GoalReach,
    /// The dependency root; not in files of older versions.
    #[serde(default)]
    pub root: u16,
}

/// Everything that trials of the table run on.
#[derive(Debug)]
pub struct Evaluation<'a> {
    config: &'a Config,
    scenes: Vec<Scene>,
    seed: u64,
    methods: Vec<(Method, LearnedContacts)>,
}

impl<'a> Evaluation<'a> {
    /// The table of this configuration and run seed, for these models.
    pub fn new(config: &'a Config, run_seed: u64, methods: Vec<(Method, LearnedContacts)>) -> Result<Self, Failure> {
        let mut stream = Stream::new(run_seed, &[EVALUATION]);
        let seed = u64::from(stream.bits()) << 32 | u64::from(stream.bits());
        Ok(Self { config, scenes: scenes(config, config.evaluate.instances)?, seed, methods })
    }

    /// The table of a run directory, for the networks that it holds; `config` and `run_seed` are those it was made with.
    pub fn of_run(run: &Path, config: &'a Config, run_seed: u64) -> Result<Self, Failure> {
        Self::new(config, run_seed, load_methods(&run.join("models"), config)?)
    }

    /// The models of `method`, if they are here.
    pub fn model(&self, method: Method) -> Option<&LearnedContacts> {
        self.methods.iter().find(|(name, _)| *name == method).map(|(_, model)| model)
    }

    /// Runs one trial of the table; the same call gives the same trial, bit for bit.
    pub fn trial(&self, order: GraspOrder, method: Method, index: u64, recording: Recording) -> Option<Trial> {
        self.model(method).map(|model| self.trial_by(model, order, index, recording))
    }

    /// Runs a trial of the table's scenes and goals with contacts that anyone chooses.
    pub fn trial_by(&self, model: &dyn ContactModel, order: GraspOrder, index: u64, recording: Recording) -> Trial {
        run_trial(self.scene(index), &self.config.trial_config(), model, order, (self.seed, index), recording)
    }

    /// The scene of a trial.
    pub fn scene(&self, index: u64) -> &Scene {
        &self.scenes[scene_of_trial(self.seed, index, self.scenes.len())]
    }

    /// Runs every cell in the current rayon pool, less the trials that are `there`; lines by order, method, index.
    ///
    /// Every trial is kept with its motion as soon as it ends. Lines of trials that the table does not have are refused.
    pub fn run(&self, kept: &KeptTrials, there: Vec<TrialLine>) -> Result<Vec<TrialLine>, Failure> {
        let evaluate = &self.config.evaluate;
        let mut jobs = Vec::new();
        for &order in &evaluate.orders {
            for (method, _) in &self.methods {
                jobs.extend((0..evaluate.trials).map(|index| (order, *method, index)));
            }
        }
        let key = |line: &TrialLine| (line.order, line.method, line.index);
        let mut lines: BTreeMap<_, TrialLine> = there.into_iter().map(|line| (key(&line), line)).collect();
        let wanted: BTreeSet<_> = jobs.iter().copied().collect();
        if let Some((order, method, index)) = lines.keys().find(|key| !wanted.contains(key)) {
            let (order, method) = (order.name(), method.name());
            return Err(Failure::bad_input(format!("a kept trial {index} of {method}, {order}: not of this table")));
        }
        let bar = progress_bar("evaluate", jobs.len() as u64);
        bar.set_position(lines.len() as u64);
        bar.reset_eta();
        let missing: Vec<_> = jobs.iter().filter(|job| !lines.contains_key(job)).collect();
        let line = |&&(order, method, index): &&(GraspOrder, Method, u64)| {
            let Some(trial) = self.trial(order, method, index, Recording::On) else { return Ok(None) };
            let line = TrialLine::new(order, method, &trial);
            kept.keep(&line, trial.rollout.as_ref())?;
            bar.inc(1);
            Ok(Some(line))
        };
        let run: Vec<Option<TrialLine>> = missing.par_iter().map(line).collect::<Result<_, Failure>>()?;
        bar.finish();
        lines.extend(run.into_iter().flatten().map(|line| (key(&line), line)));
        Ok(jobs.iter().filter_map(|job| lines.remove(job)).collect())
    }

    /// The cells that these trials make.
    pub fn results(&self, info: &RunInfo, lines: &[TrialLine]) -> Results {
        let (object, robots) = (self.config.object_name(), &self.config.robots.names);
        let mut cells = Vec::new();
        for &order in &self.config.evaluate.orders {
            for (method, _) in &self.methods {
                let of_cell = || lines.iter().filter(|line| line.order == order && line.method == *method);
                let cell = Cell::new(object, robots, order, *method, of_cell().map(|line| line.outcome));
                cells.push(cell.with_goals(of_cell().map(|line| line.goal)));
            }
        }
        Results { comparisons: comparisons(lines), ..Results::new(info, cells) }
    }
}

impl TrialLine {
    /// What is kept of a trial.
    pub fn new(order: GraspOrder, method: Method, trial: &Trial) -> Self {
        let record = &trial.record;
        Self {
            order,
            method,
            index: record.index,
            outcome: record.outcome,
            detail: record.detail.clone(),
            steps: record.steps,
            final_errors: record.final_errors,
            threshold_factor: trial.threshold_factor.is_finite().then_some(trial.threshold_factor),
            goal: trial.reach,
            root: record.goal.root.0,
        }
    }
}

/// Writes `trials.jsonl` and `results.json`.
pub fn save(directory: &Path, lines: &[TrialLine], results: &Results) -> Result<(), Failure> {
    let path = directory.join("trials.jsonl");
    write_whole(&path, |file| lines.iter().try_for_each(|line| writeln!(file, "{}", serde_json::to_string(line)?)))
        .with_context(|| path.display().to_string())?;
    let path = directory.join("results.json");
    let json = serde_json::to_string_pretty(results)?;
    Ok(write_whole(&path, |file| writeln!(file, "{json}")).with_context(|| path.display().to_string())?)
}
