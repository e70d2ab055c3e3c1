//! A fixed partition of rows into blocks, and sums over blocks in a fixed order.

use rayon::prelude::*;
use std::ops::Range;

/// Rows of one block: small enough to stay in the second-level cache at 128 channels, large enough to feed a matrix product.
pub(crate) const BLOCK: usize = 256;

/// Runs `work` compiled for the widest vectors that the processor has. What it calls must be inlined into it.
///
/// Wider vectors do not change a bit: no product is contracted with a sum, and sums go over rows, in the same order in every lane.
#[inline(always)]
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// The rows of block `block` out of `rows`.
pub(crate) fn block_rows(block: usize, rows: usize) -> Range<usize> {
    block * BLOCK..rows.min((block + 1) * BLOCK)
}

/// Σ over blocks of the `width` sums that `partial` leaves in a zeroed slice; blocks run in parallel, and are added in order.
pub(crate) fn sum_blocks(rows: usize, width: usize, partial: impl Fn(Range<usize>, &mut [f32]) + Sync) -> Vec<f64> {
    let partials: Vec<Vec<f32>> = (0..rows.div_ceil(BLOCK))
        .into_par_iter()
        .map(|block| {
            let mut sums = vec![0.0; width];
            partial(block_rows(block, rows), &mut sums);
            sums
        })
        .collect();
    add_in_order(&partials, width)
}

/// Σ of the partial sums, in their order, in double precision.
pub(crate) fn add_in_order(partials: &[Vec<f32>], width: usize) -> Vec<f64> {
    let mut total = vec![0.0_f64; width];
    vectorised(
        #[inline(always)]
        || {
            for partial in partials {
                for (sum, &value) in total.iter_mut().zip(partial) {
                    *sum += f64::from(value);
                }
            }
        },
    );
    total
}

/// Single precision of `values`.
pub(crate) fn narrow(values: &[f64]) -> Vec<f32> {
    values.iter().map(|&value| value as f32).collect()
}
