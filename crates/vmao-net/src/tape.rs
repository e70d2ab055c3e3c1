//! The fused operations as burn sees them: a backend trait, and its implementation for the CPU with hand-written gradients.
//!
//! Network code is generic over [`PointBackend`], so another device needs only another implementation of this trait.

use crate::kernels::edge::{self, Edges};
use crate::kernels::gather::Picks;
use crate::kernels::modulated::{self, Shape};
use crate::kernels::norm::{Moments, Tape};
use crate::kernels::{cross_entropy, linear, max_pool};
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::NoCheckpointing;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::{Autodiff, Flex};
use burn::tensor::backend::AutodiffBackend;
use burn::tensor::{Tensor, TensorData, TensorPrimitive};
use burn_flex::FlexTensor;
use std::sync::Arc;

/// What training runs on: the CPU with automatic differentiation.
pub(crate) type Cpu = Autodiff<Flex>;

/// A backend that has the fused operations of point networks, with their gradients. All tensors are rows × channels; gains and biases have one row.
pub(crate) trait PointBackend: AutodiffBackend {
    /// relu(bn(x W)), the largest of every `pool` rows of it, and the batch moments of x W.
    fn linear_norm_relu(
        x: Tensor<Self, 2>,
        weight: Tensor<Self, 2>,
        gain: Tensor<Self, 2>,
        bias: Tensor<Self, 2>,
        pool: usize,
    ) -> (Tensor<Self, 2>, Moments);

    /// relu(bn([offset, x[source]] W)) over `edges`, the largest of every `pool` rows of it, and the batch moments before normalisation.
    fn edge_norm_relu(
        x: Tensor<Self, 2>,
        weight: Tensor<Self, 2>,
        gain: Tensor<Self, 2>,
        bias: Tensor<Self, 2>,
        edges: &Arc<Edges>,
        pool: usize,
    ) -> (Tensor<Self, 2>, Moments);

    /// x W + b.
    fn affine(x: Tensor<Self, 2>, weight: Tensor<Self, 2>, bias: Tensor<Self, 2>) -> Tensor<Self, 2>;

    /// h W(m) + b, W(m) = W₀ + Σᵢ mᵢ Wᵢ with the modulators m of the cloud that a row belongs to.
    fn modulated(
        h: Tensor<Self, 2>,
        m: Tensor<Self, 2>,
        weight: Tensor<Self, 2>,
        bias: Tensor<Self, 2>,
        starts: &[usize],
    ) -> Tensor<Self, 2>;

    /// The rows of x named by `picks`.
    fn gather(x: Tensor<Self, 2>, picks: &Arc<Picks>) -> Tensor<Self, 2>;

    /// The largest of every `k` consecutive rows.
    fn max_pool(x: Tensor<Self, 2>, k: usize) -> Tensor<Self, 2>;

    /// Cross entropy of target maps and logits, both points × 2, over clouds bounded by `starts`.
    fn cross_entropy(logits: Tensor<Self, 2>, targets: &[f32], starts: &[usize]) -> Tensor<Self, 1>;
}

fn tensor(values: Vec<f32>, shape: &[usize]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape.to_vec()))
}

/// The values of a tensor made contiguous by the caller.
#[expect(clippy::panic, reason = "every tensor here is f32 and was made contiguous")]
fn values(tensor: &FlexTensor) -> &[f32] {
    match tensor.as_slice::<f32>() {
        Some(values) => values,
        None => panic!("a fused operation needs a contiguous f32 tensor, found {:?}", tensor.dtype()),
    }
}

/// Takes burn's tensor apart: its place in the graph and its values, contiguous.
macro_rules! open {
    ($tensor:expr) => {{
        let primitive = $tensor.into_primitive().tensor();
        (primitive.node.clone(), primitive.primitive.to_contiguous())
    }};
}

/// Records `$op` with its state when a parent is tracked, and closes the output into a tensor again.
macro_rules! close {
    ($op:expr, $nodes:expr, $state:expr, $out:expr) => {
        Tensor::from_primitive(TensorPrimitive::Float(
            match Backward::<Flex, _>::prepare::<NoCheckpointing>($op, $nodes).compute_bound().stateful() {
                OpsKind::Tracked(prep) => prep.finish($state, $out),
                OpsKind::UnTracked(prep) => prep.finish($out),
            },
        ))
    };
}

impl PointBackend for Cpu {
    fn linear_norm_relu(
        x: Tensor<Self, 2>,
        weight: Tensor<Self, 2>,
        gain: Tensor<Self, 2>,
        bias: Tensor<Self, 2>,
        pool: usize,
    ) -> (Tensor<Self, 2>, Moments) {
        let ([rows, inputs], [weight_rows, channels]) = (x.dims(), weight.dims());
        assert_eq!(inputs, weight_rows, "inputs of a linear layer");
        let ((xn, x), (wn, w), (gn, g), (bn, b)) = (open!(x), open!(weight), open!(gain), open!(bias));
        let (y, tape) = linear::norm_relu(values(&x), values(&w), values(&g), values(&b), pool);
        let moments = tape.moments.clone();
        let y = tensor(y, &[rows / pool, channels]);
        (close!(LinearNormRelu, [xn, wn, gn, bn], (x, w, Arc::new(tape)), y), moments)
    }

    fn edge_norm_relu(
        x: Tensor<Self, 2>,
        weight: Tensor<Self, 2>,
        gain: Tensor<Self, 2>,
        bias: Tensor<Self, 2>,
        edges: &Arc<Edges>,
        pool: usize,
    ) -> (Tensor<Self, 2>, Moments) {
        let ([table_rows, inputs], [weight_rows, channels]) = (x.dims(), weight.dims());
        assert_eq!(inputs + 3, weight_rows, "inputs of a grouped layer: offset and feature");
        assert_eq!(table_rows, edges.picks.table_rows(), "feature rows of a grouped layer");
        let ((xn, x), (wn, w), (gn, g), (bn, b)) = (open!(x), open!(weight), open!(gain), open!(bias));
        let (y, tape) = edge::norm_relu(values(&x), values(&w), values(&g), values(&b), edges, pool);
        let moments = tape.moments.clone();
        let y = tensor(y, &[edges.picks.sources.len() / pool, channels]);
        (close!(EdgeNormRelu, [xn, wn, gn, bn], (x, w, Arc::clone(edges), Arc::new(tape)), y), moments)
    }

    fn affine(x: Tensor<Self, 2>, weight: Tensor<Self, 2>, bias: Tensor<Self, 2>) -> Tensor<Self, 2> {
        let ([rows, inputs], [weight_rows, channels]) = (x.dims(), weight.dims());
        assert_eq!(inputs, weight_rows, "inputs of a linear layer");
        let ((xn, x), (wn, w), (bn, b)) = (open!(x), open!(weight), open!(bias));
        let y = tensor(linear::linear(values(&x), values(&w), values(&b), channels), &[rows, channels]);
        close!(Linear, [xn, wn, bn], (x, w, channels), y)
    }

    fn modulated(
        h: Tensor<Self, 2>,
        m: Tensor<Self, 2>,
        weight: Tensor<Self, 2>,
        bias: Tensor<Self, 2>,
        starts: &[usize],
    ) -> Tensor<Self, 2> {
        let ([rows, inputs], [clouds, modulators], [weight_rows, channels]) = (h.dims(), m.dims(), weight.dims());
        assert_eq!(weight_rows, (1 + modulators) * inputs, "inputs of a modulated layer");
        assert_eq!((clouds + 1, rows), (starts.len(), starts[clouds]), "clouds and rows of a modulated layer");
        let ((hn, h), (mn, m), (wn, w), (bn, b)) = (open!(h), open!(m), open!(weight), open!(bias));
        let shape = Shape { starts: starts.to_vec(), inputs, modulators, channels };
        let y = tensor(modulated::modulated(values(&h), values(&m), values(&w), values(&b), &shape), &[rows, channels]);
        close!(Modulated, [hn, mn, wn, bn], (h, m, w, Arc::new(shape)), y)
    }

    fn gather(x: Tensor<Self, 2>, picks: &Arc<Picks>) -> Tensor<Self, 2> {
        let [_, channels] = x.dims();
        let (xn, x) = open!(x);
        let y = tensor(picks.gather(values(&x), channels), &[picks.sources.len(), channels]);
        close!(Gather, [xn], (Arc::clone(picks), channels), y)
    }

    fn max_pool(x: Tensor<Self, 2>, k: usize) -> Tensor<Self, 2> {
        let [rows, channels] = x.dims();
        let (xn, x) = open!(x);
        let (y, winner) = max_pool::max_pool(values(&x), k, channels);
        close!(MaxPool, [xn], (Arc::new(winner), k, channels), tensor(y, &[rows / k, channels]))
    }

    fn cross_entropy(logits: Tensor<Self, 2>, targets: &[f32], starts: &[usize]) -> Tensor<Self, 1> {
        assert_eq!(logits.dims()[1], cross_entropy::FINGERS, "channels of a contact map");
        let (ln, l) = open!(logits);
        let (loss, residual) = cross_entropy::cross_entropy(values(&l), targets, starts);
        let terms = (starts.len() - 1) * cross_entropy::FINGERS;
        close!(CrossEntropy, [ln], (Arc::new(residual), terms), tensor(vec![loss], &[1]))
    }
}

/// Registers each gradient with its parent, where that parent is tracked.
macro_rules! hand_out {
    ($grads:expr, $($parent:expr => $values:expr, $shape:expr);+) => {
        $(if let Some(node) = &$parent { $grads.register::<Flex>(node.id, tensor($values, $shape)); })+
    };
}

#[derive(Debug)]
struct LinearNormRelu;

impl Backward<Flex, 4> for LinearNormRelu {
    type State = (FlexTensor, FlexTensor, Arc<Tape>);

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (x, w, tape) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        let [dx, dw, dg, db] = linear::norm_relu_backward(values(x), values(w), tape, values(&dy));
        let channels = dg.len();
        let inputs = dw.len() / channels;
        let [xn, wn, gn, bn] = &ops.parents;
        let rows = dx.len() / inputs;
        hand_out!(grads, xn => dx, &[rows, inputs]; wn => dw, &[inputs, channels]; gn => dg, &[1, channels]; bn => db, &[1, channels]);
    }
}

#[derive(Debug)]
struct EdgeNormRelu;

impl Backward<Flex, 4> for EdgeNormRelu {
    type State = (FlexTensor, FlexTensor, Arc<Edges>, Arc<Tape>);

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (x, w, edges, tape) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        let [dx, dw, dg, db] = edge::norm_relu_backward(values(x), values(w), edges, tape, values(&dy));
        let channels = dg.len();
        let inputs = dw.len() / channels;
        let rows = edges.picks.table_rows();
        let [xn, wn, gn, bn] = &ops.parents;
        hand_out!(grads, xn => dx, &[rows, inputs - 3]; wn => dw, &[inputs, channels]; gn => dg, &[1, channels]; bn => db, &[1, channels]);
    }
}

#[derive(Debug)]
struct Linear;

impl Backward<Flex, 3> for Linear {
    type State = (FlexTensor, FlexTensor, usize);

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (x, w, channels) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        let [dx, dw, db] = linear::linear_backward(values(x), values(w), values(&dy), *channels);
        let inputs = dw.len() / channels;
        let [xn, wn, bn] = &ops.parents;
        let rows = dx.len() / inputs;
        hand_out!(grads, xn => dx, &[rows, inputs]; wn => dw, &[inputs, *channels]; bn => db, &[1, *channels]);
    }
}

#[derive(Debug)]
struct Modulated;

impl Backward<Flex, 4> for Modulated {
    type State = (FlexTensor, FlexTensor, FlexTensor, Arc<Shape>);

    fn backward(self, ops: Ops<Self::State, 4>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (h, m, w, shape) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        let [dh, dm, dw, db] = modulated::modulated_backward(values(h), values(m), values(w), values(&dy), shape);
        let Shape { starts, inputs, modulators, channels } = &**shape;
        let (clouds, rows) = (starts.len() - 1, starts[starts.len() - 1]);
        let [hn, mn, wn, bn] = &ops.parents;
        hand_out!(grads,
            hn => dh, &[rows, *inputs];
            mn => dm, &[clouds, *modulators];
            wn => dw, &[(1 + modulators) * inputs, *channels];
            bn => db, &[1, *channels]);
    }
}

#[derive(Debug)]
struct Gather;

impl Backward<Flex, 1> for Gather {
    type State = (Arc<Picks>, usize);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (picks, channels) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        hand_out!(grads, ops.parents[0] => picks.scatter_add(values(&dy), *channels), &[picks.table_rows(), *channels]);
    }
}

#[derive(Debug)]
struct MaxPool;

impl Backward<Flex, 1> for MaxPool {
    type State = (Arc<Vec<u32>>, usize, usize);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (winner, k, channels) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        let dx = max_pool::max_pool_backward(values(&dy), winner, *k, *channels);
        let rows = dx.len() / channels;
        hand_out!(grads, ops.parents[0] => dx, &[rows, *channels]);
    }
}

#[derive(Debug)]
struct CrossEntropy;

impl Backward<Flex, 1> for CrossEntropy {
    type State = (Arc<Vec<f32>>, usize);

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (residual, terms) = &ops.state;
        let dy = grads.consume::<Flex>(&ops.node).to_contiguous();
        let scale = values(&dy)[0] / *terms as f32;
        let dx: Vec<f32> = residual.iter().map(|r| r * scale).collect();
        let rows = dx.len() / cross_entropy::FINGERS;
        hand_out!(grads, ops.parents[0] => dx, &[rows, cross_entropy::FINGERS]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::finite_difference::normal;
    use burn::tensor::activation::{log_softmax, relu};
    use burn::tensor::{Int, s};
    use std::slice::from_ref;

    type T2 = Tensor<Cpu, 2>;

    fn leaf(seed: u64, rows: usize, columns: usize) -> T2 {
        T2::from_data(TensorData::new(normal(seed, rows * columns), [rows, columns]), &Default::default()).require_grad()
    }

    /// Compares two ways to compute the same thing from the same leaves: values and all gradients, by their largest size.
    #[track_caller]
    fn agree(leaves: &[T2], fused: T2, stock: T2) {
        let list = |t: Tensor<Flex, 2>| t.into_data().into_vec::<f32>().unwrap();
        let close = |what: &str, a: Vec<f32>, b: Vec<f32>| {
            assert_eq!(a.len(), b.len());
            let size = b.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
            assert!(size > 1e-3, "{what} is zero and tests nothing");
            let gap = a.iter().zip(&b).fold(0.0_f32, |m, (x, y)| m.max((x - y).abs()));
            assert!(gap < 2e-5 * size, "{what}: {gap} of {size}");
        };
        close("value", list(fused.clone().inner()), list(stock.clone().inner()));
        let [rows, columns] = fused.dims();
        let weight = leaf(99, rows, columns).detach();
        let (a, b) = ((fused * weight.clone()).sum().backward(), (stock * weight).sum().backward());
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

    #[test]
    fn the_fused_normalised_layer_agrees_with_burns_own_operations() {
        for pool in [1, 4] {
            let [x, w, g, b] = [leaf(1, 612, 11), leaf(2, 11, 9), leaf(3, 1, 9), leaf(4, 1, 9)];
            let (fused, _) = Cpu::linear_norm_relu(x.clone(), w.clone(), g.clone(), b.clone(), pool);
            let stock = stock_norm_relu(x.clone().matmul(w.clone()), g.clone(), b.clone());
            agree(&[x, w, g, b], fused, stock_max(stock, pool));
        }
    }

    #[test]
    fn the_fused_grouped_layer_agrees_with_burns_own_operations() {
        let [x, w, g, b] = [leaf(1, 83, 6), leaf(2, 9, 13), leaf(3, 1, 13), leaf(4, 1, 13)];
        let sources: Vec<u32> = (0..700).map(|i: u32| (i * i + 3 * i) % 83).collect();
        let offsets = normal(8, 2100);
        let edges = Arc::new(Edges { picks: Picks::new(sources.clone(), 83), offsets: offsets.clone() });
        let (fused, _) = Cpu::edge_norm_relu(x.clone(), w.clone(), g.clone(), b.clone(), &edges, 5);
        let index = Tensor::<Cpu, 1, Int>::from_data(
            TensorData::new(sources.iter().map(|&s| i64::from(s)).collect::<Vec<_>>(), [700]),
            &Default::default(),
        );
        let offsets = T2::from_data(TensorData::new(offsets, [700, 3]), &Default::default());
        let rows = Tensor::cat(vec![offsets, x.clone().select(0, index)], 1);
        let stock = stock_norm_relu(rows.matmul(w.clone()), g.clone(), b.clone());
        agree(&[x, w, g, b], fused, stock_max(stock, 5));
    }

    #[test]
    fn linear_gather_and_maximum_agree_with_burns_own_operations() {
        let [x, w, b] = [leaf(1, 300, 7), leaf(2, 7, 3), leaf(3, 1, 3)];
        agree(&[x.clone(), w.clone(), b.clone()], Cpu::affine(x.clone(), w.clone(), b.clone()), x.clone().matmul(w) + b);
        let sources: Vec<u32> = (0..410).map(|i: u32| (7 * i * i) % 300).collect();
        let index = TensorData::new(sources.iter().map(|&s| i64::from(s)).collect::<Vec<_>>(), [410]);
        let stock = x.clone().select(0, Tensor::<Cpu, 1, Int>::from_data(index, &Default::default()));
        agree(from_ref(&x), Cpu::gather(x.clone(), &Arc::new(Picks::new(sources, 300))), stock);
        agree(from_ref(&x), Cpu::max_pool(x.clone(), 5), stock_max(x.clone(), 5));
    }

    #[test]
    fn the_modulated_layer_agrees_with_burns_own_operations() {
        let [h, m, w, b] = [leaf(1, 31, 5), leaf(2, 2, 3), leaf(3, 20, 4), leaf(4, 1, 4)];
        let picks = Arc::new(Picks::new((0..31).map(|row| u32::from(row >= 12)).collect(), 2));
        let rows = Cpu::gather(m.clone(), &picks);
        let products = (0..3).map(|i| h.clone() * rows.clone().slice(s![.., i..i + 1]));
        let stacked = Tensor::cat(std::iter::once(h.clone()).chain(products).collect(), 1);
        let stock = stacked.matmul(w.clone()) + b.clone();
        let fused = Cpu::modulated(h.clone(), m.clone(), w.clone(), b.clone(), &[0, 12, 31]);
        agree(&[h, m, w, b], fused, stock);
    }

    #[test]
    fn cross_entropy_agrees_with_burns_own_operations() {
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
        agree(from_ref(&x), Cpu::cross_entropy(x.clone(), &scaled, &starts).reshape([1, 1]), stock);
    }
}
