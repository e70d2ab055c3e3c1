//! Batch normalisation and ReLU on rows, and the maximum over groups of rows: one affine map forward, two sums backward.
//!
//! ẑ = (z − μ) / √(σ² + ε), y = max(0, γ ẑ + β), with μ and the biased σ² over all rows (Ioffe & Szegedy 2015, Algorithm 1).

use super::blocks::{BLOCK, narrow, sum_blocks, vectorised};
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
    vectorised(
        #[inline(always)]
        || {
            for row in z.chunks_exact(channels) {
                // Slices of one known length let the compiler drop the bounds checks and vectorise.
                let (first, second) = (&mut first[..channels], &mut second[..channels]);
                for c in 0..channels {
                    first[c] += row[c];
                    second[c] += row[c] * row[c];
                }
            }
        },
    );
}

/// y = max(0, scale z + shift) for all rows.
fn affine_relu(z: &[f32], scale: &[f32], shift: &[f32]) -> Vec<f32> {
    let channels = scale.len();
    let mut y = vec![0.0; z.len()];
    y.par_chunks_mut(BLOCK * channels).zip(z.par_chunks(BLOCK * channels)).for_each(|(y, z)| {
        let (scale, shift) = (&scale[..channels], &shift[..channels]);
        vectorised(
            #[inline(always)]
            || {
                for (y, z) in y.chunks_exact_mut(channels).zip(z.chunks_exact(channels)) {
                    for c in 0..channels {
                        y[c] = (scale[c] * z[c] + shift[c]).max(0.0);
                    }
                }
            },
        );
    });
    y
}

/// The largest max(0, scale z + shift) of every `pool` rows, and the row of the group that has it (the first of equals).
fn affine_relu_max(z: &[f32], scale: &[f32], shift: &[f32], pool: usize) -> (Vec<f32>, Vec<u32>) {
    let channels = scale.len();
    assert!(z.len().is_multiple_of(pool * channels), "groups of {pool} rows");
    let groups = z.len() / (pool * channels);
    let (mut best, mut winner) = (vec![0.0; groups * channels], vec![0_u32; groups * channels]);
    let outputs = best.par_chunks_mut(BLOCK * channels).zip(winner.par_chunks_mut(BLOCK * channels));
    outputs.zip(z.par_chunks(BLOCK * pool * channels)).for_each(|((best, winner), z)| {
        let (scale, shift) = (&scale[..channels], &shift[..channels]);
        let groups = best.chunks_exact_mut(channels).zip(winner.chunks_exact_mut(channels));
        vectorised(
            #[inline(always)]
            || {
                for ((best, winner), z) in groups.zip(z.chunks_exact(pool * channels)) {
                    best.fill(f32::NEG_INFINITY);
                    for (j, row) in z.chunks_exact(channels).enumerate() {
                        let (best, winner) = (&mut best[..channels], &mut winner[..channels]);
                        for c in 0..channels {
                            let y = scale[c] * row[c] + shift[c];
                            // Masks, not branches: this loop is as long as the whole grouped layer.
                            let better = 0_u32.wrapping_sub(u32::from(y > best[c]));
                            winner[c] = (winner[c] & !better) | (j as u32 & better);
                            best[c] = best[c].max(y);
                        }
                    }
                    best.iter_mut().for_each(|y| *y = y.max(0.0));
                }
            },
        );
    });
    (best, winner)
}

/// 1 where ReLU lets the gradient through, else 0: a factor, because a branch would keep the loop from being vectorised.
#[inline(always)]
fn alive(y: f32) -> f32 {
    f32::from(u8::from(y > 0.0))
}

/// What the forward pass keeps for the backward pass.
#[derive(Debug)]
pub(crate) struct Tape {
    /// Before normalisation, rows × channels.
    z: Vec<f32>,
    /// Batch moments of z.
    pub(crate) moments: Moments,
    gain: Vec<f32>,
    bias: Vec<f32>,
    /// Rows of a group that the maximum was taken over; 1 for none.
    pool: usize,
    /// For each group and channel the row that won; empty without maximum.
    winner: Vec<u32>,
}

impl Tape {
    /// y = max(0, γ ẑ + β), the largest of every `pool` rows of it, and what the gradient needs.
    pub(crate) fn new(z: Vec<f32>, moments: Moments, gain: &[f32], bias: &[f32], pool: usize) -> (Vec<f32>, Self) {
        let (scale, shift) = affine(&moments, gain, bias);
        let (y, winner) =
            if pool == 1 { (affine_relu(&z, &scale, &shift), Vec::new()) } else { affine_relu_max(&z, &scale, &shift, pool) };
        (y, Self { z, moments, gain: gain.to_vec(), bias: bias.to_vec(), pool, winner })
    }

    /// Number of channels.
    pub(crate) fn channels(&self) -> usize {
        self.gain.len()
    }
}

/// ∂L/∂γ and ∂L/∂β, and what is needed to form ∂L/∂z block by block.
#[derive(Debug)]
pub(crate) struct Gradient<'a> {
    tape: &'a Tape,
    dy: &'a [f32],
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
    /// Reduces `dy` (groups × channels) to the two sums that every ∂L/∂z needs.
    pub(crate) fn new(tape: &'a Tape, dy: &'a [f32]) -> Self {
        let channels = tape.channels();
        let rows = tape.z.len() / channels;
        assert_eq!(dy.len() * tape.pool, tape.z.len(), "one gradient for each group of {} rows", tape.pool);
        let (scale, shift) = affine(&tape.moments, &tape.gain, &tape.bias);
        let sums = sum_blocks(rows / tape.pool, 2 * channels, |range, sums| {
            let (scale, shift, mean) = (&scale[..channels], &shift[..channels], &tape.moments.mean[..channels]);
            let (gain, bias) = sums.split_at_mut(channels);
            let (gain, bias) = (&mut gain[..channels], &mut bias[..channels]);
            let mut won = vec![0.0; channels];
            vectorised(
                #[inline(always)]
                || {
                    for group in range {
                        let z = &tape.winning_row(group, &mut won)[..channels];
                        let dy = &dy[group * channels..(group + 1) * channels];
                        for c in 0..channels {
                            let g = dy[c] * alive(scale[c] * z[c] + shift[c]);
                            gain[c] += g * (z[c] - mean[c]);
                            bias[c] += g;
                        }
                    }
                },
            );
        });
        let inverse = tape.moments.inverse_deviation();
        let gain: Vec<f32> = (0..channels).map(|c| (sums[c] * f64::from(inverse[c])) as f32).collect();
        let bias = narrow(&sums[channels..]);
        // scale (g − mean g − ẑ mean(g ẑ)) = scale g + constant + slope z.
        let slope: Vec<f32> = (0..channels).map(|c| -scale[c] * inverse[c] * gain[c] / rows as f32).collect();
        let constant = (0..channels).map(|c| -scale[c] * bias[c] / rows as f32 - slope[c] * tape.moments.mean[c]).collect();
        Self { tape, dy, scale, shift, constant, slope, gain, bias }
    }

    /// ∂L/∂z of the rows from `first`: scale (g − mean g − ẑ mean(g ẑ)), g = ∂L/∂y where the row won and y > 0.
    pub(crate) fn dz(&self, first: usize, dz: &mut [f32]) {
        vectorised(
            #[inline(always)]
            || self.dz_inline(first, dz),
        );
    }

    #[inline(always)]
    fn dz_inline(&self, first: usize, dz: &mut [f32]) {
        let channels = self.gain.len();
        let (scale, shift) = (&self.scale[..channels], &self.shift[..channels]);
        let (constant, slope) = (&self.constant[..channels], &self.slope[..channels]);
        let last = first + dz.len() / channels;
        let z = &self.tape.z[first * channels..last * channels];
        if self.tape.pool == 1 {
            let dy = self.dy[first * channels..last * channels].chunks_exact(channels);
            for ((z, dy), dz) in z.chunks_exact(channels).zip(dy).zip(dz.chunks_exact_mut(channels)) {
                for c in 0..channels {
                    let g = dy[c] * alive(scale[c] * z[c] + shift[c]);
                    dz[c] = scale[c] * g + (constant[c] + slope[c] * z[c]);
                }
            }
            return;
        }
        for (z, dz) in z.chunks_exact(channels).zip(dz.chunks_exact_mut(channels)) {
            for c in 0..channels {
                dz[c] = constant[c] + slope[c] * z[c];
            }
        }
        for group in first / self.tape.pool..last.div_ceil(self.tape.pool) {
            for c in 0..channels {
                let row = group * self.tape.pool + self.tape.winner[group * channels + c] as usize;
                if (first..last).contains(&row) {
                    let z = self.tape.z[row * channels + c];
                    dz[(row - first) * channels + c] += scale[c] * self.dy[group * channels + c] * alive(scale[c] * z + shift[c]);
                }
            }
        }
    }
}

impl Tape {
    /// z of a group where it won, channel by channel; `buffer` holds it if it has to be put together.
    #[inline(always)]
    fn winning_row<'b>(&'b self, group: usize, buffer: &'b mut [f32]) -> &'b [f32] {
        let channels = self.channels();
        if self.pool == 1 {
            return &self.z[group * channels..(group + 1) * channels];
        }
        for c in 0..channels {
            let row = group * self.pool + self.winner[group * channels + c] as usize;
            buffer[c] = self.z[row * channels + c];
        }
        buffer
    }
}
