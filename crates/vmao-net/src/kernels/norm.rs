//! Batch normalisation followed by ReLU on rows, as one affine map forward and two sums backward.
//!
//! ẑ = (z − μ) / √(σ² + ε), y = max(0, γ ẑ + β), with μ and the biased σ² over all rows (Ioffe & Szegedy 2015, Algorithm 1).

use super::blocks::{BLOCK, narrow, sum_blocks};
use rayon::prelude::*;

/// ε of the variance, as in PointNet++'s and PyTorch's layers.
pub(crate) const EPSILON: f32 = 1e-5;

/// Mean and biased variance of each channel over the rows of one batch.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Moments {
    /// μ, per channel.
    pub(crate) mean: Vec<f32>,
    /// σ², per channel.
    pub(crate) variance: Vec<f32>,
}

impl Moments {
    /// From the sums of z and then of z² over `rows`.
    pub(crate) fn from_sums(sums: &[f64], rows: usize) -> Self {
        let (first, second) = sums.split_at(sums.len() / 2);
        let mean: Vec<f64> = first.iter().map(|sum| sum / rows as f64).collect();
        let variance: Vec<f64> = second.iter().zip(&mean).map(|(sum, mean)| (sum / rows as f64 - mean * mean).max(0.0)).collect();
        Self { mean: narrow(&mean), variance: narrow(&variance) }
    }

    /// 1 / √(σ² + ε).
    pub(crate) fn inverse_deviation(&self) -> Vec<f32> {
        self.variance.iter().map(|variance| (variance + EPSILON).sqrt().recip()).collect()
    }
}

/// The affine map z ↦ scale z + shift that equals γ ẑ + β.
pub(crate) fn affine(moments: &Moments, gain: &[f32], bias: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let scale: Vec<f32> = moments.inverse_deviation().iter().zip(gain).map(|(inverse, gain)| inverse * gain).collect();
    let shift = bias.iter().zip(&scale).zip(&moments.mean).map(|((bias, scale), mean)| bias - scale * mean).collect();
    (scale, shift)
}

/// Adds Σz and Σz² of the rows of one block to `sums` (two channels' worth).
pub(crate) fn accumulate(z: &[f32], sums: &mut [f32]) {
    let channels = sums.len() / 2;
    let (first, second) = sums.split_at_mut(channels);
    for row in z.chunks_exact(channels) {
        for c in 0..channels {
            first[c] += row[c];
            second[c] += row[c] * row[c];
        }
    }
}

/// y = max(0, scale z + shift) for all rows.
pub(crate) fn affine_relu(z: &[f32], scale: &[f32], shift: &[f32]) -> Vec<f32> {
    let channels = scale.len();
    let mut y = vec![0.0; z.len()];
    y.par_chunks_mut(BLOCK * channels).zip(z.par_chunks(BLOCK * channels)).for_each(|(y, z)| {
        for (y, z) in y.chunks_exact_mut(channels).zip(z.chunks_exact(channels)) {
            for c in 0..channels {
                y[c] = (scale[c] * z[c] + shift[c]).max(0.0);
            }
        }
    });
    y
}

/// What the forward pass keeps for the backward pass: z, its moments, γ and β.
#[derive(Debug)]
pub(crate) struct Tape {
    /// Before normalisation, rows × channels.
    pub(crate) z: Vec<f32>,
    /// Batch moments of z.
    pub(crate) moments: Moments,
    /// γ.
    pub(crate) gain: Vec<f32>,
    /// β.
    pub(crate) bias: Vec<f32>,
}

/// ∂L/∂γ and ∂L/∂β, and what is needed to form ∂L/∂z block by block.
#[derive(Debug)]
pub(crate) struct Gradient<'a> {
    tape: &'a Tape,
    inverse: Vec<f32>,
    scale: Vec<f32>,
    shift: Vec<f32>,
    mean_gain: Vec<f32>,
    mean_bias: Vec<f32>,
    /// ∂L/∂γ.
    pub(crate) gain: Vec<f32>,
    /// ∂L/∂β.
    pub(crate) bias: Vec<f32>,
}

impl<'a> Gradient<'a> {
    /// Reduces `dy` (rows × channels) to the two sums that every ∂L/∂z needs.
    pub(crate) fn new(tape: &'a Tape, dy: &[f32]) -> Self {
        let channels = tape.gain.len();
        let rows = tape.z.len() / channels;
        let (scale, shift) = affine(&tape.moments, &tape.gain, &tape.bias);
        let inverse = tape.moments.inverse_deviation();
        let sums = sum_blocks(rows, 2 * channels, |range, sums| {
            let (gain, bias) = sums.split_at_mut(channels);
            let span = range.start * channels..range.end * channels;
            for (z, dy) in tape.z[span.clone()].chunks_exact(channels).zip(dy[span].chunks_exact(channels)) {
                for c in 0..channels {
                    let g = if scale[c] * z[c] + shift[c] > 0.0 { dy[c] } else { 0.0 };
                    gain[c] += g * (z[c] - tape.moments.mean[c]) * inverse[c];
                    bias[c] += g;
                }
            }
        });
        let mean: Vec<f64> = sums.iter().map(|sum| sum / rows as f64).collect();
        let (mean_gain, mean_bias) = (narrow(&mean[..channels]), narrow(&mean[channels..]));
        let (gain, bias) = (narrow(&sums[..channels]), narrow(&sums[channels..]));
        Self { tape, inverse, scale, shift, mean_gain, mean_bias, gain, bias }
    }

    /// ∂L/∂z of the rows from `first`: scale (g − mean g − ẑ mean(g ẑ)), g = ∂L/∂y where y > 0.
    pub(crate) fn dz(&self, first: usize, dy: &[f32], dz: &mut [f32]) {
        let channels = self.gain.len();
        let z = &self.tape.z[first * channels..first * channels + dy.len()];
        for ((z, dy), dz) in z.chunks_exact(channels).zip(dy.chunks_exact(channels)).zip(dz.chunks_exact_mut(channels)) {
            for c in 0..channels {
                let g = if self.scale[c] * z[c] + self.shift[c] > 0.0 { dy[c] } else { 0.0 };
                let normal = (z[c] - self.tape.moments.mean[c]) * self.inverse[c];
                dz[c] = self.scale[c] * (g - self.mean_bias[c] - normal * self.mean_gain[c]);
            }
        }
    }
}
