//! Training: seeded, the same weights to the last bit for any number of threads.

use crate::adam::Adam;
use crate::batch::{Batch, Prepared};
use crate::checkpoint::Checkpoint;
use crate::cloud::{Example, check_cloud};
use crate::config::{ModelKind, NetworkConfig, TrainingConfig};
use crate::cvae::Cvae;
use crate::error::Error;
use crate::kernels::cross_entropy::cross_entropy;
use crate::layers::Pass;
use crate::network::ContactNetwork;
use crate::parameters::{Layout, Parameters};
use crate::tape::Cpu;
use burn::backend::flex::FlexDevice;
use burn::tensor::{Tensor, TensorData};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use vmao_core::random::Stream;

// Stream labels; 1 is the start of the weights.
const LABEL_SPLIT: u64 = 2;
const LABEL_THIN: u64 = 3;
const LABEL_ORDER: u64 = 4;
const LABEL_AUGMENT: u64 = 5;
const LABEL_NOISE: u64 = 6;
const LABEL_VALIDATION: u64 = 7;

/// Weight of a new batch in the running statistics once many were seen.
const STATISTICS_RATE: f32 = 0.05;

/// The terms of the objective, averaged over examples (nats).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Elbo {
    /// Cross entropy of label and predicted maps, mean over the fingers.
    pub reconstruction: f32,
    /// KL(q(z | scene, maps) ‖ N(0, I)); zero without latent code.
    pub kl: f32,
}

/// What an epoch did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpochReport {
    /// From one.
    pub epoch: usize,
    /// How many there will be.
    pub epochs: usize,
    /// Over the epoch's augmented batches.
    pub training: Elbo,
    /// Over the validation examples, as the network predicts; none without validation examples.
    pub validation: Option<Elbo>,
    /// Weight of the KL divergence in this epoch.
    pub beta: f32,
    /// Adam's step size in this epoch.
    pub learning_rate: f32,
}

/// Trains a network from nothing. The weights of the best validation loss (or of the last epoch, without validation) are returned.
///
/// `on_epoch` sees every epoch and may end the training early with [`ControlFlow::Break`]. Fails on an invalid configuration or
/// example, and as soon as a loss or a weight is not finite.
pub fn train(
    kind: ModelKind,
    network: &NetworkConfig,
    training: &TrainingConfig,
    examples: &[Example],
    seed: u64,
    on_epoch: &mut dyn FnMut(&EpochReport) -> ControlFlow<()>,
) -> Result<Checkpoint, Error> {
    network.validate()?;
    training.validate()?;
    check_examples(examples, network)?;
    let prepared: Vec<Prepared> = examples
        .par_iter()
        .enumerate()
        .map(|(i, example)| Prepared::new(example, network, &mut Stream::new(seed, &[LABEL_THIN, i as u64])))
        .collect();
    let order = Stream::new(seed, &[LABEL_SPLIT]).permutation(examples.len());
    let held_out = (examples.len() as f32 * training.validation_fraction).round() as usize;
    let (validation, fitted) = order.split_at(held_out.min(examples.len() - 1));
    let mut trainer = Trainer::new(kind, network, training, seed);
    let mut best: Option<(f32, Checkpoint)> = None;
    for epoch in 1..=training.epochs {
        let (mean, beta, learning_rate) = trainer.epoch(epoch, &prepared, fitted)?;
        let validated = trainer.validate(&prepared, validation);
        let report = EpochReport { epoch, epochs: training.epochs, training: mean, validation: validated, beta, learning_rate };
        let loss = validated.map_or(f32::NEG_INFINITY, |elbo| elbo.reconstruction + network.beta * elbo.kl);
        if loss.is_nan() || loss == f32::INFINITY {
            return Err(Error::Diverged {
                what: "validation loss".to_owned(),
                value: loss,
                step: trainer.steps,
                epoch,
                batch: 0,
            });
        }
        if best.as_ref().is_none_or(|(least, _)| loss < *least || validated.is_none()) {
            best = Some((loss, trainer.checkpoint(epoch, validated)));
        }
        if on_epoch(&report).is_break() {
            break;
        }
    }
    best.map(|(_, checkpoint)| checkpoint).ok_or(Error::TooFewExamples { found: 0, needed: 1 })
}

pub(crate) fn check_examples(examples: &[Example], network: &NetworkConfig) -> Result<(), Error> {
    if examples.len() < 2 {
        return Err(Error::TooFewExamples { found: examples.len(), needed: 2 });
    }
    for (index, example) in examples.iter().enumerate() {
        check_cloud(&example.points, &example.colors, network.fewest_points())
            .map_err(|error| Error::Example { index, problem: error.to_string() })?;
        if example.contacts.iter().flatten().any(|x| !x.is_finite()) {
            let problem = format!("contacts are {:?}, expected finite numbers", example.contacts);
            return Err(Error::Example { index, problem });
        }
    }
    Ok(())
}

/// A network on its way: weights, optimiser, and what the seed determines.
#[derive(Debug)]
pub(crate) struct Trainer {
    kind: ModelKind,
    network: NetworkConfig,
    training: TrainingConfig,
    seed: u64,
    pub(crate) layout: Layout,
    pub(crate) cvae: Cvae,
    pub(crate) parameters: Parameters,
    adam: Adam,
    steps: usize,
}

impl Trainer {
    pub(crate) fn new(kind: ModelKind, network: &NetworkConfig, training: &TrainingConfig, seed: u64) -> Self {
        let (layout, cvae) = kind.layers(network);
        let parameters = layout.start(seed);
        let adam = Adam::new(layout.specs());
        Self { kind, network: network.clone(), training: training.clone(), seed, layout, cvae, parameters, adam, steps: 0 }
    }

    /// The network that is trained.
    pub(crate) fn network(&self) -> &NetworkConfig {
        &self.network
    }

    /// One pass over `fitted`; returns the mean terms, β and the step size.
    fn epoch(&mut self, epoch: usize, prepared: &[Prepared], fitted: &[usize]) -> Result<(Elbo, f32, f32), Error> {
        let progress = (epoch - 1) as f32 / self.training.epochs as f32;
        let beta = self.network.beta * if self.network.warm_up > 0.0 { (progress / self.network.warm_up).min(1.0) } else { 1.0 };
        let (first, last) = (self.training.learning_rate, self.training.final_learning_rate);
        let learning_rate = last + 0.5 * (first - last) * (1.0 + (std::f32::consts::PI * progress).cos());
        let order = Stream::new(self.seed, &[LABEL_ORDER, epoch as u64]).permutation(fitted.len());
        let size = self.training.batch_size.min(fitted.len());
        let mut sum = Elbo { reconstruction: 0.0, kl: 0.0 };
        let batches = fitted.len() / size;
        // A last batch that is not full would have noisier statistics; its members come first in another epoch's order.
        for (number, members) in order.chunks_exact(size).enumerate() {
            let chosen: Vec<usize> = members.iter().map(|&m| fitted[m]).collect();
            let (seed, augmentation) = (self.seed, &self.training.augmentation);
            let clouds: Vec<_> = chosen
                .par_iter()
                .map(|&i| {
                    let mut stream = Stream::new(seed, &[LABEL_AUGMENT, epoch as u64, i as u64]);
                    (&prepared[i], prepared[i].augmented(augmentation, &mut stream))
                })
                .collect();
            let batch = Batch::new(&clouds, &self.network);
            let mut stream = Stream::new(self.seed, &[LABEL_NOISE, self.steps as u64]);
            let noise = (0..batch.clouds * self.cvae.latent_size()).map(|_| stream.normal() as f32).collect();
            let terms = self.step(&batch, noise, beta, learning_rate).map_err(|(what, value)| Error::Diverged {
                what,
                value,
                step: self.steps,
                epoch,
                batch: number + 1,
            })?;
            sum.reconstruction += terms.reconstruction / batches as f32;
            sum.kl += terms.kl / batches as f32;
        }
        Ok((sum, beta, learning_rate))
    }

    /// One optimiser step; an error names what is not finite.
    pub(crate) fn step(&mut self, batch: &Batch, noise: Vec<f32>, beta: f32, learning_rate: f32) -> Result<Elbo, (String, f32)> {
        let (terms, gradients, moments) = self.gradients(batch, noise, beta);
        for (what, value) in [("reconstruction loss", terms.reconstruction), ("KL divergence", terms.kl)] {
            if !value.is_finite() {
                return Err((what.to_owned(), value));
            }
        }
        for (gradient, spec) in gradients.iter().zip(self.layout.specs()) {
            if let Some(&value) = gradient.iter().flatten().find(|g| !g.is_finite()) {
                return Err((format!("gradient of `{}`", spec.name), value));
            }
        }
        self.adam.update(&mut self.parameters, &gradients, learning_rate);
        self.steps += 1;
        let rate = STATISTICS_RATE.max(1.0 / self.steps as f32);
        for (mean, variance, moments) in moments {
            for (id, new) in [(mean, &moments.mean), (variance, &moments.variance)] {
                for (running, new) in self.parameters.values[id.0].iter_mut().zip(new) {
                    *running += rate * (new - *running);
                }
            }
        }
        Ok(terms)
    }

    /// The objective of a batch and its gradient by every trained array.
    pub(crate) fn gradients(&self, batch: &Batch, noise: Vec<f32>, beta: f32) -> (Elbo, Vec<Option<Vec<f32>>>, Moments) {
        let device = FlexDevice;
        let weights = self.parameters.values.iter().zip(self.layout.specs()).map(|(values, spec)| {
            let tensor = Tensor::<Cpu, 2>::from_data(TensorData::new(values.clone(), spec.shape), &device);
            if spec.is_trained() { tensor.require_grad() } else { tensor }
        });
        let mut pass = Pass { weights: weights.collect(), moments: Vec::new() };
        let terms = self.cvae.objective(&mut pass, batch, noise, &device);
        let elbo = Elbo {
            reconstruction: terms.reconstruction.clone().into_scalar(),
            kl: terms.kl.clone().map_or(0.0, Tensor::into_scalar),
        };
        let loss = match terms.kl {
            Some(kl) => terms.reconstruction + kl.mul_scalar(beta),
            None => terms.reconstruction,
        };
        let tape = loss.backward();
        let gradient = |tensor: &Tensor<Cpu, 2>| tensor.grad(&tape).and_then(|grad| grad.into_data().into_vec::<f32>().ok());
        let gradients = pass.weights.iter().map(gradient).collect();
        (elbo, gradients, pass.moments)
    }

    /// Mean terms over `members` as predicted, z drawn from the posterior with the same noise every epoch.
    pub(crate) fn validate(&self, prepared: &[Prepared], members: &[usize]) -> Option<Elbo> {
        let network = ContactNetwork::fold(&self.cvae, &self.network, &self.parameters);
        let term = |&i: &usize| {
            let example = &prepared[i];
            let scene = network.encode_prepared(example);
            let (mut latent, mut kl) = (Vec::new(), 0.0);
            if let Some((mean, log_variance)) = network.posterior(&scene, &example.maps) {
                let mut stream = Stream::new(self.seed, &[LABEL_VALIDATION, i as u64]);
                for (m, v) in mean.iter().zip(&log_variance) {
                    latent.push(m + (0.5 * v).exp() * stream.normal() as f32);
                    kl += 0.5 * (m * m + v.exp() - 1.0 - v);
                }
            }
            let logits = network.logits(&scene, &latent);
            (cross_entropy(&logits, &example.maps, &[0, example.cloud.points.len()]).0, kl)
        };
        let terms: Vec<(f32, f32)> = members.par_iter().map(term).collect();
        let mean = |sum: f32| sum / terms.len() as f32;
        (!terms.is_empty())
            .then(|| Elbo { reconstruction: mean(terms.iter().map(|t| t.0).sum()), kl: mean(terms.iter().map(|t| t.1).sum()) })
    }

    pub(crate) fn checkpoint(&self, epoch: usize, validation: Option<Elbo>) -> Checkpoint {
        Checkpoint { kind: self.kind, network: self.network.clone(), epoch, validation, parameters: self.parameters.clone() }
    }
}

/// Mean and variance arrays with the batch moments that move them.
type Moments = Vec<(crate::parameters::ParameterId, crate::parameters::ParameterId, crate::kernels::norm::Moments)>;
