//! A linear map, batch normalisation and ReLU.

use super::Pass;
use crate::kernels::blocks::vectorised;
use crate::kernels::matmul::{View, Write, product};
use crate::kernels::norm::{Moments, affine};
use crate::operations::{Operations, Rows};
use crate::parameters::{Layout, ParameterId, Parameters, Start};

/// y = relu(bn(x W)). No bias before the normalisation, which would remove it.
#[derive(Debug)]
pub(crate) struct NormLinear {
    weight: ParameterId,
    gain: ParameterId,
    bias: ParameterId,
    mean: ParameterId,
    variance: ParameterId,
    channels: usize,
}

impl NormLinear {
    /// Declares the arrays of a layer `name` with `inputs` inputs.
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, channels: usize) -> Self {
        // He et al. 2015, equation 10; the scale only sets how fast the direction of W turns, as bn removes it.
        let deviation = (2.0 / inputs as f32).sqrt();
        Self {
            weight: layout.add(format!("{name}.weight"), [inputs, channels], Start::Normal(deviation)),
            gain: layout.add(format!("{name}.norm.weight"), [1, channels], Start::Constant(1.0)),
            bias: layout.add(format!("{name}.norm.bias"), [1, channels], Start::Constant(0.0)),
            mean: layout.add(format!("{name}.norm.running_mean"), [1, channels], Start::Statistic(0.0)),
            variance: layout.add(format!("{name}.norm.running_var"), [1, channels], Start::Statistic(1.0)),
            channels,
        }
    }

    /// Training: rows × inputs → rows × channels, or the largest of every `pool` rows.
    pub(crate) fn forward<O: Operations>(&self, pass: &mut Pass<O>, x: Rows<O>, pool: usize) -> Rows<O> {
        let (weight, gain, bias) = (pass.get(self.weight), pass.get(self.gain), pass.get(self.bias));
        let (y, moments) = O::linear_norm_relu(x, weight, gain, bias, pool);
        pass.moments.push((self.mean, self.variance, moments));
        y
    }

    /// Training, on [offset, x of the source] rows: table rows × (inputs − 3) → edges × channels, or the largest of every `pool`.
    pub(crate) fn forward_edges<O: Operations>(&self, pass: &mut Pass<O>, x: Rows<O>, edges: &O::Edges, pool: usize) -> Rows<O> {
        let (weight, gain, bias) = (pass.get(self.weight), pass.get(self.gain), pass.get(self.bias));
        let (y, moments) = O::edge_norm_relu(x, weight, gain, bias, edges, pool);
        pass.moments.push((self.mean, self.variance, moments));
        y
    }

    /// Prediction: the normalisation by the running statistics folded into the weights.
    pub(crate) fn fold(&self, parameters: &Parameters) -> Folded {
        let moments = Moments { mean: parameters.get(self.mean).to_vec(), variance: parameters.get(self.variance).to_vec() };
        let (scale, shift) = affine(&moments, parameters.get(self.gain), parameters.get(self.bias));
        let mut weight = parameters.get(self.weight).to_vec();
        for row in weight.chunks_exact_mut(self.channels) {
            row.iter_mut().zip(&scale).for_each(|(w, s)| *w *= s);
        }
        Folded { weight, bias: shift }
    }
}

/// y = relu(x W + b).
#[derive(Debug, Clone)]
pub(crate) struct Folded {
    /// inputs × channels.
    pub(crate) weight: Vec<f32>,
    /// channels.
    pub(crate) bias: Vec<f32>,
}

impl Folded {
    /// Width of the output.
    pub(crate) fn channels(&self) -> usize {
        self.bias.len()
    }

    /// relu(x W + b) for rows × inputs, single-threaded, into `y`.
    pub(crate) fn apply(&self, x: &[f32], y: &mut Vec<f32>) {
        let inputs = self.weight.len() / self.channels();
        let rows = x.len() / inputs;
        y.resize(rows * self.channels(), 0.0);
        product(y, Write::Replace, View::new(x, rows, inputs), View::new(&self.weight, inputs, self.channels()));
        vectorised(
            #[inline(always)]
            || {
                for row in y.chunks_exact_mut(self.channels()) {
                    row.iter_mut().zip(&self.bias).for_each(|(y, b)| *y = (*y + b).max(0.0));
                }
            },
        );
    }
}
