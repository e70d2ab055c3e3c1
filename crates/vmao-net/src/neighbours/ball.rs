//! Ball query.

use super::columns::{Columns, TASK};
use super::squared_distance;
use crate::kernels::blocks::vectorised;
use rayon::prelude::*;

/// For each centre the first `count` points within `radius` (m), in the order of `points`; row-major centres × count.
///
/// As in PointNet++, a row with fewer points repeats its first one; a row with none repeats the nearest point. Panics if `points`
/// is empty.
pub fn ball_query(points: &[[f32; 3]], centres: &[[f32; 3]], radius: f32, count: usize) -> Vec<u32> {
    assert!(!points.is_empty(), "a ball query among no points");
    let columns = Columns::new(points);
    let mut out = vec![0; centres.len() * count];
    out.par_chunks_mut((TASK * count).max(1)).zip(centres.par_chunks(TASK)).for_each(|(out, centres)| {
        vectorised(
            #[inline(always)]
            || {
                for (row, &centre) in out.chunks_exact_mut(count).zip(centres) {
                    let found = fill(row, &columns, centre, radius);
                    if found == 0 {
                        let gap = |i: usize| squared_distance(points[i], centre);
                        row[0] = (1..points.len()).fold(0, |best, i| if gap(i) < gap(best) { i } else { best }) as u32;
                    }
                    let first = row[0];
                    row[found.max(1)..].fill(first);
                }
            },
        );
    });
    out
}

/// Writes the first points within `radius` to `row`; returns how many there are.
#[inline(always)]
fn fill(row: &mut [u32], columns: &Columns, centre: [f32; 3], radius: f32) -> usize {
    // The scan asks for closer than its bound, a ball holds its surface too.
    let (squared, bound) = (radius * radius, (radius * radius).next_up());
    let mut found = 0;
    columns.scan(
        centre,
        bound,
        #[inline(always)]
        |start, gaps| {
            for (lane, &gap) in gaps.iter().enumerate() {
                if gap <= squared {
                    row[found] = (start + lane) as u32;
                    found += 1;
                    if found == row.len() {
                        return -1.0;
                    }
                }
            }
            bound
        },
    );
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::random::Stream;

    #[test]
    fn rows_hold_the_first_within_reach_and_repeat_the_first() {
        let points: Vec<[f32; 3]> = [0.0, 0.03, 0.01, 0.02, 0.10].iter().map(|&x| [x, 0.0, 0.0]).collect();
        let found = ball_query(&points, &[[0.0, 0.0, 0.0], [0.10, 0.0, 0.0], [0.5, 0.0, 0.0]], 0.0201, 3);
        assert_eq!(found, vec![0, 2, 3, 4, 4, 4, 4, 4, 4]);
        assert_eq!(ball_query(&points, &[[0.02, 0.0, 0.0]], 0.0201, 2), vec![0, 1], "the order of the points, not the nearest");
    }

    #[test]
    fn it_agrees_with_looking_at_every_point() {
        let mut stream = Stream::new(5, &[]);
        let mut cloud = |n| (0..n).map(|_| std::array::from_fn(|_| stream.unit() as f32)).collect::<Vec<[f32; 3]>>();
        let (points, centres) = (cloud(331), cloud(150));
        let found = ball_query(&points, &centres, 0.2, 7);
        let (mut full, mut empty) = (0, 0);
        for (&centre, row) in centres.iter().zip(found.chunks(7)) {
            let inside: Vec<u32> = (0..331).filter(|&i| squared_distance(points[i as usize], centre) <= 0.2 * 0.2).collect();
            full += usize::from(inside.len() > 7);
            empty += usize::from(inside.is_empty());
            let Some(&first) = inside.first() else { continue };
            let expected: Vec<u32> = inside.iter().copied().chain(std::iter::repeat(first)).take(7).collect();
            assert_eq!(row, expected);
        }
        assert!(full > 5 && empty < 75, "{full} full and {empty} empty balls test little");
    }
}
