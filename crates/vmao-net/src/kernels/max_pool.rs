//! The largest of every `k` consecutive rows, channel by channel.

use super::blocks::{BLOCK, vectorised};
use rayon::prelude::*;

/// Returns groups × channels and, for each, which of the `k` rows won (the first of equals).
pub(crate) fn max_pool(x: &[f32], k: usize, channels: usize) -> (Vec<f32>, Vec<u32>) {
    assert!(k > 0 && k <= u32::MAX as usize && x.len().is_multiple_of(k * channels), "groups of {k} rows");
    let groups = x.len() / (k * channels);
    let (mut best, mut winner) = (vec![0.0; groups * channels], vec![0_u32; groups * channels]);
    best.par_chunks_mut(BLOCK * channels)
        .zip(winner.par_chunks_mut(BLOCK * channels))
        .zip(x.par_chunks(BLOCK * k * channels))
        .for_each(|((best, winner), x)| {
            let groups = best.chunks_exact_mut(channels).zip(winner.chunks_exact_mut(channels));
            vectorised(
                #[inline(always)]
                || {
                    for ((best, winner), x) in groups.zip(x.chunks_exact(k * channels)) {
                        best.copy_from_slice(&x[..channels]);
                        for (j, row) in x.chunks_exact(channels).enumerate().skip(1) {
                            let (best, winner) = (&mut best[..channels], &mut winner[..channels]);
                            for c in 0..channels {
                                // Masks, not branches: this loop is as long as the whole grouped layer.
                                let better = 0_u32.wrapping_sub(u32::from(row[c] > best[c]));
                                winner[c] = (winner[c] & !better) | (j as u32 & better);
                                best[c] = best[c].max(row[c]);
                            }
                        }
                    }
                },
            );
        });
    (best, winner)
}

/// Gradient of [`max_pool`] by x: each winner receives its group's gradient.
pub(crate) fn max_pool_backward(dy: &[f32], winner: &[u32], k: usize, channels: usize) -> Vec<f32> {
    let mut dx = vec![0.0; dy.len() * k];
    dx.par_chunks_mut(BLOCK * k * channels)
        .zip(dy.par_chunks(BLOCK * channels))
        .zip(winner.par_chunks(BLOCK * channels))
        .for_each(|((dx, dy), winner)| {
            let groups = dy.chunks_exact(channels).zip(winner.chunks_exact(channels));
            for (dx, (dy, winner)) in dx.chunks_exact_mut(k * channels).zip(groups) {
                for c in 0..channels {
                    dx[winner[c] as usize * channels + c] = dy[c];
                }
            }
        });
    dx
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_equal_rows_wins_and_takes_the_gradient() {
        let x = [1.0, 5.0, 3.0, 5.0, 3.0, -1.0, /* second group */ -4.0, 0.0, -2.0, 0.5, -3.0, 0.25];
        let (best, winner) = max_pool(&x, 3, 2);
        assert_eq!(best, vec![3.0, 5.0, -2.0, 0.5]);
        assert_eq!(winner, vec![1, 0, 1, 1]);
        let dx = max_pool_backward(&[10.0, 20.0, 30.0, 40.0], &winner, 3, 2);
        assert_eq!(dx, vec![0.0, 20.0, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 30.0, 40.0, 0.0, 0.0]);
    }
}
