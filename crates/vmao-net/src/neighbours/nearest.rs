//! Nearest neighbours: a look at every point of a small cloud, boxes of points in a larger one.

use super::boxes::Tree;
use super::columns::{Columns, LANES, TASK, chosen};
use crate::kernels::blocks::vectorised;
use rayon::prelude::*;

/// Points of a cloud from which on boxes are faster; `docs/benchmarks.md` has the measurement.
const WORTH_BOXES: usize = 64;

/// For each query its `count` nearest of `points`, nearest first; row-major queries × count. Panics if there are fewer points.
pub fn nearest(points: &[[f32; 3]], queries: &[[f32; 3]], count: usize) -> Vec<u32> {
    assert!(count <= points.len(), "{count} neighbours among {} points", points.len());
    if count == 0 {
        return Vec::new();
    }
    if points.len() < WORTH_BOXES {
        let columns = Columns::new(points);
        search(
            queries,
            count,
            #[inline(always)]
            |best, query| among_all(best, &columns, query),
        )
    } else {
        let tree = Tree::new(points);
        search(
            queries,
            count,
            #[inline(always)]
            |best, query| in_boxes(best, &tree, query),
        )
    }
}

/// Rows of indices that `closest` found for each query.
fn search(queries: &[[f32; 3]], count: usize, closest: impl Fn(&mut Best, [f32; 3]) + Sync) -> Vec<u32> {
    let mut out = vec![0; queries.len() * count];
    out.par_chunks_mut(TASK * count).zip(queries.par_chunks(TASK)).for_each(|(out, queries)| {
        let mut best = Best(vec![NONE; count]);
        vectorised(
            #[inline(always)]
            || {
                for (row, &query) in out.chunks_exact_mut(count).zip(queries) {
                    best.0.fill(NONE);
                    closest(&mut best, query);
                    row.iter_mut().zip(&best.0).for_each(|(slot, &key)| *slot = key as u32);
                }
            },
        );
    });
    out
}

/// The closest points so far, sorted: bits of the squared distance, which order positive numbers, above the index.
struct Best(Vec<u64>);

/// Point 0, infinitely far away.
const NONE: u64 = (f32::INFINITY.to_bits() as u64) << 32;

impl Best {
    /// Bits of the largest squared distance.
    #[inline(always)]
    fn worst(&self) -> u32 {
        (self.0[self.0.len() - 1] >> 32) as u32
    }

    /// Puts a point in its place if it is closer than the last one, or as close and of lower index.
    #[inline(always)]
    fn offer(&mut self, gap: f32, index: u32) {
        let key = u64::from(gap.to_bits()) << 32 | u64::from(index);
        let mut place = self.0.len() - 1;
        if key >= self.0[place] {
            return;
        }
        while place > 0 && self.0[place - 1] > key {
            self.0[place] = self.0[place - 1];
            place -= 1;
        }
        self.0[place] = key;
    }
}

/// The closest of all points.
#[inline(always)]
fn among_all(best: &mut Best, columns: &Columns, query: [f32; 3]) {
    columns.scan(
        query,
        f32::INFINITY,
        #[inline(always)]
        |start, gaps| {
            (0..LANES).for_each(|lane| best.offer(gaps[lane], (start + lane) as u32));
            f32::from_bits(best.worst())
        },
    );
}

/// Levels of boxes that an index of 32 bits can count.
const MOST_LEVELS: usize = 7;

/// The closest points, nearest boxes first; boxes farther than the last of the closest are not opened.
#[inline(always)]
fn in_boxes(best: &mut Best, tree: &Tree, query: [f32; 3]) {
    let top = tree.levels.len() - 1;
    let (mut unopened, mut node) = ([[0_u32; LANES]; MOST_LEVELS], [0_usize; MOST_LEVELS]);
    unopened[top] = keys(tree.levels[top][0].gaps(query));
    let mut level = top;
    loop {
        let nearest = unopened[level].iter().fold(u32::MAX, |least, &key| least.min(key));
        if nearest & !NUMBER > best.worst() {
            if level == top {
                return;
            }
            level += 1;
            continue;
        }
        let lane = (nearest & NUMBER) as usize;
        unopened[level][lane] = u32::MAX;
        let child = node[level] * LANES + lane;
        if level > 0 {
            if let Some(boxes) = tree.levels[level - 1].get(child) {
                level -= 1;
                node[level] = child;
                unopened[level] = keys(boxes.gaps(query));
            }
        } else if let Some(group) = tree.groups.get(child) {
            let (gaps, worst) = (group.gaps(query), best.worst());
            for lane in chosen(
                #[inline(always)]
                |lane| gaps[lane].to_bits() <= worst,
            ) {
                best.offer(gaps[lane], group.index[lane]);
            }
        }
    }
}

/// Bits that hold the number of one of sixteen boxes.
const NUMBER: u32 = LANES as u32 - 1;

/// Bits of distances, which order as they do; the lowest give way to the box's number, which makes none farther than it is.
#[inline(always)]
fn keys(gaps: [f32; LANES]) -> [u32; LANES] {
    let mut keys = [0; LANES];
    for lane in 0..LANES {
        keys[lane] = gaps[lane].to_bits() & !NUMBER | lane as u32;
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::squared_distance;
    use proptest::prelude::*;
    use vmao_core::random::Stream;

    #[test]
    fn the_nearest_come_first_and_ties_go_to_the_lower_index() {
        let points: Vec<[f32; 3]> = [0.3, 0.1, -0.1, 0.0].iter().map(|&x| [x, 0.0, 0.0]).collect();
        assert_eq!(nearest(&points, &[[0.0; 3], [0.4, 0.0, 0.0]], 3), vec![3, 1, 2, 0, 1, 3]);
    }

    fn sorted(points: &[[f32; 3]], queries: &[[f32; 3]], count: usize) -> Vec<u32> {
        let one = |query: &[f32; 3]| {
            let mut all: Vec<u32> = (0..points.len() as u32).collect();
            all.sort_by(|&a, &b| {
                squared_distance(points[a as usize], *query).total_cmp(&squared_distance(points[b as usize], *query))
            });
            all.truncate(count);
            all
        };
        queries.iter().flat_map(one).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        /// Coarse grids make ties and equal points; sizes on both sides of the switch, and of one, two and three levels of boxes.
        #[test]
        fn it_agrees_with_sorting_everything(seed in 0_u64..1000, size in 9_usize..6000, grid in 2_usize..5000, count in 1_usize..10) {
            let mut s = Stream::new(seed, &[]);
            let mut cloud = |n| -> Vec<[f32; 3]> {
                (0..n).map(|_| std::array::from_fn(|_| (s.index(grid) as f32 / grid as f32 - 0.5) * 0.3)).collect()
            };
            let (points, mut queries) = (cloud(size), cloud(12));
            queries.push([4.0, -7.0, 1e3]);
            prop_assert_eq!(nearest(&points, &queries, count), sorted(&points, &queries, count));
        }
    }
}
