//! A training from epoch to epoch: the best weights so far, when to stop, and how to go on after an interruption.

use crate::batch::Prepared;
use crate::checkpoint::{Checkpoint, Description};
use crate::cloud::Example;
use crate::config::{ModelKind, NetworkConfig, TrainingConfig};
use crate::device::Device;
use crate::error::Error;
use crate::lesson::Lesson;
use crate::parameters::Parameters;
use crate::sealed::{Sealed, Sealing, Wanted};
use crate::training::{Elbo, EpochReport, Trainer};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use vmao_core::random::Stream;

const LABEL_SPLIT: u64 = 2;
const LABEL_THIN: u64 = 3;

/// A training that can be put away after any epoch and taken up again: its weights end the same to the last bit.
#[derive(Debug)]
pub struct Training {
    description: Description,
    trainer: Trainer,
    prepared: Vec<Prepared>,
    /// Examples for validation, and those that are trained on.
    validation: Vec<usize>,
    fitted: Vec<usize>,
    /// Epochs done.
    epoch: usize,
    best: Option<Best>,
}

/// The weights that are kept.
#[derive(Debug, Clone)]
struct Best {
    epoch: usize,
    validation: Option<Elbo>,
    parameters: Parameters,
}

/// What a training state says of itself.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    lesson: Description,
    epoch: usize,
    steps: usize,
    best_epoch: usize,
    best_validation: Option<Elbo>,
}

impl Training {
    /// A training from its start. Fails on an invalid configuration and on examples that cannot be learned from.
    pub fn new(lesson: &Lesson<'_>) -> Result<Self, Error> {
        lesson.check()?;
        let (seed, examples) = (lesson.seed, lesson.examples);
        let prepare = |(i, example): (usize, &Example)| {
            Prepared::new(example, lesson.network, &mut Stream::new(seed, &[LABEL_THIN, i as u64]))
        };
        let mut fitted = Stream::new(seed, &[LABEL_SPLIT]).permutation(examples.len());
        let held_out = (examples.len() as f32 * lesson.training.validation_fraction).round() as usize;
        let validation = fitted.drain(..held_out.min(examples.len() - 1)).collect();
        Ok(Self {
            description: lesson.description(),
            trainer: Trainer::new(lesson.kind, lesson.network, lesson.training, seed, lesson.device),
            prepared: examples.par_iter().enumerate().map(prepare).collect(),
            validation,
            fitted,
            epoch: 0,
            best: None,
        })
    }

    /// Epochs done.
    pub fn epochs_done(&self) -> usize {
        self.epoch
    }

    /// Whether all epochs are done, or the validation loss has not become better for `patience` of them after the warm-up of β.
    pub fn is_over(&self) -> bool {
        let training = &self.trainer.training;
        let best = self.best.as_ref().map_or(0, |best| best.epoch);
        let waited = self.epoch.saturating_sub(best.max(self.trainer.warm_up_epochs()));
        let in_vain = training.patience > 0 && !self.validation.is_empty() && waited >= training.patience;
        self.epoch >= training.epochs || in_vain
    }

    /// The next epoch. An error names what is not finite, the step and the examples; the training cannot go on then.
    pub fn epoch(&mut self) -> Result<EpochReport, Error> {
        let epoch = self.epoch + 1;
        let mut report = self.trainer.epoch(epoch, &self.prepared, &self.fitted)?;
        report.validation = self.trainer.validate(epoch, &self.prepared, &self.validation)?;
        let loss = |elbo: Elbo| elbo.reconstruction + self.trainer.network.beta * elbo.kl;
        let best = self.best.as_ref().and_then(|best| best.validation);
        if report.validation.zip(best).is_none_or(|(new, old)| loss(new) < loss(old)) {
            let (validation, parameters) = (report.validation, self.trainer.parameters.clone());
            self.best = Some(Best { epoch, validation, parameters });
        }
        report.best_epoch = self.best.as_ref().map_or(epoch, |best| best.epoch);
        self.epoch = epoch;
        Ok(report)
    }

    /// The weights of the best validation loss so far, or of the last epoch without validation; none before the first epoch.
    pub fn best(&self) -> Option<Checkpoint> {
        let best = self.best.as_ref()?;
        let (epoch, validation, parameters) = (best.epoch, best.validation, best.parameters.clone());
        Some(self.description.checkpoint(epoch, validation, parameters))
    }

    /// The configuration beside the weights, known from the start.
    pub fn config_json(&self) -> Result<String, Error> {
        self.description.to_json()
    }

    /// All that a later process needs to go on from here, as a safetensors file: weights, Adam's moments, the best weights.
    ///
    /// Fails before the first epoch.
    pub fn state(&self) -> Result<Vec<u8>, Error> {
        let best = self.best.as_ref().ok_or(Error::NothingToSave)?;
        let (trainer, layout) = (&self.trainer, &self.trainer.layout);
        let mut sealing = Sealing::default();
        sealing.add("weights.", layout, &trainer.parameters.values);
        sealing.add("best.", layout, &best.parameters.values);
        sealing.add("adam.first.", layout, &trainer.adam.first);
        sealing.add("adam.second.", layout, &trainer.adam.second);
        sealing.finish(&State {
            lesson: self.description.clone(),
            epoch: self.epoch,
            steps: trainer.steps,
            best_epoch: best.epoch,
            best_validation: best.validation,
        })
    }

    /// Goes on from a state. Refuses one of another lesson, naming what differs, and one that is damaged.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let mut file = Sealed::open(bytes)?;
        let state: State = file.description()?;
        state.lesson.check_same("the training state", &self.description, "this training")?;
        let layout = &self.trainer.layout;
        let parameters = file.parameters("weights.", layout, Wanted::Weights)?;
        let best = file.parameters("best.", layout, Wanted::Weights)?;
        let first = file.parameters("adam.first.", layout, Wanted::Moments)?;
        let second = file.parameters("adam.second.", layout, Wanted::Moments)?;
        file.finish("training state of this configuration")?;
        let (batches, most) = (self.trainer.batches(self.fitted.len()), self.trainer.training.epochs);
        let (epoch, steps) = (state.epoch, state.steps);
        if !(1..=most).contains(&epoch) || steps != epoch * batches || !(1..=epoch).contains(&state.best_epoch) {
            let found = format!("epoch {epoch}, step {steps}, best epoch {}", state.best_epoch);
            let expected = format!("an epoch from 1 to {most}, {batches} steps in each, the best among them");
            return Err(Error::Input { what: "the training state".to_owned(), found, expected });
        }
        self.trainer.restore(parameters, (first.values, second.values), steps);
        self.best = Some(Best { epoch: state.best_epoch, validation: state.best_validation, parameters: best });
        self.epoch = epoch;
        Ok(())
    }
}

/// Trains a network from nothing on `device`. The weights of the best validation loss (or of the last epoch, without validation) are returned.
///
/// `on_epoch` sees every epoch and may end the training early with [`ControlFlow::Break`]. Fails on an invalid configuration or
/// example, and as soon as a loss or a weight is not finite.
pub fn train(
    kind: ModelKind,
    network: &NetworkConfig,
    training: &TrainingConfig,
    examples: &[Example],
    seed: u64,
    device: Device,
    on_epoch: &mut dyn FnMut(&EpochReport) -> ControlFlow<()>,
) -> Result<Checkpoint, Error> {
    let mut course = Training::new(&Lesson { kind, network, training, examples, seed, device })?;
    while !course.is_over() {
        if on_epoch(&course.epoch()?).is_break() {
            break;
        }
    }
    course.best().ok_or(Error::NothingToSave)
}
