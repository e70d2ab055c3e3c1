//! Farthest-point sampling.

use super::columns::LANES;
use crate::kernels::blocks::vectorised;

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
    let axis = |axis: usize| padded(points.iter().map(|p| (f64::from(p[axis]) - mean[axis]) as f32), 0.0);
    let mut cloud = Remaining {
        x: axis(0),
        y: axis(1),
        z: axis(2),
        squared_weight: padded(weights.iter().map(|w| w * w), 0.0),
        // What fills the last group up counts as taken.
        distance: padded(points.iter().map(|_| f32::INFINITY), f32::NEG_INFINITY),
    };
    let mut order = Vec::with_capacity(count);
    vectorised(
        #[inline(always)]
        || {
            let mut last = cloud.approach([0.0; 3]);
            cloud.distance.as_flattened_mut()[..points.len()].fill(f32::INFINITY);
            loop {
                order.push(last as u32);
                if order.len() == count {
                    return;
                }
                // A point that was taken never comes again, even in a cloud of equal points.
                let (group, lane) = (last / LANES, last % LANES);
                cloud.distance[group][lane] = f32::NEG_INFINITY;
                last = cloud.approach([cloud.x[group][lane], cloud.y[group][lane], cloud.z[group][lane]]);
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
}

fn padded(values: impl ExactSizeIterator<Item = f32>, filler: f32) -> Vec<[f32; LANES]> {
    let mut groups = vec![[filler; LANES]; values.len().div_ceil(LANES)];
    groups.as_flattened_mut().iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
    groups
}

impl Remaining {
    /// Takes `centre` into account and returns the farthest point; the lowest index of equals.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::squared_distance;
    use vmao_core::random::Stream;

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
