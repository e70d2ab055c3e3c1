//! Linear maps with a bias and without normalisation.

use super::Pass;
use crate::kernels::linear::linear;
use crate::operations::{Operations, Rows};
use crate::parameters::{Layout, ParameterId, Parameters, Start};

/// y = x W + b.
#[derive(Debug)]
pub(crate) struct PlainLinear {
    weight: ParameterId,
    bias: ParameterId,
    channels: usize,
}

impl PlainLinear {
    /// Declares the arrays of a layer `name`; weights start small, so that maps start flat and the latent code near its prior.
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, channels: usize) -> Self {
        let deviation = 0.1 * (1.0 / inputs as f32).sqrt();
        Self {
            weight: layout.add(format!("{name}.weight"), [inputs, channels], Start::Normal(deviation)),
            bias: layout.add(format!("{name}.bias"), [1, channels], Start::Constant(0.0)),
            channels,
        }
    }

    /// Training: rows × inputs → rows × channels.
    pub(crate) fn forward<O: Operations>(&self, pass: &Pass<O>, x: Rows<O>) -> Rows<O> {
        O::affine(x, pass.get(self.weight), pass.get(self.bias))
    }

    /// Prediction, the weights copied out.
    pub(crate) fn fold(&self, parameters: &Parameters) -> Head {
        Head { weight: parameters.get(self.weight).to_vec(), bias: parameters.get(self.bias).to_vec(), channels: self.channels }
    }
}

/// A linear map ready for prediction.
#[derive(Debug, Clone)]
pub(crate) struct Head {
    weight: Vec<f32>,
    bias: Vec<f32>,
    channels: usize,
}

impl Head {
    /// x W + b for rows × inputs.
    pub(crate) fn apply(&self, x: &[f32]) -> Vec<f32> {
        linear(x, &self.weight, &self.bias, self.channels)
    }
}
