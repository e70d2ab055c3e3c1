//! Farthest-point sampling.

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
    let axis = |axis: usize| points.iter().map(|p| (f64::from(p[axis]) - mean[axis]) as f32).collect::<Vec<f32>>();
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let squared: Vec<f32> = weights.iter().map(|w| w * w).collect();
    let mut distance: Vec<f32> = (0..points.len()).map(|i| squared[i] * (x[i] * x[i] + y[i] * y[i] + z[i] * z[i])).collect();
    let mut order = Vec::with_capacity(count);
    let mut last = largest(&distance);
    distance.fill(f32::INFINITY);
    loop {
        order.push(last as u32);
        if order.len() == count {
            return order;
        }
        // A point that was taken never comes again, even in a cloud of equal points.
        distance[last] = f32::NEG_INFINITY;
        let (cx, cy, cz) = (x[last], y[last], z[last]);
        for ((((distance, weight), x), y), z) in distance.iter_mut().zip(&squared).zip(&x).zip(&y).zip(&z) {
            let (dx, dy, dz) = (x - cx, y - cy, z - cz);
            let gap = weight * (dx * dx + dy * dy + dz * dz);
            *distance = if gap < *distance { gap } else { *distance };
        }
        last = largest(&distance);
    }
}

/// Index of the largest value; the lowest of equals.
fn largest(values: &[f32]) -> usize {
    const LANES: usize = 16;
    let mut best = [f32::NEG_INFINITY; LANES];
    let (whole, rest) = values.as_chunks::<LANES>();
    for chunk in whole {
        for (best, &value) in best.iter_mut().zip(chunk) {
            *best = if value > *best { value } else { *best };
        }
    }
    for (best, &value) in best.iter_mut().zip(rest) {
        *best = best.max(value);
    }
    let top = best.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
    values.iter().position(|&value| value >= top).unwrap_or(0)
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
