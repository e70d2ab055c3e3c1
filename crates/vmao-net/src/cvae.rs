//! The conditional variational autoencoder of the supplement's Figure 2, and its deterministic sibling without latent code.
//!
//! Scene encoder → coarsest features (+ z) → set up-convolutions with skip features → two logits for every point. In training
//! z comes from the posterior encoder, which also sees the label maps: L = H(p, p̂) + β KL(q(z | scene, maps) ‖ N(0, I)).

use crate::batch::Batch;
use crate::cloud::FEATURES;
use crate::config::{LatentPlacement, ModelKind, NetworkConfig};
use crate::kernels::cross_entropy::FINGERS;
use crate::kernels::edge::Edges;
use crate::layers::{ModulatedHead, NormLinear, Pass, PlainLinear, SetAbstraction, SetUpConv};
use crate::operations::{DeviceOf, Operations, Rows};
use crate::parameters::Layout;
use burn::tensor::{Tensor, TensorData};
use std::sync::Arc;

/// Largest size of a log variance: beyond it the divergence overflows before it says anything.
pub(crate) const LOG_VARIANCE_LIMIT: f32 = 10.0;

/// Coordinates of the two maps' means, which the posterior reads beside its pooled features: what a maximum over points finds last.
const MAP_MEANS: usize = 3 * FINGERS;

/// Modulators of the last layer that the scene sets: enough for a direction or two.
const CONTEXT: usize = 4;

/// The layers of one network.
#[derive(Debug)]
pub(crate) struct Cvae {
    pub(crate) scene: Vec<SetAbstraction>,
    pub(crate) posterior: Option<Posterior>,
    /// Coarsest first.
    pub(crate) decoder: Vec<SetUpConv>,
    pub(crate) head: NormLinear,
    /// From the coarsest scene features to the scene's share of the last layer's modulators.
    pub(crate) context: PlainLinear,
    pub(crate) logits: ModulatedHead,
    pub(crate) placement: LatentPlacement,
    latent_size: usize,
    free_bits: f32,
}

/// q(z | scene, maps): an encoder of its own and the two linear maps to mean and log variance.
#[derive(Debug)]
pub(crate) struct Posterior {
    pub(crate) encoder: Vec<SetAbstraction>,
    pub(crate) mean: PlainLinear,
    pub(crate) log_variance: PlainLinear,
}

/// The terms of the objective over one batch.
#[derive(Debug)]
pub(crate) struct Terms<O: Operations> {
    /// Cross entropy, mean over clouds and fingers.
    pub(crate) reconstruction: Tensor<O::Tape, 1>,
    /// KL divergence, mean over clouds; none without latent code.
    pub(crate) kl: Option<Divergence<O>>,
}

/// KL(q(z | scene, maps) ‖ N(0, I)), mean over clouds (nats).
#[derive(Debug)]
pub(crate) struct Divergence<O: Operations> {
    /// All of it.
    pub(crate) whole: Tensor<O::Tape, 1>,
    /// What the objective charges for: Σⱼ max(λ, KLⱼ), KLⱼ the mean of the j-th number of the code (Kingma et al. 2016, eq. 15).
    pub(crate) charged: Tensor<O::Tape, 1>,
}

impl Cvae {
    /// Declares the layers; the configuration must be valid.
    pub(crate) fn new(layout: &mut Layout, kind: ModelKind, config: &NetworkConfig) -> Self {
        let encoder = |layout: &mut Layout, name: &str, mut inputs: usize| {
            let mut layers = Vec::with_capacity(config.abstraction.len());
            for (i, level) in config.abstraction.iter().enumerate() {
                let layer = SetAbstraction::new(layout, &format!("{name}.abstraction.{i}"), inputs, level);
                inputs = layer.channels();
                layers.push(layer);
            }
            layers
        };
        let scene = encoder(layout, "scene", FEATURES);
        let top = scene[scene.len() - 1].channels();
        let posterior = (kind == ModelKind::Vmao).then(|| Posterior {
            encoder: encoder(layout, "posterior", FEATURES + FINGERS),
            mean: PlainLinear::new(layout, "posterior.mean", top + MAP_MEANS, config.latent_size),
            log_variance: PlainLinear::new(layout, "posterior.log_variance", top + MAP_MEANS, config.latent_size),
        });
        let latent = if kind == ModelKind::Vmao { config.latent_size } else { 0 };
        let latent_in_skip = if config.latent_placement == LatentPlacement::EveryLevel { latent } else { 0 };
        let mut coarse = top + latent;
        let mut decoder = Vec::with_capacity(config.up_conv.len());
        for (i, layer) in config.up_conv.iter().enumerate() {
            let fine = scene.len() - 1 - i;
            let skip = if fine == 0 { FEATURES } else { scene[fine - 1].channels() };
            let layer = SetUpConv::new(layout, &format!("decoder.up_conv.{i}"), coarse, skip + latent_in_skip, layer);
            coarse = layer.channels();
            decoder.push(layer);
        }
        let head = NormLinear::new(layout, "decoder.head", coarse, config.head);
        let context = PlainLinear::new(layout, "decoder.context", top, CONTEXT);
        let logits = ModulatedHead::new(layout, "decoder.logits", config.head, latent + CONTEXT, FINGERS);
        Self {
            scene,
            posterior,
            decoder,
            head,
            context,
            logits,
            placement: config.latent_placement,
            latent_size: latent,
            free_bits: config.free_bits,
        }
    }

    /// Z, or zero without latent code.
    pub(crate) fn latent_size(&self) -> usize {
        self.latent_size
    }

    /// Both terms of the objective; `noise` is clouds × Z standard normal numbers.
    pub(crate) fn objective<O: Operations>(
        &self,
        pass: &mut Pass<O>,
        batch: &Batch,
        noise: Vec<f32>,
        device: &DeviceOf<O>,
    ) -> Terms<O> {
        let constant = |values: Vec<f32>, columns: usize| {
            let rows = values.len() / columns;
            Rows::<O>::from_data(TensorData::new(values, [rows, columns]), device)
        };
        let features = constant(batch.features.clone(), FEATURES);
        let edges = |edges: &Arc<Edges>| O::edges(edges, device);
        let (down, up): (Vec<_>, Vec<_>) = (batch.down.iter().map(edges).collect(), batch.up.iter().map(edges).collect());
        let owners: Vec<_> = batch.owners.iter().map(|picks| O::picks(picks, device)).collect();
        let scene = encode(&self.scene, pass, &features, &down);
        let mut kl = None;
        let latent = self.posterior.as_ref().map(|posterior| {
            let (mean, log_variance) = {
                let rows = constant(batch.posterior_features.clone(), FEATURES + FINGERS);
                posterior.forward(pass, batch.clouds, &down, &rows, constant(batch.map_means.clone(), MAP_MEANS))
            };
            kl = Some(Divergence::new(mean.clone(), log_variance.clone(), self.free_bits));
            mean + log_variance.mul_scalar(0.5).exp() * constant(noise, self.latent_size)
        });
        let levels = self.scene.len();
        let mut coarse = scene[levels - 1].clone();
        let mut modulators = vec![self.context.forward(pass, pool_clouds::<O>(coarse.clone(), batch.clouds))];
        modulators.extend(latent.clone());
        if let Some(z) = &latent {
            coarse = Tensor::cat(vec![coarse, O::gather(z.clone(), &owners[levels])], 1);
        }
        for (i, layer) in self.decoder.iter().enumerate() {
            let fine = levels - 1 - i;
            let mut skip = vec![if fine == 0 { features.clone() } else { scene[fine - 1].clone() }];
            if let (Some(z), LatentPlacement::EveryLevel) = (&latent, self.placement) {
                skip.push(O::gather(z.clone(), &owners[fine]));
            }
            coarse = layer.forward(pass, coarse, skip, &up[fine]);
        }
        let hidden = self.head.forward(pass, coarse, 1);
        let logits = self.logits.forward(pass, hidden, Tensor::cat(modulators, 1), &batch.starts);
        Terms { reconstruction: O::cross_entropy(logits, &batch.targets, &batch.starts), kl }
    }
}

impl Posterior {
    /// Mean and log variance, clouds × Z; `means` clouds × 6.
    fn forward<O: Operations>(
        &self,
        pass: &mut Pass<O>,
        clouds: usize,
        down: &[O::Edges],
        features: &Rows<O>,
        means: Rows<O>,
    ) -> (Rows<O>, Rows<O>) {
        let mut levels = encode(&self.encoder, pass, features, down);
        let top = levels.remove(levels.len() - 1);
        let read = Tensor::cat(vec![pool_clouds::<O>(top, clouds), means], 1);
        let log_variance = self.log_variance.forward(pass, read.clone()).clamp(-LOG_VARIANCE_LIMIT, LOG_VARIANCE_LIMIT);
        (self.mean.forward(pass, read), log_variance)
    }
}

/// The features of every level, finest first, without the input.
fn encode<O: Operations>(layers: &[SetAbstraction], pass: &mut Pass<O>, features: &Rows<O>, down: &[O::Edges]) -> Vec<Rows<O>> {
    let mut out: Vec<Rows<O>> = Vec::with_capacity(layers.len());
    for (layer, balls) in layers.iter().zip(down) {
        let finer = out.last().cloned().unwrap_or_else(|| features.clone());
        out.push(layer.forward(pass, finer, balls));
    }
    out
}

/// The largest of each feature over the coarsest points of each cloud.
fn pool_clouds<O: Operations>(top: Rows<O>, clouds: usize) -> Rows<O> {
    let [rows, _] = top.dims();
    O::max_pool(top, rows / clouds)
}

impl<O: Operations> Divergence<O> {
    /// Of clouds × Z: ½ (μ² + σ² − 1 − ln σ²), KL(N(μ, σ²) ‖ N(0, 1)) of each number (Kingma & Welling 2014, appendix B).
    fn new(mean: Rows<O>, log_variance: Rows<O>, free_bits: f32) -> Self {
        let clouds = mean.dims()[0];
        let terms = mean.powi_scalar(2) + log_variance.clone().exp() - log_variance - 1.0;
        // Not `sum`: on a GPU burn adds that up in whatever order its threads come.
        let each = terms.sum_dim(0).mul_scalar(0.5 / clouds as f32);
        let total = |each: Rows<O>| each.sum_dim(1).reshape([1]);
        Self { whole: total(each.clone()), charged: total(each.clamp_min(free_bits)) }
    }
}

impl ModelKind {
    /// The layers of this kind of network and the arrays they hold.
    pub(crate) fn layers(self, config: &NetworkConfig) -> (Layout, Cvae) {
        let mut layout = Layout::default();
        let cvae = Cvae::new(&mut layout, self, config);
        (layout, cvae)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operations::Fused;

    /// Two clouds, three numbers: the means of their divergences are 0.25, 1 and 0 nats, with λ = 0.5 only the second one is charged for.
    #[test]
    fn what_is_free_is_counted_at_its_price_and_pulls_at_nothing() {
        let device: DeviceOf<Fused> = Default::default();
        let rows = |values: [f32; 6]| Rows::<Fused>::from_data(TensorData::new(values.to_vec(), [2, 3]), &device);
        let (mean, log_variance) = (rows([1.0, 0.0, 0.0, 0.0, 2.0, 0.0]).require_grad(), rows([0.0; 6]).require_grad());
        let divergence = Divergence::<Fused>::new(mean.clone(), log_variance.clone(), 0.5);
        assert!((divergence.whole.into_scalar() - 1.25).abs() < 1e-6);
        assert!((divergence.charged.clone().into_scalar() - 2.0).abs() < 1e-6);
        let tape = divergence.charged.backward();
        let gradient = |of: &Rows<Fused>| of.grad(&tape).unwrap().into_data().to_vec::<f32>().unwrap();
        assert_eq!(gradient(&mean), [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        assert_eq!(gradient(&log_variance), [0.0; 6]);
    }
}
