//! The arithmetic of the fused operations on plain row-major slices, forward and backward.
//!
//! Every parallel loop runs over a fixed partition of the rows and adds its partial sums in block order, so a
//! result has the same bits for any number of threads. Nothing here knows burn.

pub(crate) mod blocks;
pub(crate) mod cross_entropy;
pub(crate) mod edge;
pub(crate) mod gather;
pub(crate) mod linear;
pub(crate) mod matmul;
pub(crate) mod max_pool;
pub(crate) mod modulated;
pub(crate) mod norm;

#[cfg(test)]
pub(crate) mod finite_difference;
