//! From a data set to checkpoints, network by network and epoch by epoch; what was finished before is not done again.
//!
//! In `grasp-N/` lie `config.json`, `model.safetensors` with the best weights so far, and, until the network is finished,
//! `state.safetensors`: all that a later process needs to end with the same weights to the last bit.

use crate::config::Config;
use crate::failure::{Failure, OrBadInput};
use crate::interruption::keeps;
use crate::learning::{
    CONFIG, MAX_STATE_BYTES, STATE, WEIGHTS, examples, grasp_directory, load_checkpoint, read, save, trials_of_examples,
};
use crate::output::{hold, log, progress_bar};
use crate::scenes::grasps;
use crate::training_log::{EpochLine, TrainingLog};
use anyhow::{Context, anyhow};
use indicatif::ProgressBar;
use std::fs;
use std::path::Path;
use vmao_core::random::Stream;
use vmao_core::record::TrialRecord;
use vmao_net::{Checkpoint, Device, EpochReport, Error, Lesson, ModelKind, Training};

/// Names the stream that training seeds are drawn from.
const TRAINING: u64 = 1 << 33;

/// The networks of one kind, as they are to be trained.
#[derive(Debug)]
pub struct TrainingRun<'a> {
    /// Network and training.
    pub config: &'a Config,
    /// With or without latent code.
    pub kind: ModelKind,
    /// The data set.
    pub records: &'a [TrialRecord],
    /// Seed of the run.
    pub seed: u64,
    /// What computes.
    pub device: Device,
    /// Where the networks go.
    pub directory: &'a Path,
    /// The command that goes on with this run, for people.
    pub go_on: String,
}

/// What a directory holds of a training.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// Nothing.
    Nothing,
    /// Something that a training wrote.
    Training,
}

/// Whether a training was begun in `directory`.
pub fn found(directory: &Path, grasps: usize) -> Found {
    let begun = |grasp| [CONFIG, WEIGHTS, STATE].iter().any(|name| grasp_directory(directory, grasp).join(name).exists());
    if (0..grasps).any(begun) { Found::Training } else { Found::Nothing }
}

impl TrainingRun<'_> {
    /// Trains what is not trained yet of the networks of all grasp steps; returns the best weights of each, and the log.
    ///
    /// Runs in the current rayon pool. Fails if another process trains in the directory, and on files of another training.
    pub fn train(&self) -> Result<(Vec<Checkpoint>, TrainingLog), Failure> {
        let place = || self.directory.display();
        let held = hold(self.directory).with_context(|| place().to_string())?;
        let _alone = held.ok_or_else(|| anyhow!("{}: another process is training here, expected to be alone", place()))?;
        let grasps = grasps(self.config)?;
        let mut lines = TrainingLog::read(self.directory)?;
        let epochs = self.config.train.epochs as u64;
        let bar = progress_bar(&format!("train {}", self.kind.title()), grasps as u64 * epochs);
        let mut networks = Vec::with_capacity(grasps);
        for grasp in 0..grasps {
            keeps(self.kept(grasp, 0));
            networks.push(self.network(grasp, &mut lines, &bar)?);
            bar.set_position((grasp as u64 + 1) * epochs);
        }
        bar.finish();
        Ok((networks, lines))
    }

    fn network(&self, grasp: usize, lines: &mut TrainingLog, bar: &ProgressBar) -> Result<Checkpoint, Failure> {
        let place = grasp_directory(self.directory, grasp);
        let seed = u64::from(Stream::new(self.seed, &[TRAINING, grasp as u64]).bits());
        let examples = examples(self.records, grasp);
        let (kind, network, training) = (self.kind, &self.config.network, &self.config.train);
        let lesson = Lesson { kind, network, training, examples: &examples, seed, device: self.device };
        if let Some(finished) = finished(&place)? {
            finished.check_of(&lesson).with_context(|| place.display().to_string()).or_bad_input()?;
            lines.check(grasp, finished.epoch)?;
            return Ok(finished);
        }
        let mut training = Training::new(&lesson).map_err(|error| self.refused(grasp, error))?;
        let state = place.join(STATE);
        if state.exists() {
            let bytes = read(&state, MAX_STATE_BYTES)?;
            let damaged = || format!("{}; without this file, --resume trains the network from its start", state.display());
            training.restore(&bytes).with_context(damaged).or_bad_input()?;
        }
        fs::create_dir_all(&place).with_context(|| place.display().to_string())?;
        save(&place.join(CONFIG), training.config_json()?.as_bytes())?;
        lines.begin(grasp, training.epochs_done())?;
        while !training.is_over() {
            keeps(self.kept(grasp, training.epochs_done()));
            let report = training.epoch().map_err(|error| self.refused(grasp, error))?;
            lines.add(EpochLine::of(grasp, &report))?;
            save(&state, &training.state()?)?;
            if let Some(best) = training.best().filter(|best| best.epoch == report.epoch) {
                save(&place.join(WEIGHTS), &best.to_safetensors()?)?;
            }
            bar.set_position(grasp as u64 * report.epochs as u64 + report.epoch as u64);
            bar.set_prefix(words(grasp, &report));
        }
        let best = training.best().ok_or(Error::NothingToSave)?;
        if training.epochs_done() < lesson.training.epochs {
            let (done, epochs, patience) = (training.epochs_done(), lesson.training.epochs, lesson.training.patience);
            let what = format!("{}, grasp {}: stopped early", kind.title(), grasp + 1);
            let why = format!("no better validation loss for {patience} epochs; epoch {} is kept", best.epoch);
            bar.suspend(|| log(&format!("{what}, after {done} of {epochs} epochs: {why}")));
        }
        lines.end()?;
        // The state goes last: as long as it is there, the network is not finished.
        save(&place.join(WEIGHTS), &best.to_safetensors()?)?;
        fs::remove_file(&state).with_context(|| state.display().to_string())?;
        Ok(best)
    }

    /// An error with whose training it was, and the trials of the examples that it names.
    fn refused(&self, grasp: usize, error: Error) -> Failure {
        let trials = trials_of_examples(self.records, grasp);
        let named: &[usize] = match &error {
            Error::Diverged { examples, .. } => examples,
            Error::Example { index, .. } => std::slice::from_ref(index),
            _ => &[],
        };
        let named: Vec<String> = named.iter().filter_map(|&example| trials.get(example)).map(u64::to_string).collect();
        let whose = format!("grasp {} of {}, {} successful examples", grasp + 1, self.kind.title(), trials.len());
        let whose = if named.is_empty() { whose } else { format!("{whose}, here those of trials {}", named.join(", ")) };
        let is_work = matches!(error, Error::Diverged { .. });
        let error = anyhow::Error::from(error).context(whose);
        if is_work { Failure::Work(error) } else { Failure::BadInput(error) }
    }

    /// What an interruption leaves, and how to go on.
    fn kept(&self, grasp: usize, epochs: usize) -> String {
        let (place, go_on) = (self.directory.display(), &self.go_on);
        format!("the data set, {grasp} finished networks and {epochs} epochs of the next are kept in {place}; `{go_on}` goes on")
    }
}

/// The checkpoint of a network whose training came to its end.
fn finished(place: &Path) -> Result<Option<Checkpoint>, Failure> {
    let is_finished = place.join(WEIGHTS).exists() && !place.join(STATE).exists();
    if is_finished { load_checkpoint(place).map(Some) } else { Ok(None) }
}

/// The command line that goes on with a training, with what its result depends on.
pub fn go_on(config: &Path, seed: u64, data: &Path, kind: ModelKind, directory: &Path) -> String {
    let (config, data, out) = (config.display(), data.display(), directory.display());
    format!("vmao train --config {config} --seed {seed} --data {data} --model {} --resume --out {out}", kind.name())
}

fn words(grasp: usize, report: &EpochReport) -> String {
    let training = report.training;
    let validation = report.validation.map_or(String::new(), |elbo| format!(", validation {:.3}", elbo.reconstruction));
    let (epoch, best) = (report.epoch, report.best_epoch);
    let cross_entropy = format!("cross-entropy {:.3}{validation}, KL {:.3}", training.reconstruction, training.kl);
    format!("grasp {}, epoch {epoch}: {cross_entropy}, best at {best}", grasp + 1)
}
