//! One cloud at every resolution, and who neighbours whom between two of them.
//!
//! The points are put in farthest-point order once; every coarser level is a prefix of it, and a ball query takes the points that
//! come first in it, which are spread out and do not depend on how the cloud was listed.

use crate::config::NetworkConfig;
use crate::neighbours::{ball_query, farthest_point_order, nearest};

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
    /// Orders `points` (at least `config.fewest_points()`) and finds all neighbours.
    pub(crate) fn new(points: &[[f32; 3]], config: &NetworkConfig) -> Self {
        let order = farthest_point_order(points, points.len());
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
        let pyramid = Pyramid::new(&points, &config);
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
}
