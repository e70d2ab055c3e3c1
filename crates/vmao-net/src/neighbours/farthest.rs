//! Farthest-point sampling: every point looked at for each sample, or, where it pays, only boxes of points that a sample may be near to.

use super::boxes::Tree;
use super::columns::{LANES, chosen};
use crate::kernels::blocks::vectorised;

/// Samples from which on boxes are faster, whatever the cloud; `docs/benchmarks.md` has the measurement.
const WORTH_BOXES: usize = 128;

/// The first `count` points of `points` in farthest-point order: each is the farthest from all before it.
///
/// The distance to point i counts `weights[i]` times; all ones is PointNet++'s sampling. The first point is the one farthest from the
/// mean of the cloud, so the order depends on the shape only, not on how the points are listed or where they lie. Its prefixes are
/// the samples of every smaller size. Panics if `count` is larger than the cloud, or without a weight for each point.
pub fn farthest_point_order(points: &[[f32; 3]], weights: &[f32], count: usize) -> Vec<u32> {
    assert!(count <= points.len(), "{count} centroids of {} points", points.len());
    assert_eq!(weights.len(), points.len(), "a weight for each point");
    if count == 0 {
        return Vec::new();
    }
    let mut mean = [0.0_f64; 3];
    for point in points {
        (0..3).for_each(|axis| mean[axis] += f64::from(point[axis]) / points.len() as f64);
    }
    let place = |p: &[f32; 3]| [0, 1, 2].map(|axis| (f64::from(p[axis]) - mean[axis]) as f32);
    let points: Vec<[f32; 3]> = points.iter().map(place).collect();
    let squared_weights: Vec<f32> = weights.iter().map(|w| w * w).collect();
    // A cloud of one level of boxes is not worth more than a look at each of its points.
    if points.len() <= LANES * LANES || count < WORTH_BOXES {
        sample(&points, count, Remaining::new(&points, &squared_weights))
    } else {
        sample(&points, count, Boxed::new(&points, &squared_weights))
    }
}

/// What has been sampled so far of a cloud whose mean is zero.
trait Sampling {
    /// Forgets all samples.
    fn restart(&mut self);

    /// Point `index` was taken: it never comes again, even in a cloud of equal points.
    fn take(&mut self, index: usize);

    /// Takes the distance to `centre` into account and returns the farthest point; the lowest index of equals.
    fn approach(&mut self, centre: [f32; 3]) -> usize;
}

fn sample(points: &[[f32; 3]], count: usize, mut cloud: impl Sampling) -> Vec<u32> {
    let mut order = Vec::with_capacity(count);
    vectorised(
        #[inline(always)]
        || {
            let mut last = cloud.approach([0.0; 3]);
            cloud.restart();
            loop {
                order.push(last as u32);
                if order.len() == count {
                    return;
                }
                cloud.take(last);
                last = cloud.approach(points[last]);
            }
        },
    );
    order
}

/// A cloud by coordinate, with the weighted squared distance of each point from the nearest that was taken.
#[derive(Debug)]
struct Remaining {
    x: Vec<[f32; LANES]>,
    y: Vec<[f32; LANES]>,
    z: Vec<[f32; LANES]>,
    squared_weight: Vec<[f32; LANES]>,
    distance: Vec<[f32; LANES]>,
    count: usize,
}

fn padded(values: impl ExactSizeIterator<Item = f32>, filler: f32) -> Vec<[f32; LANES]> {
    let mut groups = vec![[filler; LANES]; values.len().div_ceil(LANES)];
    groups.as_flattened_mut().iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
    groups
}

impl Remaining {
    fn new(points: &[[f32; 3]], squared_weights: &[f32]) -> Self {
        let axis = |axis: usize| padded(points.iter().map(|p| p[axis]), 0.0);
        Self {
            x: axis(0),
            y: axis(1),
            z: axis(2),
            squared_weight: padded(squared_weights.iter().copied(), 0.0),
            // What fills the last group up counts as taken.
            distance: padded(points.iter().map(|_| f32::INFINITY), f32::NEG_INFINITY),
            count: points.len(),
        }
    }
}

impl Sampling for Remaining {
    #[inline(always)]
    fn restart(&mut self) {
        self.distance.as_flattened_mut()[..self.count].fill(f32::INFINITY);
    }

    #[inline(always)]
    fn take(&mut self, index: usize) {
        self.distance.as_flattened_mut()[index] = f32::NEG_INFINITY;
    }

    #[inline(always)]
    fn approach(&mut self, centre: [f32; 3]) -> usize {
        let (mut best, mut place) = ([f32::NEG_INFINITY; LANES], [0_u32; LANES]);
        let points = self.x.iter().zip(&self.y).zip(&self.z).zip(&self.squared_weight);
        for (group, (distance, (((x, y), z), weight))) in self.distance.iter_mut().zip(points).enumerate() {
            for lane in 0..LANES {
                let (dx, dy, dz) = (x[lane] - centre[0], y[lane] - centre[1], z[lane] - centre[2]);
                let gap = weight[lane] * (dx * dx + dy * dy + dz * dz);
                let least = if gap < distance[lane] { gap } else { distance[lane] };
                distance[lane] = least;
                let better = least > best[lane];
                best[lane] = if better { least } else { best[lane] };
                place[lane] = if better { group as u32 } else { place[lane] };
            }
        }
        let index = |lane: usize| place[lane] as usize * LANES + lane;
        let ahead = |a: usize, b: usize| best[a] > best[b] || (best[a] >= best[b] && index(a) < index(b));
        index((1..LANES).fold(0, |winner, lane| if ahead(lane, winner) { lane } else { winner }))
    }
}

/// A cloud in boxes: a box whose nearest corner is farther from a sample than its points are from earlier ones is left alone.
///
/// The idea is that of QuickFPS (Han et al. 2023). No rounding can make a bound larger than a distance in its box ([`super::boxes`]), so the
/// order is that of [`Remaining`] to the last tie.
#[derive(Debug)]
struct Boxed {
    tree: Tree,
    /// Where each point is: its group and lane in one number.
    places: Vec<u32>,
    squared_weight: Vec<[f32; LANES]>,
    /// As in [`Remaining`], by group.
    distance: Vec<[f32; LANES]>,
    /// The smallest squared weight and the largest distance of each group, and of each sixteen groups.
    levels: [Summary; 2],
}

/// Of each box of one level, sixteen a group.
#[derive(Debug)]
struct Summary {
    lightest: Vec<[f32; LANES]>,
    farthest: Vec<[f32; LANES]>,
}

impl Summary {
    fn new(weights: &[[f32; LANES]]) -> Self {
        let lightest = padded(weights.iter().map(|group| group.iter().copied().fold(f32::INFINITY, f32::min)), 1.0);
        let farthest = padded(weights.iter().map(|_| f32::INFINITY), f32::NEG_INFINITY);
        Self { lightest, farthest }
    }
}

#[inline(always)]
fn largest(values: &[f32; LANES]) -> f32 {
    values.iter().fold(f32::NEG_INFINITY, |most, &value| if value > most { value } else { most })
}

impl Boxed {
    /// A cloud of more than one level of boxes.
    fn new(points: &[[f32; 3]], squared_weights: &[f32]) -> Self {
        let tree = Tree::new(points);
        let mut places = vec![0; points.len()];
        let mut squared_weight = vec![[f32::INFINITY; LANES]; tree.groups.len()];
        let mut distance = vec![[f32::NEG_INFINITY; LANES]; tree.groups.len()];
        for (group, of) in tree.groups.iter().enumerate() {
            for (lane, &index) in of.index.iter().enumerate().filter(|&(_, &index)| index != u32::MAX) {
                places[index as usize] = (group * LANES + lane) as u32;
                squared_weight[group][lane] = squared_weights[index as usize];
                distance[group][lane] = f32::INFINITY;
            }
        }
        let fine = Summary::new(&squared_weight);
        let coarse = Summary::new(&fine.lightest);
        Self { tree, places, squared_weight, distance, levels: [fine, coarse] }
    }

    /// Updates the distances of a group and returns the largest.
    #[inline(always)]
    fn update(&mut self, group: usize, centre: [f32; 3]) -> f32 {
        let gaps = self.tree.groups[group].gaps(centre);
        let (weight, distance) = (&self.squared_weight[group], &mut self.distance[group]);
        for lane in 0..LANES {
            let gap = weight[lane] * gaps[lane];
            distance[lane] = if gap < distance[lane] { gap } else { distance[lane] };
        }
        largest(distance)
    }
}

impl Sampling for Boxed {
    fn restart(&mut self) {
        self.places.iter().for_each(|&place| self.distance.as_flattened_mut()[place as usize] = f32::INFINITY);
        let [fine, coarse] = &mut self.levels;
        fine.farthest.as_flattened_mut()[..self.tree.groups.len()].fill(f32::INFINITY);
        let sixteens = fine.farthest.len();
        coarse.farthest.as_flattened_mut()[..sixteens].fill(f32::INFINITY);
    }

    #[inline(always)]
    fn take(&mut self, index: usize) {
        let place = self.places[index] as usize;
        self.distance.as_flattened_mut()[place] = f32::NEG_INFINITY;
        // So that the next sample, this very point, opens the boxes and finds who is farthest now.
        self.levels[0].farthest.as_flattened_mut()[place / LANES] = f32::INFINITY;
        self.levels[1].farthest.as_flattened_mut()[place / LANES / LANES] = f32::INFINITY;
    }

    #[inline(always)]
    fn approach(&mut self, centre: [f32; 3]) -> usize {
        for many in 0..self.tree.levels[1].len() {
            let gaps = self.tree.levels[1][many].gaps(centre);
            let (light, far) = (self.levels[1].lightest[many], self.levels[1].farthest[many]);
            for some in chosen(
                #[inline(always)]
                |lane| light[lane] * gaps[lane] < far[lane],
            ) {
                let some = many * LANES + some;
                let gaps = self.tree.levels[0][some].gaps(centre);
                let (light, far) = (self.levels[0].lightest[some], self.levels[0].farthest[some]);
                for lane in chosen(
                    #[inline(always)]
                    |lane| light[lane] * gaps[lane] < far[lane],
                ) {
                    self.levels[0].farthest[some][lane] = self.update(some * LANES + lane, centre);
                }
                self.levels[1].farthest.as_flattened_mut()[some] = largest(&self.levels[0].farthest[some]);
            }
        }
        let [fine, coarse] = &self.levels;
        let most = coarse.farthest.iter().fold(f32::NEG_INFINITY, |most, far| most.max(largest(far)));
        let mut first = u32::MAX;
        for (many, far) in coarse.farthest.iter().enumerate() {
            for some in chosen(
                #[inline(always)]
                |lane| far[lane] >= most,
            ) {
                let some = many * LANES + some;
                for lane in chosen(
                    #[inline(always)]
                    |lane| fine.farthest.get(some).is_some_and(|far| far[lane] >= most),
                ) {
                    let group = some * LANES + lane;
                    for lane in chosen(
                        #[inline(always)]
                        |lane| self.distance[group][lane] >= most,
                    ) {
                        first = first.min(self.tree.groups[group].index[lane]);
                    }
                }
            }
        }
        first as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::squared_distance;
    use proptest::prelude::*;
    use vmao_core::random::Stream;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// Coarse grids make ties and equal points, weights of powers of two more ties; sizes of two and three levels of boxes.
        #[test]
        fn boxes_change_nothing(seed in 0_u64..1000, size in 257_usize..5500, grid in 2_usize..3000, exponents in 1_usize..4) {
            let mut s = Stream::new(seed, &[]);
            let points: Vec<[f32; 3]> = (0..size).map(|_| std::array::from_fn(|_| s.index(grid) as f32 / grid as f32)).collect();
            let squared: Vec<f32> = (0..size).map(|_| [1.0, 4.0, 0.25][s.index(exponents)]).collect();
            let count = 1 + s.index(size.min(1500));
            let everywhere = sample(&points, count, Remaining::new(&points, &squared));
            prop_assert_eq!(sample(&points, count, Boxed::new(&points, &squared)), everywhere);
        }
    }

    #[test]
    fn boxes_hold_equal_points_to_the_last() {
        let points = vec![[0.25; 3]; 300];
        assert_eq!(sample(&points, 300, Boxed::new(&points, &[1.0; 300])), (0..300).collect::<Vec<u32>>());
    }

    pub(crate) fn cloud(count: usize, seed: u64) -> Vec<[f32; 3]> {
        let mut s = Stream::new(seed, &[]);
        (0..count).map(|_| std::array::from_fn(|_| s.range(-0.2, 0.2) as f32)).collect()
    }

    #[test]
    fn the_corners_of_a_bar_come_before_its_middle() {
        let bar: Vec<[f32; 3]> = (0..11).map(|i| [i as f32 * 0.01 + 0.001 * (i == 10) as u8 as f32, 0.0, 0.0]).collect();
        assert_eq!(farthest_point_order(&bar, &[1.0; 11], 3), vec![10, 0, 5]);
    }

    #[test]
    fn each_point_is_the_farthest_from_those_before_it() {
        let cloud = cloud(157, 3);
        let order = farthest_point_order(&cloud, &[1.0; 157], 157);
        let gap = |i: usize, before: &[u32]| {
            before.iter().map(|&j| squared_distance(cloud[i], cloud[j as usize])).fold(f32::INFINITY, f32::min)
        };
        for taken in 1..60 {
            let chosen = gap(order[taken] as usize, &order[..taken]);
            for i in 0..cloud.len() {
                assert!(gap(i, &order[..taken]) <= chosen + 1e-7);
            }
        }
        let mut all = order.clone();
        all.sort_unstable();
        assert_eq!(all, (0..157).collect::<Vec<u32>>());
    }

    #[test]
    fn the_order_follows_the_points_when_they_are_listed_anew_or_shifted() {
        let cloud = cloud(90, 4);
        let shuffle = Stream::new(1, &[]).permutation(90);
        let listed: Vec<[f32; 3]> = shuffle.iter().map(|&i| [cloud[i][0] + 0.5, cloud[i][1] - 0.25, cloud[i][2]]).collect();
        let back: Vec<u32> = farthest_point_order(&listed, &[1.0; 90], 40).iter().map(|&i| shuffle[i as usize] as u32).collect();
        assert_eq!(back, farthest_point_order(&cloud, &[1.0; 90], 40));
    }

    #[test]
    fn equal_points_are_each_taken_once() {
        assert_eq!(farthest_point_order(&[[1.0; 3]; 4], &[1.0; 4], 4), vec![0, 1, 2, 3]);
    }

    #[test]
    fn a_heavier_point_comes_as_if_it_were_farther() {
        let points: Vec<[f32; 3]> = [-1.0, 0.0, 0.5, 1.1].iter().map(|&x| [x, 0.0, 0.0]).collect();
        assert_eq!(farthest_point_order(&points, &[1.0; 4], 4), vec![0, 3, 1, 2]);
        assert_eq!(farthest_point_order(&points, &[1.0, 1.0, 2.0, 1.0], 4), vec![0, 2, 3, 1]);
    }
}
