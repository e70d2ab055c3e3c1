//! Linear maps of rows: alone with a bias, or followed by batch normalisation and ReLU.

use super::blocks::{BLOCK, add_in_order, narrow};
use super::matmul::{View, Write, product};
use super::norm::{Gradient, Moments, Tape, accumulate, affine, affine_relu};
use rayon::prelude::*;

/// y = relu(bn(x W)); `x` rows × inputs, `weight` inputs × channels, returns rows × channels.
pub(crate) fn norm_relu(x: &[f32], weight: &[f32], gain: &[f32], bias: &[f32]) -> (Vec<f32>, Tape) {
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
    let (scale, shift) = affine(&moments, gain, bias);
    let y = affine_relu(&z, &scale, &shift);
    (y, Tape { z, moments, gain: gain.to_vec(), bias: bias.to_vec() })
}

/// Gradients of [`norm_relu`] by x, W, γ, β.
pub(crate) fn norm_relu_backward(x: &[f32], weight: &[f32], tape: &Tape, dy: &[f32]) -> [Vec<f32>; 4] {
    let gradient = Gradient::new(tape, dy);
    let channels = tape.gain.len();
    let inputs = weight.len() / channels;
    let mut dx = vec![0.0; x.len()];
    let partials: Vec<Vec<f32>> = dx
        .par_chunks_mut(BLOCK * inputs)
        .zip(x.par_chunks(BLOCK * inputs))
        .zip(dy.par_chunks(BLOCK * channels))
        .enumerate()
        .map(|(block, ((dx, x), dy))| {
            let rows = x.len() / inputs;
            let mut dz = vec![0.0; dy.len()];
            gradient.dz(block * BLOCK, dy, &mut dz);
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
