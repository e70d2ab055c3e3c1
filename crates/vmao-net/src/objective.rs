//! One pass of training: the objective of a batch and its gradients, on whatever the operations run on.

use crate::batch::Batch;
use crate::cvae::Cvae;
use crate::kernels::norm::Moments;
use crate::layers::Pass;
use crate::operations::{DeviceOf, Operations, Rows};
use crate::parameters::{Layout, ParameterId, Parameters};
use crate::training::Elbo;
use burn::tensor::{TensorData, Transaction};

/// What a pass brings back.
#[derive(Debug)]
pub(crate) struct Objective {
    /// Both terms.
    pub(crate) terms: Elbo,
    /// The gradient of reconstruction + β KL, as far as that is charged for, by every trained array of the layout.
    pub(crate) gradients: Vec<Option<Vec<f32>>>,
    /// Mean and variance arrays, with the batch moments that move them.
    pub(crate) moments: Vec<(ParameterId, ParameterId, Moments)>,
}

/// Runs forward and backward; `noise` is clouds × Z standard normal numbers.
pub(crate) fn objective<O: Operations>(
    (layout, cvae): (&Layout, &Cvae),
    parameters: &Parameters,
    batch: &Batch,
    noise: Vec<f32>,
    beta: f32,
    device: &DeviceOf<O>,
) -> Objective {
    let weights = parameters.values.iter().zip(layout.specs()).map(|(values, spec)| {
        let tensor = Rows::<O>::from_data(TensorData::new(values.clone(), spec.shape), device);
        if spec.is_trained() { tensor.require_grad() } else { tensor }
    });
    let mut pass = Pass::<O> { weights: weights.collect(), moments: Vec::new() };
    let terms = cvae.objective(&mut pass, batch, noise, device);
    let (reconstruction, kl) = (terms.reconstruction, terms.kl);
    let loss = match &kl {
        Some(kl) => reconstruction.clone() + kl.charged.clone().mul_scalar(beta),
        None => reconstruction.clone(),
    };
    let tape = loss.backward();
    // Everything comes back in one transaction: a device is waited for once.
    let mut back = Transaction::default().register(reconstruction.inner());
    let has_kl = kl.is_some();
    if let Some(kl) = kl {
        back = back.register(kl.whole.inner());
    }
    let mut has_gradient = Vec::with_capacity(pass.weights.len());
    for weight in &pass.weights {
        let gradient = weight.grad(&tape);
        has_gradient.push(gradient.is_some());
        if let Some(gradient) = gradient {
            back = back.register(gradient);
        }
    }
    let mut read = back.execute().into_iter().map(|data| data.into_vec::<f32>().unwrap_or_default());
    let mut next = |there: bool| if there { read.next() } else { None };
    let scalar = |values: Option<Vec<f32>>| values.map_or(0.0, |values| values[0]);
    let terms = Elbo { reconstruction: scalar(next(true)), kl: scalar(next(has_kl)) };
    let gradients = has_gradient.into_iter().map(next).collect();
    let (places, moments): (Vec<_>, Vec<_>) = pass.moments.into_iter().map(|(mean, variance, m)| ((mean, variance), m)).unzip();
    let moments = places.into_iter().zip(O::moments(moments)).map(|((mean, variance), m)| (mean, variance, m)).collect();
    Objective { terms, gradients, moments }
}
