//! Every operation, fused and composed, against burn's own operations: values and the gradients of all inputs.

use super::{Composed, Fused, Operations};
use crate::kernels::edge::Edges;
use crate::kernels::finite_difference::normal;
use crate::kernels::gather::Picks;
use burn::backend::{Autodiff, Flex};
use burn::tensor::activation::{log_softmax, relu};
use burn::tensor::{Int, Tensor, TensorData, s};
use std::slice::from_ref;
use std::sync::Arc;

type Cpu = Autodiff<Flex>;
type T2 = Tensor<Cpu, 2>;

/// What both implementations record on in these tests.
trait OnCpu: Operations<Tape = Cpu> {}
impl OnCpu for Fused {}
impl OnCpu for Composed<Flex> {}

fn leaf(seed: u64, rows: usize, columns: usize) -> T2 {
    T2::from_data(TensorData::new(normal(seed, rows * columns), [rows, columns]), &Default::default()).require_grad()
}

/// Compares two ways to compute the same thing from the same leaves: values and all gradients, by their largest size.
#[track_caller]
fn agree(leaves: &[T2], ours: T2, stock: T2) {
    let list = |t: Tensor<Flex, 2>| t.into_data().into_vec::<f32>().unwrap();
    let close = |what: &str, a: Vec<f32>, b: Vec<f32>| {
        assert_eq!(a.len(), b.len());
        let size = b.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        assert!(size > 1e-3, "{what} is zero and tests nothing");
        let gap = a.iter().zip(&b).fold(0.0_f32, |m, (x, y)| m.max((x - y).abs()));
        assert!(gap < 2e-5 * size, "{what}: {gap} of {size}");
    };
    close("value", list(ours.clone().inner()), list(stock.clone().inner()));
    let [rows, columns] = ours.dims();
    let weight = leaf(99, rows, columns).detach();
    let (a, b) = ((ours * weight.clone()).sum().backward(), (stock * weight).sum().backward());
    for (i, leaf) in leaves.iter().enumerate() {
        close(&format!("gradient of input {i}"), list(leaf.grad(&a).unwrap()), list(leaf.grad(&b).unwrap()));
    }
}

fn stock_norm_relu(z: T2, gain: T2, bias: T2) -> T2 {
    let centred = z.clone() - z.mean_dim(0);
    let variance = centred.clone().powi_scalar(2).mean_dim(0);
    relu(centred / (variance + crate::kernels::norm::EPSILON).sqrt() * gain + bias)
}

fn stock_max(y: T2, pool: usize) -> T2 {
    let [rows, channels] = y.dims();
    y.reshape([rows / pool, pool, channels]).max_dim(1).reshape([rows / pool, channels])
}

fn stock_select(x: T2, sources: &[u32]) -> T2 {
    let index = TensorData::new(sources.iter().map(|&s| i64::from(s)).collect::<Vec<_>>(), [sources.len()]);
    x.select(0, Tensor::<Cpu, 1, Int>::from_data(index, &Default::default()))
}

fn normalised_layer<O: OnCpu>() {
    // More than two blocks of rows of every block size, the last not full.
    for pool in [1, 4] {
        let [x, w, g, b] = [leaf(1, 2612, 11), leaf(2, 11, 9), leaf(3, 1, 9), leaf(4, 1, 9)];
        let (ours, moments) = O::linear_norm_relu(x.clone(), w.clone(), g.clone(), b.clone(), pool);
        let z = x.clone().matmul(w.clone());
        let mean: Vec<f32> = z.clone().mean_dim(0).into_data().into_vec().unwrap();
        let found = O::moments(vec![moments]).remove(0);
        assert!(found.mean.iter().zip(&mean).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {mean:?}");
        assert!(found.variance.iter().all(|v| (2.0..40.0).contains(v)), "11 products of normal numbers: {found:?}");
        agree(&[x, w, g.clone(), b.clone()], ours, stock_max(stock_norm_relu(z, g, b), pool));
    }
}

#[test]
fn the_normalised_layer_agrees_with_burns_own_operations() {
    normalised_layer::<Fused>();
    normalised_layer::<Composed<Flex>>();
}

fn grouped_layer<O: OnCpu>() {
    let [x, w, g, b] = [leaf(1, 83, 6), leaf(2, 9, 13), leaf(3, 1, 13), leaf(4, 1, 13)];
    let sources: Vec<u32> = (0..700).map(|i: u32| (i * i + 3 * i) % 83).collect();
    let offsets = normal(8, 2100);
    let edges = Arc::new(Edges { picks: Picks::new(sources.clone(), 83), offsets: offsets.clone() });
    let edges = O::edges(&edges, &Default::default());
    let (ours, _) = O::edge_norm_relu(x.clone(), w.clone(), g.clone(), b.clone(), &edges, 5);
    let offsets = T2::from_data(TensorData::new(offsets, [700, 3]), &Default::default());
    let rows = Tensor::cat(vec![offsets, stock_select(x.clone(), &sources)], 1);
    let stock = stock_norm_relu(rows.matmul(w.clone()), g.clone(), b.clone());
    agree(&[x, w, g, b], ours, stock_max(stock, 5));
}

#[test]
fn the_grouped_layer_agrees_with_burns_own_operations() {
    grouped_layer::<Fused>();
    grouped_layer::<Composed<Flex>>();
}

fn linear_gather_and_maximum<O: OnCpu>() {
    let [x, w, b] = [leaf(1, 300, 7), leaf(2, 7, 3), leaf(3, 1, 3)];
    agree(&[x.clone(), w.clone(), b.clone()], O::affine(x.clone(), w.clone(), b.clone()), x.clone().matmul(w) + b);
    let sources: Vec<u32> = (0..410).map(|i: u32| (7 * i * i) % 300).collect();
    let picks = O::picks(&Arc::new(Picks::new(sources.clone(), 300)), &Default::default());
    agree(from_ref(&x), O::gather(x.clone(), &picks), stock_select(x.clone(), &sources));
    agree(from_ref(&x), O::max_pool(x.clone(), 5), stock_max(x.clone(), 5));
}

#[test]
fn linear_gather_and_maximum_agree_with_burns_own_operations() {
    linear_gather_and_maximum::<Fused>();
    linear_gather_and_maximum::<Composed<Flex>>();
}

fn modulated_layer<O: OnCpu>() {
    let [h, m, w, b] = [leaf(1, 31, 5), leaf(2, 2, 3), leaf(3, 20, 4), leaf(4, 1, 4)];
    let rows = stock_select(m.clone(), &(0..31).map(|row| u32::from(row >= 12)).collect::<Vec<_>>());
    let products = (0..3).map(|i| h.clone() * rows.clone().slice(s![.., i..i + 1]));
    let stacked = Tensor::cat(std::iter::once(h.clone()).chain(products).collect(), 1);
    let stock = stacked.matmul(w.clone()) + b.clone();
    let ours = O::modulated(h.clone(), m.clone(), w.clone(), b.clone(), &[0, 12, 31]);
    agree(&[h, m, w, b], ours, stock);
}

#[test]
fn the_modulated_layer_agrees_with_burns_own_operations() {
    modulated_layer::<Fused>();
    modulated_layer::<Composed<Flex>>();
}

fn cross_entropy<O: OnCpu>() {
    let x = leaf(1, 40, 2);
    let targets: Vec<f32> = normal(2, 80).iter().map(|t| t.abs()).collect();
    let starts = [0, 13, 40];
    let mut scaled = targets.clone();
    for cloud in starts.windows(2) {
        for finger in 0..2 {
            let rows = || (cloud[0]..cloud[1]).map(move |r| r * 2 + finger);
            let total: f32 = rows().map(|i| targets[i]).sum();
            rows().for_each(|i| scaled[i] = targets[i] / total);
        }
    }
    let p = T2::from_data(TensorData::new(scaled.clone(), [40, 2]), &Default::default());
    let term = |a: usize, b: usize| (log_softmax(x.clone().slice(s![a..b, ..]), 0) * p.clone().slice(s![a..b, ..])).sum();
    let stock = (term(0, 13) + term(13, 40)).mul_scalar(-0.25).reshape([1, 1]);
    agree(from_ref(&x), O::cross_entropy(x.clone(), &scaled, &starts).reshape([1, 1]), stock);
}

#[test]
fn cross_entropy_agrees_with_burns_own_operations() {
    cross_entropy::<Fused>();
    cross_entropy::<Composed<Flex>>();
}
