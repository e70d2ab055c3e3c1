//! The operations on the CPU: hand-written kernels with hand-written gradients, hooked into burn's automatic differentiation.

use super::{DeviceOf, Operations, Rows};
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
use burn::tensor::{Tensor, TensorData, TensorPrimitive};
use burn_flex::FlexTensor;
use std::sync::Arc;

/// The operations on the CPU.
#[derive(Debug)]
pub(crate) struct Fused;

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

impl Operations for Fused {
    type Tape = Autodiff<Flex>;
    type Picks = Arc<Picks>;
    type Edges = Arc<Edges>;
    type Moments = Moments;

    fn picks(picks: &Arc<Picks>, _: &DeviceOf<Self>) -> Self::Picks {
        Arc::clone(picks)
    }

    fn edges(edges: &Arc<Edges>, _: &DeviceOf<Self>) -> Self::Edges {
        Arc::clone(edges)
    }

    fn moments(moments: Vec<Self::Moments>) -> Vec<Moments> {
        moments
    }

    fn linear_norm_relu(
        x: Rows<Self>,
        weight: Rows<Self>,
        gain: Rows<Self>,
        bias: Rows<Self>,
        pool: usize,
    ) -> (Rows<Self>, Self::Moments) {
        let ([rows, inputs], [weight_rows, channels]) = (x.dims(), weight.dims());
        assert_eq!(inputs, weight_rows, "inputs of a linear layer");
        let ((xn, x), (wn, w), (gn, g), (bn, b)) = (open!(x), open!(weight), open!(gain), open!(bias));
        let (y, tape) = linear::norm_relu(values(&x), values(&w), values(&g), values(&b), pool);
        let moments = tape.moments.clone();
        let y = tensor(y, &[rows / pool, channels]);
        (close!(LinearNormRelu, [xn, wn, gn, bn], (x, w, Arc::new(tape)), y), moments)
    }

    fn edge_norm_relu(
        x: Rows<Self>,
        weight: Rows<Self>,
        gain: Rows<Self>,
        bias: Rows<Self>,
        edges: &Self::Edges,
        pool: usize,
    ) -> (Rows<Self>, Self::Moments) {
        let ([table_rows, inputs], [weight_rows, channels]) = (x.dims(), weight.dims());
        assert_eq!(inputs + 3, weight_rows, "inputs of a grouped layer: offset and feature");
        assert_eq!(table_rows, edges.picks.table_rows(), "feature rows of a grouped layer");
        let ((xn, x), (wn, w), (gn, g), (bn, b)) = (open!(x), open!(weight), open!(gain), open!(bias));
        let (y, tape) = edge::norm_relu(values(&x), values(&w), values(&g), values(&b), edges, pool);
        let moments = tape.moments.clone();
        let y = tensor(y, &[edges.picks.sources.len() / pool, channels]);
        (close!(EdgeNormRelu, [xn, wn, gn, bn], (x, w, Arc::clone(edges), Arc::new(tape)), y), moments)
    }

    fn affine(x: Rows<Self>, weight: Rows<Self>, bias: Rows<Self>) -> Rows<Self> {
        let ([rows, inputs], [weight_rows, channels]) = (x.dims(), weight.dims());
        assert_eq!(inputs, weight_rows, "inputs of a linear layer");
        let ((xn, x), (wn, w), (bn, b)) = (open!(x), open!(weight), open!(bias));
        let y = tensor(linear::linear(values(&x), values(&w), values(&b), channels), &[rows, channels]);
        close!(Linear, [xn, wn, bn], (x, w, channels), y)
    }

    fn modulated(h: Rows<Self>, m: Rows<Self>, weight: Rows<Self>, bias: Rows<Self>, starts: &[usize]) -> Rows<Self> {
        let ([rows, inputs], [clouds, modulators], [weight_rows, channels]) = (h.dims(), m.dims(), weight.dims());
        assert_eq!(weight_rows, (1 + modulators) * inputs, "inputs of a modulated layer");
        assert_eq!((clouds + 1, rows), (starts.len(), starts[clouds]), "clouds and rows of a modulated layer");
        let ((hn, h), (mn, m), (wn, w), (bn, b)) = (open!(h), open!(m), open!(weight), open!(bias));
        let shape = Shape { starts: starts.to_vec(), inputs, modulators, channels };
        let y = tensor(modulated::modulated(values(&h), values(&m), values(&w), values(&b), &shape), &[rows, channels]);
        close!(Modulated, [hn, mn, wn, bn], (h, m, w, Arc::new(shape)), y)
    }

    fn gather(x: Rows<Self>, picks: &Self::Picks) -> Rows<Self> {
        let [_, channels] = x.dims();
        let (xn, x) = open!(x);
        let y = tensor(picks.gather(values(&x), channels), &[picks.sources.len(), channels]);
        close!(Gather, [xn], (Arc::clone(picks), channels), y)
    }

    fn max_pool(x: Rows<Self>, k: usize) -> Rows<Self> {
        let [rows, channels] = x.dims();
        let (xn, x) = open!(x);
        let (y, winner) = max_pool::max_pool(values(&x), k, channels);
        close!(MaxPool, [xn], (Arc::new(winner), k, channels), tensor(y, &[rows / k, channels]))
    }

    fn cross_entropy(logits: Rows<Self>, targets: &[f32], starts: &[usize]) -> Tensor<Self::Tape, 1> {
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
