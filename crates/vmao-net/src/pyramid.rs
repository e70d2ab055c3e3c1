//! One cloud at every resolution, and who neighbours whom between two of them.
//!
//! The points are put in farthest-point order once; every coarser level is a prefix of it, and a ball query takes the points that
//! come first in it, which are spread out and do not depend on how the cloud was listed.

use crate::config::NetworkConfig;
use crate::neighbours::{ball_query, farthest_point_order, nearest, squared_distance};

/// The neighbourhoods of one cloud. Rigid motions leave them as they are.
#[derive(Debug, Clone)]
pub(crate) struct Pyramid {
    /// Cloud index of each point in farthest-point order.
    pub(crate) order: Vec<u32>,
    /// Points of each level, the whole cloud first.
    pub(crate) counts: Vec<usize>,
    /// For each level but the coarsest: the ball of every point of the next coarser level in this one.
    balls: Vec<Vec<u32>>,
    /// For each level but the coarsest: the nearest coarser points of every point of this level.
    nearest: Vec<Vec<u32>>,
    /// Length unit of the offsets between a level and the next coarser one (m).
    units: Vec<f32>,
}

/// Which way features flow between two levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flow {
    /// From fine to coarse: set abstraction.
    Down,
    /// From coarse to fine: set up-convolution.
    Up,
}

impl Pyramid {
    /// Orders `points` (at least `config.fewest_points()`), `spacing` apart, and finds all neighbours.
    pub(crate) fn new(points: &[[f32; 3]], spacing: &[f32], config: &NetworkConfig) -> Self {
        let order = farthest_point_order(points, &weights(spacing, config.density_power), points.len());
        let ordered: Vec<[f32; 3]> = order.iter().map(|&i| points[i as usize]).collect();
        let mut counts = vec![points.len()];
        let (mut balls, mut near) = (Vec::new(), Vec::new());
        for (level, up) in config.abstraction.iter().zip(config.up_conv.iter().rev()) {
            let fine = &ordered[..counts[counts.len() - 1]];
            let coarse = &ordered[..level.num_centroids];
            balls.push(ball_query(fine, coarse, level.radius, level.num_neighbours));
            near.push(nearest(coarse, fine, up.num_neighbours));
            counts.push(level.num_centroids);
        }
        let units = config.abstraction.iter().map(|level| level.radius.min(LARGEST_UNIT)).collect();
        Self { order, counts, balls, nearest: near, units }
    }

    /// `values` listed in farthest-point order.
    pub(crate) fn sort<T: Copy>(&self, values: &[T]) -> Vec<T> {
        self.order.iter().map(|&i| values[i as usize]).collect()
    }

    /// Appends the pairs between `level` and the next coarser one: source rows (counted from `base`) and offsets from their centres.
    ///
    /// `points` are in farthest-point order, possibly moved since.
    pub(crate) fn pairs(&self, points: &[[f32; 3]], level: usize, flow: Flow, base: usize, out: &mut (Vec<u32>, Vec<f32>)) {
        let list = match flow {
            Flow::Down => &self.balls[level],
            Flow::Up => &self.nearest[level],
        };
        let centres = match flow {
            Flow::Down => self.counts[level + 1],
            Flow::Up => self.counts[level],
        };
        let unit = self.units[level].recip();
        for (centre, sources) in points[..centres].iter().zip(list.chunks_exact(list.len() / centres)) {
            for &source in sources {
                let point = points[source as usize];
                out.0.push(base as u32 + source);
                out.1.extend([0, 1, 2].map(|axis| (point[axis] - centre[axis]) * unit));
            }
        }
    }
}

/// Weights of the farthest-point order: one over the local spacing of the points, to a power.
///
/// With power 0 centroids cover space evenly; with 1 they are as dense as the points are, so that a bare table and the arms, which
/// the cameras sample thinly, do not take the centroids away from the object.
fn weights(spacing: &[f32], power: f32) -> Vec<f32> {
    spacing.iter().map(|s| s.max(SMALLEST_SPACING).powf(-power)).collect()
}

/// Mean distance of each point to its nearest ones (m).
///
/// The mean, not the last: a centroid that is a point's last neighbour would lie at exactly one spacing from it, and so tie.
pub(crate) fn spacing(points: &[[f32; 3]]) -> Vec<f32> {
    let k = SPACING_NEIGHBOURS.min(points.len());
    let near = nearest(points, points, k);
    let one = |(point, near): (&[f32; 3], &[u32])| {
        near.iter().map(|&other| squared_distance(*point, points[other as usize]).sqrt()).sum::<f32>() / k as f32
    };
    points.iter().zip(near.chunks_exact(k)).map(one).collect()
}

/// How many nearest points, itself included, measure the spacing around a point by their mean distance.
const SPACING_NEIGHBOURS: usize = 9;

/// Spacing below which points count as equally dense (m).
const SMALLEST_SPACING: f32 = 5e-4;

/// A level that takes in everything has a radius without meaning; its offsets are in units of a table-top object (m).
const LARGEST_UNIT: f32 = 0.15;

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::random::Stream;

    #[test]
    fn every_pair_joins_its_own_centre_and_source() {
        let mut s = Stream::new(2, &[]);
        let points: Vec<[f32; 3]> = (0..300).map(|_| std::array::from_fn(|_| s.range(0.0, 0.1) as f32)).collect();
        let mut config = NetworkConfig::small();
        config.abstraction[0].num_centroids = 100;
        let pyramid = Pyramid::new(&points, &spacing(&points), &config);
        let ordered = pyramid.sort(&points);
        let radius = config.abstraction[0].radius;
        for flow in [Flow::Down, Flow::Up] {
            let mut out = (Vec::new(), Vec::new());
            pyramid.pairs(&ordered, 0, flow, 7, &mut out);
            let (centres, k) = if flow == Flow::Down { (100, 16) } else { (300, 3) };
            assert_eq!(out.0.len(), centres * k);
            for (row, (&source, offset)) in out.0.iter().zip(out.1.chunks(3)).enumerate() {
                let (p, c) = (ordered[source as usize - 7], ordered[row / k]);
                for axis in 0..3 {
                    assert!((offset[axis] * radius - (p[axis] - c[axis])).abs() < 1e-6);
                }
                let length = offset.iter().map(|x| x * x).sum::<f32>().sqrt();
                assert!(flow == Flow::Up || length <= 1.0 + 1e-5, "a ball holds what is within the radius");
            }
        }
    }

    #[test]
    fn the_order_does_not_depend_on_how_the_points_are_listed() {
        let mut s = Stream::new(3, &[]);
        let points: Vec<[f32; 3]> = (0..700).map(|_| std::array::from_fn(|_| s.range(0.0, 0.1) as f32)).collect();
        let shuffle = s.permutation(points.len());
        let listed: Vec<[f32; 3]> = shuffle.iter().map(|&i| points[i]).collect();
        let back: Vec<u32> = Pyramid::new(&listed, &spacing(&listed), &NetworkConfig::small())
            .order
            .iter()
            .map(|&i| shuffle[i as usize] as u32)
            .collect();
        assert_eq!(back, Pyramid::new(&points, &spacing(&points), &NetworkConfig::small()).order);
    }

    #[test]
    fn a_thin_table_does_not_take_the_centroids_away_from_the_object() {
        let mut s = Stream::new(3, &[]);
        let mut points: Vec<[f32; 3]> = (0..150).map(|_| [s.range(-0.3, 0.3) as f32, s.range(-0.3, 0.3) as f32, 0.0]).collect();
        points.extend((0..350).map(|_| [s.range(-0.05, 0.05) as f32, s.range(-0.01, 0.01) as f32, s.range(0.0, 0.02) as f32]));
        let on_object = |density_power: f32| {
            let pyramid = Pyramid::new(&points, &spacing(&points), &NetworkConfig { density_power, ..NetworkConfig::small() });
            pyramid.order[..100].iter().filter(|&&i| i >= 150).count()
        };
        assert!(on_object(0.0) < 20 && (55..85).contains(&on_object(1.0)), "{} {}", on_object(0.0), on_object(1.0));
    }
}
