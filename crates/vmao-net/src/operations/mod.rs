//! What a point network computes, for whichever device computes it: one trait, and its two implementations.
//!
//! [`Fused`] runs on the CPU with hand-written kernels. [`Composed`] runs on any backend of burn, put together from burn's tensor
//! operations, with a segment sum of our own where burn's is serial. Network code is generic over [`Operations`].

#[cfg(test)]
mod agreement;
#[cfg(any(test, feature = "cubecl"))]
mod composed;
#[cfg(test)]
mod devices;
mod fused;
#[cfg(any(test, feature = "cubecl"))]
mod segment_sum;

#[cfg(any(test, feature = "cubecl"))]
pub(crate) use composed::Composed;
pub(crate) use fused::Fused;

use crate::kernels::edge::Edges;
use crate::kernels::gather::Picks;
use crate::kernels::norm::Moments;
use burn::tensor::Tensor;
use burn::tensor::backend::AutodiffBackend;
use burn::tensor::ops::Device;
use std::fmt::Debug;
use std::sync::Arc;

/// Rows × channels, with gradients.
pub(crate) type Rows<O> = Tensor<<O as Operations>::Tape, 2>;

/// Where the tensors of `O` live.
pub(crate) type DeviceOf<O> = Device<<O as Operations>::Tape>;

/// The operations of point networks with their gradients. All tensors are rows × channels; gains and biases have one row.
pub(crate) trait Operations: Debug + Sized {
    /// The backend that records what gradients need.
    type Tape: AutodiffBackend;
    /// [`Picks`] where the operations can read them.
    type Picks: Debug;
    /// [`Edges`] where the operations can read them.
    type Edges: Debug;
    /// Batch moments where the operations leave them.
    type Moments: Debug;

    /// Brings picks to the device.
    fn picks(picks: &Arc<Picks>, device: &DeviceOf<Self>) -> Self::Picks;

    /// Brings edges to the device.
    fn edges(edges: &Arc<Edges>, device: &DeviceOf<Self>) -> Self::Edges;

    /// Brings the moments of all layers back, in one go.
    fn moments(moments: Vec<Self::Moments>) -> Vec<Moments>;

    /// relu(bn(x W)), the largest of every `pool` rows of it, and the batch moments of x W.
    fn linear_norm_relu(
        x: Rows<Self>,
        weight: Rows<Self>,
        gain: Rows<Self>,
        bias: Rows<Self>,
        pool: usize,
    ) -> (Rows<Self>, Self::Moments);

    /// relu(bn([offset, x[source]] W)) over `edges`, the largest of every `pool` rows of it, and the batch moments before normalisation.
    fn edge_norm_relu(
        x: Rows<Self>,
        weight: Rows<Self>,
        gain: Rows<Self>,
        bias: Rows<Self>,
        edges: &Self::Edges,
        pool: usize,
    ) -> (Rows<Self>, Self::Moments);

    /// x W + b.
    fn affine(x: Rows<Self>, weight: Rows<Self>, bias: Rows<Self>) -> Rows<Self>;

    /// h W(m) + b, W(m) = W₀ + Σᵢ mᵢ Wᵢ with the modulators m of the cloud that a row belongs to.
    fn modulated(h: Rows<Self>, m: Rows<Self>, weight: Rows<Self>, bias: Rows<Self>, starts: &[usize]) -> Rows<Self>;

    /// The rows of x named by `picks`.
    fn gather(x: Rows<Self>, picks: &Self::Picks) -> Rows<Self>;

    /// The largest of every `k` consecutive rows.
    fn max_pool(x: Rows<Self>, k: usize) -> Rows<Self>;

    /// Cross entropy of target maps and logits, both points × 2, over clouds bounded by `starts`.
    fn cross_entropy(logits: Rows<Self>, targets: &[f32], starts: &[usize]) -> Tensor<Self::Tape, 1>;
}
