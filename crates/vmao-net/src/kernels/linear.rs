//! Linear maps of rows: alone with a bias, or followed by batch normalisation and ReLU.

use super::blocks::{BLOCK, add_in_order, narrow};
use super::matmul::{View, Write, product};
use super::norm::{Gradient, Moments, Tape, accumulate};
use rayon::prelude::*;

/// y = relu(bn(x W)) and the largest of every `pool` rows; `x` rows × inputs, `weight` inputs × channels, returns groups × channels.
pub(crate) fn norm_relu(x: &[f32], weight: &[f32], gain: &[f32], bias: &[f32], pool: usize) -> (Vec<f32>, Tape) {
    let channels = gain.len();
    let inputs = weight.len() / channels;
    let rows = x.len() / inputs;
    let mut z = vec![0.0; rows * channels];
    let partials: Vec<Vec<f32>> = z
        .par_chunks_mut(BLOCK * channels)
        .zip(x.par_chunks(BLOCK * inputs))
        .map(|(z, x)| {
            product(z, Write::Replace, View::new(x, x.len() / inputs, inputs), View::new(weight, inputs, channels));
            let mut sums = vec![0.0; 2 * channels];
            accumulate(z, &mut sums);
            sums
        })
        .collect();
    let moments = Moments::from_sums(&add_in_order(&partials, 2 * channels), rows);
    Tape::new(z, moments, gain, bias, pool)
}

/// Gradients of [`norm_relu`] by x, W, γ, β.
pub(crate) fn norm_relu_backward(x: &[f32], weight: &[f32], tape: &Tape, dy: &[f32]) -> [Vec<f32>; 4] {
    let gradient = Gradient::new(tape, dy);
    let channels = tape.channels();
    let inputs = weight.len() / channels;
    let mut dx = vec![0.0; x.len()];
    let partials: Vec<Vec<f32>> = dx
        .par_chunks_mut(BLOCK * inputs)
        .zip(x.par_chunks(BLOCK * inputs))
        .enumerate()
        .map(|(block, (dx, x))| {
            let rows = x.len() / inputs;
            let mut dz = vec![0.0; rows * channels];
            gradient.dz(block * BLOCK, &mut dz);
            product(dx, Write::Replace, View::new(&dz, rows, channels), View::new(weight, inputs, channels).transposed());
            let mut dw = vec![0.0; weight.len()];
            product(&mut dw, Write::Replace, View::new(x, rows, inputs).transposed(), View::new(&dz, rows, channels));
            dw
        })
        .collect();
    let dw = narrow(&add_in_order(&partials, weight.len()));
    [dx, dw, gradient.gain, gradient.bias]
}

/// y = x W + b; `x` rows × inputs, `weight` inputs × channels, `bias` channels (or empty for none).
pub(crate) fn linear(x: &[f32], weight: &[f32], bias: &[f32], channels: usize) -> Vec<f32> {
    let inputs = weight.len() / channels;
    let mut y = vec![0.0; x.len() / inputs * channels];
    y.par_chunks_mut(BLOCK * channels).zip(x.par_chunks(BLOCK * inputs)).for_each(|(y, x)| {
        product(y, Write::Replace, View::new(x, x.len() / inputs, inputs), View::new(weight, inputs, channels));
        if !bias.is_empty() {
            for row in y.chunks_exact_mut(channels) {
                row.iter_mut().zip(bias).for_each(|(y, b)| *y += b);
            }
        }
    });
    y
}

/// Gradients of [`linear`] by x, W, b.
pub(crate) fn linear_backward(x: &[f32], weight: &[f32], dy: &[f32], channels: usize) -> [Vec<f32>; 3] {
    let inputs = weight.len() / channels;
    let mut dx = vec![0.0; x.len()];
    let partials: Vec<Vec<f32>> = dx
        .par_chunks_mut(BLOCK * inputs)
        .zip(x.par_chunks(BLOCK * inputs))
        .zip(dy.par_chunks(BLOCK * channels))
        .map(|((dx, x), dy)| {
            let rows = x.len() / inputs;
            product(dx, Write::Replace, View::new(dy, rows, channels), View::new(weight, inputs, channels).transposed());
            let mut sums = vec![0.0; weight.len() + channels];
            let (dw, db) = sums.split_at_mut(weight.len());
            product(dw, Write::Replace, View::new(x, rows, inputs).transposed(), View::new(dy, rows, channels));
            for row in dy.chunks_exact(channels) {
                db.iter_mut().zip(row).for_each(|(b, y)| *b += y);
            }
            sums
        })
        .collect();
    let mut dw = narrow(&add_in_order(&partials, weight.len() + channels));
    let db = dw.split_off(weight.len());
    [dx, dw, db]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::finite_difference::{check, dot, normal};

    // Three blocks of rows, the last not full; no two sizes equal.
    const ROWS: usize = 2 * BLOCK + 41;
    const INPUTS: usize = 5;
    const CHANNELS: usize = 7;

    #[test]
    fn normalised_outputs_have_the_asked_mean_and_deviation_before_the_relu() {
        let (x, w) = (normal(1, ROWS * INPUTS), normal(2, INPUTS * CHANNELS));
        // With a bias of 30 deviations nothing is cut off.
        let (y, tape) = norm_relu(&x, &w, &[2.0; CHANNELS], &[60.0; CHANNELS], 1);
        for c in 0..CHANNELS {
            let channel: Vec<f64> = y.iter().skip(c).step_by(CHANNELS).map(|&v| f64::from(v)).collect();
            let mean = channel.iter().sum::<f64>() / ROWS as f64;
            let variance = channel.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / ROWS as f64;
            assert!((mean - 60.0).abs() < 1e-3 && (variance - 4.0).abs() < 1e-3, "{mean} {variance}");
            let z: Vec<f64> =
                (0..ROWS).map(|r| (0..INPUTS).map(|k| f64::from(x[r * INPUTS + k] * w[k * CHANNELS + c])).sum()).collect();
            assert!((z.iter().sum::<f64>() / ROWS as f64 - f64::from(tape.moments.mean[c])).abs() < 1e-5);
        }
    }

    #[test]
    fn gradients_of_the_normalised_layer_match_finite_differences() {
        // 3 divides the rows but not a block, so groups lie across blocks.
        for pool in [1, 3] {
            let rows = ROWS / 3 * 3;
            let (x, w) = (normal(1, rows * INPUTS), normal(2, INPUTS * CHANNELS));
            let (gain, bias, weight) = (normal(3, CHANNELS), normal(4, CHANNELS), normal(5, rows / pool * CHANNELS));
            let (_, tape) = norm_relu(&x, &w, &gain, &bias, pool);
            let [dx, dw, dg, db] = norm_relu_backward(&x, &w, &tape, &weight);
            check("x", &x, &dx, &[2e-3], 0.02, |x| dot(&norm_relu(x, &w, &gain, &bias, pool).0, &weight));
            check("W", &w, &dw, &[1e-3], 0.02, |w| dot(&norm_relu(&x, w, &gain, &bias, pool).0, &weight));
            check("gain", &gain, &dg, &[1e-3], 0.02, |gain| dot(&norm_relu(&x, &w, gain, &bias, pool).0, &weight));
            check("bias", &bias, &db, &[5e-4], 0.02, |bias| dot(&norm_relu(&x, &w, &gain, bias, pool).0, &weight));
        }
    }

    #[test]
    fn gradients_of_the_plain_layer_match_finite_differences() {
        let (x, w, b) = (normal(1, ROWS * INPUTS), normal(2, INPUTS * CHANNELS), normal(3, CHANNELS));
        let weight = normal(5, ROWS * CHANNELS);
        let [dx, dw, db] = linear_backward(&x, &w, &weight, CHANNELS);
        check("x", &x, &dx, &[1e-1], 1e-3, |x| dot(&linear(x, &w, &b, CHANNELS), &weight));
        check("W", &w, &dw, &[1e-1], 1e-3, |w| dot(&linear(&x, w, &b, CHANNELS), &weight));
        check("b", &b, &db, &[1e-1], 1e-3, |b| dot(&linear(&x, &w, b, CHANNELS), &weight));
    }
}
