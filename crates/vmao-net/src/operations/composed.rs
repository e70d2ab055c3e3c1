//! The operations put together from burn's tensor operations, for any backend of burn: what a GPU runs.
//!
//! Gradients are written by hand as on the CPU, so that a normalised layer keeps only its input and its product. Sums over many rows
//! go through blocks of rows: burn gives a reduced column, and a product with few outputs, to few threads.

use super::segment_sum::{SegmentSum, Segments, indices};
use super::{DeviceOf, Operations, Rows};
use crate::kernels::cross_entropy::FINGERS;
use crate::kernels::edge::Edges;
use crate::kernels::gather::Picks;
use crate::kernels::norm::{EPSILON, Moments};
use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::base::Checkpointer;
use burn::backend::autodiff::checkpoint::strategy::NoCheckpointing;
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::tensor::activation::{log_softmax, relu};
use burn::tensor::backend::Backend;
use burn::tensor::ops::Device;
use burn::tensor::{IndexingUpdateOp, Int, Tensor, TensorData, TensorPrimitive, Transaction, s};
use std::marker::PhantomData;
use std::sync::Arc;

/// The operations on the backend `B`.
#[derive(Debug)]
pub(crate) struct Composed<B>(PhantomData<B>);

/// Rows to take from a table, and the way back.
#[derive(Debug)]
pub(crate) struct DevicePicks<B: Backend> {
    sources: Tensor<B, 1, Int>,
    segments: Segments<B>,
}

impl<B: Backend> DevicePicks<B> {
    fn new(picks: &Picks, device: &Device<B>) -> Self {
        Self { sources: indices(&picks.sources, device), segments: Segments::new(picks, device) }
    }
}

/// Neighbour pairs: the picks of their sources, and their offsets, pairs × 3.
#[derive(Debug)]
pub(crate) struct DeviceEdges<B: SegmentSum> {
    picks: DevicePicks<B>,
    offsets: Tensor<Autodiff<B>, 2>,
}

/// Mean and variance of each channel, one row each.
type DeviceMoments<B> = [Tensor<B, 2>; 2];

/// Rows that one thread adds up.
const BLOCK: usize = 64;

/// Rows that one matrix product contracts.
const PRODUCT_BLOCK: usize = 1024;

fn float<B: Backend, const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device<B>) -> Tensor<B, D> {
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// Σ over the rows, one row × channels, in a fixed order: blocks of rows side by side, then the sums of the blocks.
fn column_sum<B: Backend>(x: Tensor<B, 2>) -> Tensor<B, 2> {
    let [rows, channels] = x.dims();
    if rows <= BLOCK {
        return x.sum_dim(0);
    }
    let whole = rows / BLOCK * BLOCK;
    let sums = x.clone().slice(s![..whole, ..]).reshape([rows / BLOCK, BLOCK, channels]).sum_dim(1);
    let sum = column_sum(sums.reshape([rows / BLOCK, channels]));
    if whole < rows { sum + x.slice(s![whole.., ..]).sum_dim(0) } else { sum }
}

fn column_mean<B: Backend>(x: Tensor<B, 2>) -> Tensor<B, 2> {
    let [rows, _] = x.dims();
    column_sum(x).div_scalar(rows as f32)
}

/// xᵀ y over many rows: a batch of products over blocks of rows, added up.
fn transposed_product<B: Backend>(x: Tensor<B, 2>, y: Tensor<B, 2>) -> Tensor<B, 2> {
    let ([rows, inputs], [_, channels]) = (x.dims(), y.dims());
    let blocks = rows / PRODUCT_BLOCK;
    if blocks < 2 {
        return x.transpose().matmul(y);
    }
    let whole = blocks * PRODUCT_BLOCK;
    let block = |t: Tensor<B, 2>, width| t.slice(s![..whole, ..]).reshape([blocks, PRODUCT_BLOCK, width]);
    let products = block(x.clone(), inputs).swap_dims(1, 2).matmul(block(y.clone(), channels));
    let sum = column_sum(products.reshape([blocks, inputs * channels])).reshape([inputs, channels]);
    if whole < rows { sum + x.slice(s![whole.., ..]).transpose().matmul(y.slice(s![whole.., ..])) } else { sum }
}

/// Takes a tensor apart: its place in the graph and its values.
macro_rules! open {
    ($tensor:expr) => {{
        let primitive = $tensor.into_primitive().tensor();
        (primitive.node.clone(), from_float::<B, 2>(primitive.primitive))
    }};
}

/// Records `$op` with its state when a parent is tracked, and closes the output into a tensor again.
macro_rules! close {
    ($op:expr, $nodes:expr, $state:expr, $out:expr) => {{
        let out = $out.into_primitive().tensor();
        Tensor::from_primitive(TensorPrimitive::Float(
            match Backward::<B, _>::prepare::<NoCheckpointing>($op, $nodes).compute_bound().stateful() {
                OpsKind::Tracked(prep) => prep.finish($state, out),
                OpsKind::UnTracked(prep) => prep.finish(out),
            },
        ))
    }};
}

/// Registers each gradient with its parent, where that parent is tracked.
macro_rules! hand_out {
    ($grads:expr, $($parent:expr => $value:expr);+) => {
        $(if let Some(node) = &$parent { $grads.register::<B>(node.id, $value.into_primitive().tensor()); })+
    };
}

fn from_float<B: Backend, const D: usize>(primitive: B::FloatTensorPrimitive) -> Tensor<B, D> {
    Tensor::from_primitive(TensorPrimitive::Float(primitive))
}

/// x W.
fn product<B: Backend>(x: Tensor<Autodiff<B>, 2>, weight: Tensor<Autodiff<B>, 2>) -> Tensor<Autodiff<B>, 2> {
    let ((xn, x), (wn, w)) = (open!(x), open!(weight));
    let z = x.clone().matmul(w.clone());
    close!(Product, [xn, wn], (x, w), z)
}

/// relu(bn(z)), the largest of every `pool` rows of it, and the moments of z.
fn norm_relu<B: Backend>(
    z: Tensor<Autodiff<B>, 2>,
    gain: Tensor<Autodiff<B>, 2>,
    bias: Tensor<Autodiff<B>, 2>,
    pool: usize,
) -> (Tensor<Autodiff<B>, 2>, DeviceMoments<B>) {
    let ((zn, z), (gn, gain), (bn, bias)) = (open!(z), open!(gain), open!(bias));
    let [rows, channels] = z.dims();
    let mean = column_mean(z.clone());
    let variance = column_mean((z.clone() - mean.clone()).square());
    let inverse = (variance.clone() + EPSILON).sqrt().recip();
    let scale = inverse.clone() * gain;
    let shift = bias - scale.clone() * mean.clone();
    let a = z.clone() * scale.clone() + shift.clone();
    let (a, winner) = if pool == 1 {
        (a, None)
    } else {
        let (largest, winner) = a.reshape([rows / pool, pool, channels]).max_dim_with_indices(1);
        (largest.reshape([rows / pool, channels]), Some(winner))
    };
    let state = NormState { z, mean: mean.clone(), inverse, scale, shift, winner };
    (close!(NormRelu, [zn, gn, bn], state, relu(a)), [mean, variance])
}

impl<B: SegmentSum> Operations for Composed<B> {
    type Tape = Autodiff<B>;
    type Picks = DevicePicks<B>;
    type Edges = DeviceEdges<B>;
    type Moments = DeviceMoments<B>;

    fn picks(picks: &Arc<Picks>, device: &DeviceOf<Self>) -> Self::Picks {
        DevicePicks::new(picks, device)
    }

    fn edges(edges: &Arc<Edges>, device: &DeviceOf<Self>) -> Self::Edges {
        let offsets = float(edges.offsets.clone(), [edges.picks.sources.len(), 3], device);
        DeviceEdges { picks: DevicePicks::new(&edges.picks, device), offsets }
    }

    fn moments(moments: Vec<Self::Moments>) -> Vec<Moments> {
        let all = moments.into_iter().flatten().fold(Transaction::default(), Transaction::register);
        let mut read = all.execute().into_iter().map(|data| data.into_vec::<f32>().unwrap_or_default());
        std::iter::from_fn(|| Some(Moments { mean: read.next()?, variance: read.next()? })).collect()
    }

    fn linear_norm_relu(
        x: Rows<Self>,
        weight: Rows<Self>,
        gain: Rows<Self>,
        bias: Rows<Self>,
        pool: usize,
    ) -> (Rows<Self>, Self::Moments) {
        norm_relu(product(x, weight), gain, bias, pool)
    }

    fn edge_norm_relu(
        x: Rows<Self>,
        weight: Rows<Self>,
        gain: Rows<Self>,
        bias: Rows<Self>,
        edges: &Self::Edges,
        pool: usize,
    ) -> (Rows<Self>, Self::Moments) {
        let table = product(x, weight.clone().slice(s![3.., ..]));
        let offsets = product(edges.offsets.clone(), weight.slice(s![..3, ..]));
        norm_relu(Self::gather(table, &edges.picks) + offsets, gain, bias, pool)
    }

    fn affine(x: Rows<Self>, weight: Rows<Self>, bias: Rows<Self>) -> Rows<Self> {
        product(x, weight) + bias
    }

    fn modulated(h: Rows<Self>, m: Rows<Self>, weight: Rows<Self>, bias: Rows<Self>, starts: &[usize]) -> Rows<Self> {
        let [clouds, modulators] = m.dims();
        let owners = starts.windows(2).enumerate().flat_map(|(cloud, w)| std::iter::repeat_n(cloud as u32, w[1] - w[0]));
        let owners = DevicePicks::new(&Picks::new(owners.collect(), clouds), &h.device());
        let m = Self::gather(m, &owners);
        let mut stacked = vec![h.clone()];
        stacked.extend((0..modulators).map(|i| h.clone() * m.clone().slice(s![.., i..i + 1])));
        product(Tensor::cat(stacked, 1), weight) + bias
    }

    fn gather(x: Rows<Self>, picks: &Self::Picks) -> Rows<Self> {
        let (xn, x) = open!(x);
        let y = x.select(0, picks.sources.clone());
        close!(Gather, [xn], picks.segments.clone(), y)
    }

    fn max_pool(x: Rows<Self>, k: usize) -> Rows<Self> {
        let [rows, channels] = x.dims();
        x.reshape([rows / k, k, channels]).max_dim(1).reshape([rows / k, channels])
    }

    fn cross_entropy(logits: Rows<Self>, targets: &[f32], starts: &[usize]) -> Tensor<Self::Tape, 1> {
        // Every cloud is filled up to the longest by points that no softmax sees and no target asks for.
        let (clouds, device) = (starts.len() - 1, logits.device());
        let longest = starts.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
        let cells = clouds * longest;
        let (mut rows, mut absent, mut wanted) = (vec![0; cells], vec![FAR_BELOW; cells], vec![0.0; cells * FINGERS]);
        for (cloud, w) in starts.windows(2).enumerate() {
            for (point, row) in (w[0]..w[1]).enumerate() {
                let cell = cloud * longest + point;
                (rows[cell], absent[cell]) = (row as u32, 0.0);
                wanted[cell * FINGERS..][..FINGERS].copy_from_slice(&targets[row * FINGERS..][..FINGERS]);
            }
        }
        let picks = DevicePicks::new(&Picks::new(rows, starts[clouds]), &device);
        let cells = Self::gather(logits, &picks).reshape([clouds, longest, FINGERS]);
        let log = log_softmax(cells + float(absent, [clouds, longest, 1], &device), 1);
        let terms = log * float(wanted, [clouds, longest, FINGERS], &device);
        let sum = column_sum(terms.reshape([clouds * longest, FINGERS])).sum_dim(1);
        sum.reshape([1]).div_scalar(-((clouds * FINGERS) as f32))
    }
}

/// Takes a logit out of a softmax; finite, because zero times infinity is no zero.
const FAR_BELOW: f32 = -1e30;

#[derive(Debug)]
struct Product;

impl<B: Backend> Backward<B, 2> for Product {
    type State = (Tensor<B, 2>, Tensor<B, 2>);

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (x, w) = ops.state;
        let dz = from_float::<B, 2>(grads.consume::<B>(&ops.node));
        let [xn, wn] = &ops.parents;
        hand_out!(grads, xn => dz.clone().matmul(w.clone().transpose()); wn => transposed_product(x.clone(), dz.clone()));
    }
}

#[derive(Debug, Clone)]
struct NormState<B: Backend> {
    z: Tensor<B, 2>,
    mean: Tensor<B, 2>,
    inverse: Tensor<B, 2>,
    scale: Tensor<B, 2>,
    shift: Tensor<B, 2>,
    /// Which row of each group won, groups × 1 × channels.
    winner: Option<Tensor<B, 3, Int>>,
}

#[derive(Debug)]
struct NormRelu;

impl<B: Backend> Backward<B, 3> for NormRelu {
    type State = NormState<B>;

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _: &mut Checkpointer) {
        let NormState { z, mean, inverse, scale, shift, winner } = ops.state;
        let dy = from_float::<B, 2>(grads.consume::<B>(&ops.node));
        let ([rows, channels], [groups, _]) = (z.dims(), dy.dims());
        let grouped = [groups, rows / groups, channels];
        let won = match &winner {
            Some(winner) => z.clone().reshape(grouped).gather(1, winner.clone()).reshape([groups, channels]),
            None => z.clone(),
        };
        let dead = (won.clone() * scale.clone() + shift).lower_equal_elem(0.0);
        let g = dy.mask_fill(dead, 0.0);
        let db = column_sum(g.clone());
        let dg = column_sum(g.clone() * (won - mean.clone())) * inverse.clone();
        // scale (g − mean g − ẑ mean(g ẑ)) = scale g + constant + slope z.
        let slope = (scale.clone() * inverse * dg.clone()).div_scalar(-(rows as f32));
        let constant = (scale.clone() * db.clone()).div_scalar(-(rows as f32)) - slope.clone() * mean;
        let (g, base) = (g * scale, z * slope + constant);
        let dz = match winner {
            Some(winner) => {
                let g = g.reshape([groups, 1, channels]);
                base.reshape(grouped).scatter(1, winner, g, IndexingUpdateOp::Add).reshape([rows, channels])
            }
            None => base + g,
        };
        let [zn, gn, bn] = &ops.parents;
        hand_out!(grads, zn => dz; gn => dg; bn => db);
    }
}

#[derive(Debug)]
struct Gather;

impl<B: SegmentSum> Backward<B, 1> for Gather {
    type State = Segments<B>;

    fn backward(self, ops: Ops<Self::State, 1>, grads: &mut Gradients, _: &mut Checkpointer) {
        let dy = from_float::<B, 2>(grads.consume::<B>(&ops.node));
        hand_out!(grads, ops.parents[0] => B::segment_sum(dy, &ops.state));
    }
}
