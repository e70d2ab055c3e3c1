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
        // Slices of one known length let the compiler drop the bounds checks and vectorise.
        let (first, second) = (&mut first[..channels], &mut second[..channels]);
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
        let (scale, shift) = (&scale[..channels], &shift[..channels]);
        for (y, z) in y.chunks_exact_mut(channels).zip(z.chunks_exact(channels)) {
            for c in 0..channels {
                y[c] = (scale[c] * z[c] + shift[c]).max(0.0);
            }
        }
    });
    y
}

/// 1 where ReLU lets the gradient through, else 0: a factor, because a branch would keep the loop from being vectorised.
fn alive(y: f32) -> f32 {
    f32::from(u8::from(y > 0.0))
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
    scale: Vec<f32>,
    shift: Vec<f32>,
    constant: Vec<f32>,
    slope: Vec<f32>,
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
        let sums = sum_blocks(rows, 2 * channels, |range, sums| {
            let (scale, shift, mean) = (&scale[..channels], &shift[..channels], &tape.moments.mean[..channels]);
            let (gain, bias) = sums.split_at_mut(channels);
            let span = range.start * channels..range.end * channels;
            for (z, dy) in tape.z[span.clone()].chunks_exact(channels).zip(dy[span].chunks_exact(channels)) {
                let (gain, bias) = (&mut gain[..channels], &mut bias[..channels]);
                for c in 0..channels {
                    let g = dy[c] * alive(scale[c] * z[c] + shift[c]);
                    gain[c] += g * (z[c] - mean[c]);
                    bias[c] += g;
                }
            }
        });
        let inverse = tape.moments.inverse_deviation();
        let gain: Vec<f32> = (0..channels).map(|c| (sums[c] * f64::from(inverse[c])) as f32).collect();
        let bias = narrow(&sums[channels..]);
        // scale (g − mean g − ẑ mean(g ẑ)) = scale g + constant + slope z.
        let slope: Vec<f32> = (0..channels).map(|c| -scale[c] * inverse[c] * gain[c] / rows as f32).collect();
        let constant = (0..channels).map(|c| -scale[c] * bias[c] / rows as f32 - slope[c] * tape.moments.mean[c]).collect();
        Self { tape, scale, shift, constant, slope, gain, bias }
    }

    /// ∂L/∂z of the rows from `first`: scale (g − mean g − ẑ mean(g ẑ)), g = ∂L/∂y where y > 0.
    pub(crate) fn dz(&self, first: usize, dy: &[f32], dz: &mut [f32]) {
        let channels = self.gain.len();
        let (scale, shift) = (&self.scale[..channels], &self.shift[..channels]);
        let (constant, slope) = (&self.constant[..channels], &self.slope[..channels]);
        let z = &self.tape.z[first * channels..first * channels + dy.len()];
        for ((z, dy), dz) in z.chunks_exact(channels).zip(dy.chunks_exact(channels)).zip(dz.chunks_exact_mut(channels)) {
            for c in 0..channels {
                let g = dy[c] * alive(scale[c] * z[c] + shift[c]);
                dz[c] = scale[c] * g + (constant[c] + slope[c] * z[c]);
            }
        }
    }
}
