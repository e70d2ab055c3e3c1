//! Training: seeded, the same weights to the last bit for any number of threads.

use crate::adam::Adam;
use crate::batch::{Batch, Prepared};
use crate::config::{ModelKind, NetworkConfig, TrainingConfig};
use crate::cvae::Cvae;
use crate::device::Device;
use crate::error::Error;
use crate::kernels::cross_entropy::cross_entropy;
use crate::network::ContactNetwork;
use crate::objective::Objective;
use crate::parameters::{Layout, Parameters};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use vmao_core::random::Stream;

// Stream labels; 1 is the start of the weights, 2 and 3 are those of `course.rs`.
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
    /// Euclidean length of the gradient of all weights, mean over the batches.
    pub gradient_norm: f32,
    /// The epoch of the best validation loss so far, or this one without validation.
    pub best_epoch: usize,
}

/// A network on its way: weights, optimiser, and what the seed determines.
#[derive(Debug)]
pub(crate) struct Trainer {
    pub(crate) network: NetworkConfig,
    pub(crate) training: TrainingConfig,
    seed: u64,
    device: Device,
    pub(crate) layout: Layout,
    pub(crate) cvae: Cvae,
    pub(crate) parameters: Parameters,
    pub(crate) adam: Adam,
    /// Optimiser steps done.
    pub(crate) steps: usize,
}

/// Why a step came to nothing.
#[derive(Debug)]
pub(crate) enum Stopped {
    /// Something is no longer a finite number: what, and its value.
    NotFinite(String, f32),
    /// The device failed.
    Device(Error),
}

impl Trainer {
    pub(crate) fn new(kind: ModelKind, network: &NetworkConfig, training: &TrainingConfig, seed: u64, device: Device) -> Self {
        let (layout, cvae) = kind.layers(network);
        let parameters = layout.start(seed);
        let adam = Adam::new(layout.specs());
        Self { network: network.clone(), training: training.clone(), seed, device, layout, cvae, parameters, adam, steps: 0 }
    }

    /// Takes over what an earlier process came to.
    pub(crate) fn restore(&mut self, parameters: Parameters, (first, second): (Vec<Vec<f32>>, Vec<Vec<f32>>), steps: usize) {
        self.parameters = parameters;
        self.adam = Adam { first, second, step: steps as i32 };
        self.steps = steps;
    }

    /// Epochs until β is at its full weight.
    pub(crate) fn warm_up_epochs(&self) -> usize {
        (self.network.warm_up * self.training.epochs as f32).ceil() as usize
    }

    /// Full batches in so many examples.
    pub(crate) fn batches(&self, fitted: usize) -> usize {
        fitted / self.training.batch_size.min(fitted)
    }

    /// One pass over `fitted`, not validated.
    pub(crate) fn epoch(&mut self, epoch: usize, prepared: &[Prepared], fitted: &[usize]) -> Result<EpochReport, Error> {
        let progress = (epoch - 1) as f32 / self.training.epochs as f32;
        let beta = self.network.beta * if self.network.warm_up > 0.0 { (progress / self.network.warm_up).min(1.0) } else { 1.0 };
        let (first, last) = (self.training.learning_rate, self.training.final_learning_rate);
        let learning_rate = last + 0.5 * (first - last) * (1.0 + (std::f32::consts::PI * progress).cos());
        let order = Stream::new(self.seed, &[LABEL_ORDER, epoch as u64]).permutation(fitted.len());
        let size = self.training.batch_size.min(fitted.len());
        let (mut sum, mut length) = (Elbo { reconstruction: 0.0, kl: 0.0 }, 0.0);
        let batches = self.batches(fitted.len());
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
            let step = self.steps;
            let stepped = self.step(&batch, noise, beta, learning_rate);
            let finite =
                stepped.and_then(|terms| if number + 1 < batches { Ok(terms) } else { self.check_finite().map(|()| terms) });
            let (terms, gradient_norm) = finite.map_err(|stopped| match stopped {
                Stopped::NotFinite(what, value) => {
                    let (batch, mut examples) = (Some(number + 1), chosen);
                    examples.sort_unstable();
                    Error::Diverged { what, value, step, epoch, batch, examples }
                }
                Stopped::Device(error) => error,
            })?;
            sum.reconstruction += terms.reconstruction / batches as f32;
            sum.kl += terms.kl / batches as f32;
            length += gradient_norm / batches as f32;
        }
        Ok(EpochReport {
            epoch,
            epochs: self.training.epochs,
            training: sum,
            validation: None,
            beta,
            learning_rate,
            gradient_norm: length,
            best_epoch: epoch,
        })
    }

    /// Refuses weights, statistics and moments that are no numbers, which the losses may not show before the next batch.
    fn check_finite(&self) -> Result<(), Stopped> {
        let arrays =
            [("", &self.parameters.values), ("first moment of ", &self.adam.first), ("second moment of ", &self.adam.second)];
        for (what, arrays) in arrays {
            for (array, spec) in arrays.iter().zip(self.layout.specs()) {
                if let Some(&value) = array.iter().find(|x| !x.is_finite()) {
                    return Err(Stopped::NotFinite(format!("{what}`{}`", spec.name), value));
                }
            }
        }
        Ok(())
    }

    /// One optimiser step: the objective's terms and the length of the gradient. An error names what is not finite.
    pub(crate) fn step(&mut self, batch: &Batch, noise: Vec<f32>, beta: f32, learning_rate: f32) -> Result<(Elbo, f32), Stopped> {
        let Objective { terms, gradients, moments } = self.objective(batch, noise, beta).map_err(Stopped::Device)?;
        for (what, value) in [("reconstruction loss", terms.reconstruction), ("KL divergence", terms.kl)] {
            if !value.is_finite() {
                return Err(Stopped::NotFinite(what.to_owned(), value));
            }
        }
        for (gradient, spec) in gradients.iter().zip(self.layout.specs()) {
            if let Some(&value) = gradient.iter().flatten().find(|g| !g.is_finite()) {
                return Err(Stopped::NotFinite(format!("gradient of `{}`", spec.name), value));
            }
        }
        let squares = gradients.iter().flatten().flatten().map(|&g| f64::from(g) * f64::from(g));
        let gradient_norm = squares.sum::<f64>().sqrt() as f32;
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
        Ok((terms, gradient_norm))
    }

    /// The objective of a batch and its gradients, on the device.
    pub(crate) fn objective(&self, batch: &Batch, noise: Vec<f32>, beta: f32) -> Result<Objective, Error> {
        self.device.objective((&self.layout, &self.cvae), &self.parameters, batch, noise, beta)
    }

    /// Mean terms over `members` as predicted, z drawn from the posterior with the same noise every epoch; none of no members.
    pub(crate) fn validate(&self, epoch: usize, prepared: &[Prepared], members: &[usize]) -> Result<Option<Elbo>, Error> {
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
        let loss = |(reconstruction, kl): (f32, f32)| reconstruction + kl;
        if let Some(bad) = terms.iter().position(|&term| !loss(term).is_finite()) {
            let (what, value, examples) = ("validation loss".to_owned(), loss(terms[bad]), vec![members[bad]]);
            return Err(Error::Diverged { what, value, step: self.steps, epoch, batch: None, examples });
        }
        let mean = |sum: f32| sum / terms.len() as f32;
        let elbo = || Elbo { reconstruction: mean(terms.iter().map(|t| t.0).sum()), kl: mean(terms.iter().map(|t| t.1).sum()) };
        Ok((!terms.is_empty()).then(elbo))
    }
}
