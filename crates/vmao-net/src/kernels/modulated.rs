//! A linear map whose weights each cloud sets for itself: y = h W(m) + b with W(m) = W₀ + Σᵢ mᵢ Wᵢ.
//!
//! Products of point features and of what is known of the whole cloud; layers that add the two learn such products slowly.

use super::matmul::{View, Write, product};
use rayon::prelude::*;

/// Sizes of one modulated map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Shape {
    /// First row of each cloud, and the number of rows.
    pub(crate) starts: Vec<usize>,
    /// Width of h.
    pub(crate) inputs: usize,
    /// Numbers of m for each cloud.
    pub(crate) modulators: usize,
    /// Width of y.
    pub(crate) channels: usize,
}

/// W(m): `weight` holds W₀, W₁, … one after the other, (1 + modulators) · inputs × channels.
pub(crate) fn weights_of(m: &[f32], weight: &[f32]) -> Vec<f32> {
    let (first, rest) = weight.split_at(weight.len() / (m.len() + 1));
    let mut out = first.to_vec();
    for (&m, w) in m.iter().zip(rest.chunks_exact(first.len())) {
        out.iter_mut().zip(w).for_each(|(out, w)| *out += m * w);
    }
    out
}

/// y for all rows; `h` rows × inputs, `m` clouds × modulators, `bias` channels.
pub(crate) fn modulated(h: &[f32], m: &[f32], weight: &[f32], bias: &[f32], shape: &Shape) -> Vec<f32> {
    let clouds: Vec<Vec<f32>> = (0..shape.starts.len() - 1)
        .into_par_iter()
        .map(|cloud| {
            let rows = shape.starts[cloud + 1] - shape.starts[cloud];
            let own = weights_of(&m[cloud * shape.modulators..(cloud + 1) * shape.modulators], weight);
            let mut y = bias.repeat(rows);
            let h = &h[shape.starts[cloud] * shape.inputs..shape.starts[cloud + 1] * shape.inputs];
            product(&mut y, Write::Add, View::new(h, rows, shape.inputs), View::new(&own, shape.inputs, shape.channels));
            y
        })
        .collect();
    clouds.concat()
}

/// Gradients of [`modulated`] by h, m, W, b.
pub(crate) fn modulated_backward(h: &[f32], m: &[f32], weight: &[f32], dy: &[f32], shape: &Shape) -> [Vec<f32>; 4] {
    let block = shape.inputs * shape.channels;
    let clouds: Vec<(Vec<f32>, Vec<f32>)> = (0..shape.starts.len() - 1)
        .into_par_iter()
        .map(|cloud| {
            let span = |width: usize| shape.starts[cloud] * width..shape.starts[cloud + 1] * width;
            let rows = shape.starts[cloud + 1] - shape.starts[cloud];
            let own = weights_of(&m[cloud * shape.modulators..(cloud + 1) * shape.modulators], weight);
            let h = View::new(&h[span(shape.inputs)], rows, shape.inputs);
            let dy = View::new(&dy[span(shape.channels)], rows, shape.channels);
            let (mut dh, mut dw) = (vec![0.0; rows * shape.inputs], vec![0.0; block]);
            product(&mut dh, Write::Replace, dy, View::new(&own, shape.inputs, shape.channels).transposed());
            product(&mut dw, Write::Replace, h.transposed(), dy);
            (dh, dw)
        })
        .collect();
    let (mut dh, mut dm, mut dw) = (Vec::with_capacity(h.len()), Vec::with_capacity(m.len()), vec![0.0; weight.len()]);
    for (cloud, (own_dh, own_dw)) in clouds.iter().enumerate() {
        dh.extend_from_slice(own_dh);
        let m = &m[cloud * shape.modulators..(cloud + 1) * shape.modulators];
        for (i, &m) in std::iter::once(&1.0).chain(m).enumerate() {
            let span = i * block..(i + 1) * block;
            dw[span.clone()].iter_mut().zip(own_dw).for_each(|(dw, own)| *dw += m * own);
            if i > 0 {
                dm.push(weight[span].iter().zip(own_dw).map(|(w, own)| w * own).sum());
            }
        }
    }
    let mut db = vec![0.0; shape.channels];
    for row in dy.chunks_exact(shape.channels) {
        db.iter_mut().zip(row).for_each(|(b, y)| *b += y);
    }
    [dh, dm, dw, db]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::finite_difference::{check, dot, normal};

    #[test]
    fn gradients_match_finite_differences() {
        let shape = Shape { starts: vec![0, 5, 18, 20], inputs: 7, modulators: 4, channels: 3 };
        let (h, m, w, b) = (normal(1, 140), normal(2, 12), normal(3, 105), normal(4, 3));
        let weight = normal(5, 60);
        let [dh, dm, dw, db] = modulated_backward(&h, &m, &w, &weight, &shape);
        check("h", &h, &dh, &[1e-1], 1e-3, |h| dot(&modulated(h, &m, &w, &b, &shape), &weight));
        check("m", &m, &dm, &[1e-1], 1e-3, |m| dot(&modulated(&h, m, &w, &b, &shape), &weight));
        check("W", &w, &dw, &[1e-1], 1e-3, |w| dot(&modulated(&h, &m, w, &b, &shape), &weight));
        check("b", &b, &db, &[1e-1], 1e-3, |b| dot(&modulated(&h, &m, &w, b, &shape), &weight));
    }

    #[test]
    fn one_cloud_with_one_modulator_by_hand() {
        let shape = Shape { starts: vec![0, 1], inputs: 2, modulators: 1, channels: 1 };
        // W(3) = [1, 2] + 3 [10, 0] = [31, 2]; y = 31 + 2·5 + 0.5.
        assert_eq!(modulated(&[1.0, 5.0], &[3.0], &[1.0, 2.0, 10.0, 0.0], &[0.5], &shape), vec![41.5]);
    }
}
