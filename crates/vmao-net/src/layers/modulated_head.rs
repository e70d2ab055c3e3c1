//! The last layer: two logits for every point, by weights that the latent code and the whole scene set.

use super::Pass;
use crate::kernels::modulated::{Shape, modulated, weights_of};
use crate::operations::{Operations, Rows};
use crate::parameters::{Layout, ParameterId, Parameters, Start};

/// y = h W(m) + b with W(m) = W₀ + Σᵢ mᵢ Wᵢ, where m = [latent code, a linear map of the scene's coarsest features].
#[derive(Debug)]
pub(crate) struct ModulatedHead {
    weight: ParameterId,
    bias: ParameterId,
    inputs: usize,
    modulators: usize,
    channels: usize,
}

impl ModulatedHead {
    /// Declares the arrays of a layer `name`; weights start small, so that maps start flat.
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, modulators: usize, channels: usize) -> Self {
        let deviation = 0.1 * (1.0 / inputs as f32).sqrt();
        let rows = (1 + modulators) * inputs;
        Self {
            weight: layout.add(format!("{name}.weight"), [rows, channels], Start::Normal(deviation)),
            bias: layout.add(format!("{name}.bias"), [1, channels], Start::Constant(0.0)),
            inputs,
            modulators,
            channels,
        }
    }

    /// Training: rows × inputs and clouds × modulators → rows × channels.
    pub(crate) fn forward<O: Operations>(&self, pass: &Pass<O>, h: Rows<O>, m: Rows<O>, starts: &[usize]) -> Rows<O> {
        O::modulated(h, m, pass.get(self.weight), pass.get(self.bias), starts)
    }

    /// Prediction.
    pub(crate) fn fold(&self, parameters: &Parameters) -> FoldedModulated {
        FoldedModulated {
            weight: parameters.get(self.weight).to_vec(),
            bias: parameters.get(self.bias).to_vec(),
            inputs: self.inputs,
            modulators: self.modulators,
            channels: self.channels,
        }
    }
}

/// A [`ModulatedHead`] ready for prediction.
#[derive(Debug, Clone)]
pub(crate) struct FoldedModulated {
    weight: Vec<f32>,
    bias: Vec<f32>,
    inputs: usize,
    modulators: usize,
    channels: usize,
}

impl FoldedModulated {
    /// One cloud: rows × inputs → rows × channels.
    pub(crate) fn apply(&self, h: &[f32], m: &[f32]) -> Vec<f32> {
        assert_eq!(m.len(), self.modulators, "modulators of the last layer");
        let shape = Shape { starts: vec![0, h.len() / self.inputs], inputs: self.inputs, modulators: 0, channels: self.channels };
        modulated(h, &[], &weights_of(m, &self.weight), &self.bias, &shape)
    }
}
