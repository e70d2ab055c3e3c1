//! The first layer of a grouped MLP, with the matrix product done before the gather.
//!
//! A grouped row is [offset, feature of the source]; its product with W = [W_o; W_f] is offset·W_o + (F W_f)[source], so the
//! large product runs once per source instead of once per neighbour.

use super::blocks::{BLOCK, add_in_order, narrow, vectorised};
use super::gather::Picks;
use super::linear::{linear, linear_backward};
use super::norm::{Gradient, Moments, Tape, accumulate};
use rayon::prelude::*;

/// Neighbour pairs: which feature row each grouped row takes, and where that source lies from its centre.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Edges {
    /// Feature row of each grouped row.
    pub(crate) picks: Picks,
    /// Source minus centre, three numbers per grouped row, in units of the layer's radius.
    pub(crate) offsets: Vec<f32>,
}

/// Adds offset·W_o to each row of `z`.
pub(crate) fn add_offsets(z: &mut [f32], offsets: &[f32], weight: &[f32], channels: usize) {
    let (wx, rest) = weight.split_at(channels);
    let (wy, rest) = rest.split_at(channels);
    let (wx, wy, wz) = (&wx[..channels], &wy[..channels], &rest[..channels]);
    vectorised(
        #[inline(always)]
        || {
            for (z, o) in z.chunks_exact_mut(channels).zip(offsets.chunks_exact(3)) {
                for c in 0..channels {
                    z[c] += o[0] * wx[c] + o[1] * wy[c] + o[2] * wz[c];
                }
            }
        },
    );
}

/// y = relu(bn([offset, features[source]] W)) and the largest of every `pool` rows.
///
/// `features` table rows × inputs, `weight` (3 + inputs) × channels, returns groups × channels.
pub(crate) fn norm_relu(
    features: &[f32],
    weight: &[f32],
    gain: &[f32],
    bias: &[f32],
    edges: &Edges,
    pool: usize,
) -> (Vec<f32>, Tape) {
    let channels = gain.len();
    let table = linear(features, &weight[3 * channels..], &[], channels);
    let rows = edges.picks.sources.len();
    let mut z = vec![0.0; rows * channels];
    let partials: Vec<Vec<f32>> = z
        .par_chunks_mut(BLOCK * channels)
        .zip(edges.picks.sources.par_chunks(BLOCK))
        .zip(edges.offsets.par_chunks(BLOCK * 3))
        .map(|((z, sources), offsets)| {
            for (z, &source) in z.chunks_exact_mut(channels).zip(sources) {
                z.copy_from_slice(&table[source as usize * channels..(source as usize + 1) * channels]);
            }
            add_offsets(z, offsets, weight, channels);
            let mut sums = vec![0.0; 2 * channels];
            accumulate(z, &mut sums);
            sums
        })
        .collect();
    let moments = Moments::from_sums(&add_in_order(&partials, 2 * channels), rows);
    Tape::new(z, moments, gain, bias, pool)
}

/// Gradients of [`norm_relu`] by features, W, γ, β.
pub(crate) fn norm_relu_backward(features: &[f32], weight: &[f32], edges: &Edges, tape: &Tape, dy: &[f32]) -> [Vec<f32>; 4] {
    let gradient = Gradient::new(tape, dy);
    let channels = tape.channels();
    let mut dz = vec![0.0; edges.picks.sources.len() * channels];
    let partials: Vec<Vec<f32>> = dz
        .par_chunks_mut(BLOCK * channels)
        .zip(edges.offsets.par_chunks(BLOCK * 3))
        .enumerate()
        .map(|(block, (dz, offsets))| {
            gradient.dz(block * BLOCK, dz);
            let mut dw = vec![0.0; 3 * channels];
            vectorised(
                #[inline(always)]
                || {
                    for (dz, o) in dz.chunks_exact(channels).zip(offsets.chunks_exact(3)) {
                        for (axis, &o) in o.iter().enumerate() {
                            let dw = &mut dw[axis * channels..(axis + 1) * channels];
                            dw.iter_mut().zip(dz).for_each(|(dw, dz)| *dw += o * dz);
                        }
                    }
                },
            );
            dw
        })
        .collect();
    let mut dw = narrow(&add_in_order(&partials, 3 * channels));
    let dtable = edges.picks.scatter_add(&dz, channels);
    let [dfeatures, dw_features, _] = linear_backward(features, &weight[3 * channels..], &dtable, channels);
    dw.extend(dw_features);
    [dfeatures, dw, gradient.gain, gradient.bias]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::finite_difference::{check, dot, normal};
    use crate::kernels::linear;
    use vmao_core::random::Stream;

    const TABLE: usize = 71;
    const ROWS: usize = 2 * BLOCK + 41; // 7 · 79
    const INPUTS: usize = 5;
    const CHANNELS: usize = 7;

    fn edges() -> Edges {
        let mut s = Stream::new(4, &[]);
        let sources = (0..ROWS).map(|_| s.index(TABLE) as u32).collect();
        Edges { picks: Picks::new(sources, TABLE), offsets: normal(6, ROWS * 3) }
    }

    #[test]
    fn the_product_before_the_gather_equals_the_product_of_the_grouped_rows() {
        let (f, w, edges) = (normal(1, TABLE * INPUTS), normal(2, (INPUTS + 3) * CHANNELS), edges());
        let (gain, bias) = (normal(3, CHANNELS), normal(4, CHANNELS));
        let gathered = edges.picks.gather(&f, INPUTS);
        let mut rows = Vec::new();
        for (offset, feature) in edges.offsets.chunks(3).zip(gathered.chunks(INPUTS)) {
            rows.extend(offset.iter().chain(feature));
        }
        let (fused, _) = norm_relu(&f, &w, &gain, &bias, &edges, 1);
        let (plain, _) = linear::norm_relu(&rows, &w, &gain, &bias, 1);
        assert!(fused.iter().zip(&plain).all(|(a, b)| (a - b).abs() < 1e-4));
        assert!(fused.iter().any(|&y| y > 0.5));
    }

    #[test]
    fn gradients_match_finite_differences() {
        for pool in [1, 7] {
            let (f, w, edges) = (normal(1, TABLE * INPUTS), normal(2, (INPUTS + 3) * CHANNELS), edges());
            let (gain, bias, weight) = (normal(3, CHANNELS), normal(4, CHANNELS), normal(5, ROWS / pool * CHANNELS));
            let (_, tape) = norm_relu(&f, &w, &gain, &bias, &edges, pool);
            let [df, dw, dg, db] = norm_relu_backward(&f, &w, &edges, &tape, &weight);
            check("features", &f, &df, &[1e-3], 0.02, |f| dot(&norm_relu(f, &w, &gain, &bias, &edges, pool).0, &weight));
            check("W", &w, &dw, &[1e-3], 0.02, |w| dot(&norm_relu(&f, w, &gain, &bias, &edges, pool).0, &weight));
            check("gain", &gain, &dg, &[1e-3], 0.02, |gain| dot(&norm_relu(&f, &w, gain, &bias, &edges, pool).0, &weight));
            check("bias", &bias, &db, &[5e-4], 0.02, |bias| dot(&norm_relu(&f, &w, &gain, bias, &edges, pool).0, &weight));
        }
    }
}
