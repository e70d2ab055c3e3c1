//! Nearest neighbours by exhaustive search, a vector of points at a time.

use super::columns::{Columns, TASK};
use crate::kernels::blocks::vectorised;
use rayon::prelude::*;

/// For each query its `count` nearest of `points`, nearest first; row-major queries × count. Panics if there are fewer points.
pub fn nearest(points: &[[f32; 3]], queries: &[[f32; 3]], count: usize) -> Vec<u32> {
    assert!(count <= points.len(), "{count} neighbours among {} points", points.len());
    let columns = Columns::new(points);
    let mut out = vec![0; queries.len() * count];
    out.par_chunks_mut((TASK * count).max(1)).zip(queries.par_chunks(TASK)).for_each(|(out, queries)| {
        let mut best = vec![(f32::INFINITY, 0); count];
        vectorised(
            #[inline(always)]
            || {
                for (row, &query) in out.chunks_exact_mut(count).zip(queries) {
                    closest(&mut best, &columns, query);
                    row.iter_mut().zip(&best).for_each(|(slot, &(_, index))| *slot = index);
                }
            },
        );
    });
    out
}

/// Fills `best` with the closest points and their squared distances, sorted; of equals the lower index comes first.
#[inline(always)]
fn closest(best: &mut [(f32, u32)], columns: &Columns, query: [f32; 3]) {
    best.fill((f32::INFINITY, 0));
    let last = best.len() - 1;
    columns.scan(
        query,
        f32::INFINITY,
        #[inline(always)]
        |start, gaps| {
            for (lane, &gap) in gaps.iter().enumerate() {
                if gap < best[last].0 {
                    let mut place = last;
                    while place > 0 && best[place - 1].0 > gap {
                        best[place] = best[place - 1];
                        place -= 1;
                    }
                    best[place] = (gap, (start + lane) as u32);
                }
            }
            best[last].0
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::squared_distance;
    use vmao_core::random::Stream;

    #[test]
    fn the_nearest_come_first_and_ties_go_to_the_lower_index() {
        let points: Vec<[f32; 3]> = [0.3, 0.1, -0.1, 0.0].iter().map(|&x| [x, 0.0, 0.0]).collect();
        assert_eq!(nearest(&points, &[[0.0; 3], [0.4, 0.0, 0.0]], 3), vec![3, 1, 2, 0, 1, 3]);
    }

    #[test]
    fn it_agrees_with_sorting_everything() {
        let mut s = Stream::new(5, &[]);
        let mut cloud = |n| (0..n).map(|_| std::array::from_fn(|_| s.unit() as f32)).collect::<Vec<[f32; 3]>>();
        let (points, queries) = (cloud(67), cloud(31));
        let found = nearest(&points, &queries, 5);
        for (q, row) in queries.iter().zip(found.chunks(5)) {
            let mut all: Vec<u32> = (0..67).collect();
            all.sort_by(|&a, &b| squared_distance(points[a as usize], *q).total_cmp(&squared_distance(points[b as usize], *q)));
            assert_eq!(row, &all[..5]);
        }
    }
}
