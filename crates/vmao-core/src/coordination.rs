//! Arms planned one by one, then timed against each other.
//!
//! Each arm's way is sought in its own joint space as if the other moving arms were not there, which is far cheaper than
//! in all joints at once. Then all follow their ways together: in proportion if that is free, else by the cheapest way
//! through the lattice of how far each has come (O'Donnell & Lozano-Pérez 1989). What this cannot solve is left to the
//! search in all joints.

use crate::{
    joint_path::{blend, distance, length},
    planning::Planner,
    random::Stream,
    swept::Scope,
};
use std::{cmp::Ordering, collections::BinaryHeap, ops::Range};

/// Most nodes of a lattice.
const MAX_NODES: usize = 40_000;

/// The way of one arm; of one that stays, its place.
struct Track {
    joints: Range<usize>,
    /// Angles of this arm alone (rad), joined by straight lines.
    points: Vec<Vec<f64>>,
}

impl Planner<'_> {
    /// A way for all arms from ways of the single arms, sought anew for each of some attempts; for one moving arm always none.
    pub(crate) fn coordinated(
        &mut self,
        start: &[f64],
        goal: &[f64],
        attempts: usize,
        stream: &mut Stream,
    ) -> Option<Vec<Vec<f64>>> {
        let arms = self.arms();
        if arms.iter().filter(|own| start[(*own).clone()] != goal[(*own).clone()]).count() < 2 {
            return None;
        }
        (0..attempts).find_map(|_| {
            let mut tracks = Vec::with_capacity(arms.len());
            for joints in &arms {
                let mut target = start.to_vec();
                target[joints.clone()].copy_from_slice(&goal[joints.clone()]);
                let path = if target == start { vec![target] } else { self.alone(joints, start, &target, stream)? };
                let points = path.into_iter().map(|q| q[joints.clone()].to_vec()).collect();
                tracks.push(Track { joints: joints.clone(), points });
            }
            self.in_proportion(start, &tracks).or_else(|| self.through_lattice(start, &tracks))
        })
    }

    /// All arms the same share of their way at any time, if that is free.
    fn in_proportion(&mut self, start: &[f64], tracks: &[Track]) -> Option<Vec<Vec<f64>>> {
        let mut shares: Vec<f64> = tracks.iter().flat_map(Track::shares).collect();
        shares.sort_by(f64::total_cmp);
        shares.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let at = |share: &f64| {
            let mut q = start.to_vec();
            for track in tracks {
                q[track.joints.clone()].copy_from_slice(&track.at(*share));
            }
            q
        };
        let path: Vec<Vec<f64>> = shares.iter().map(at).collect();
        path.windows(2).all(|edge| self.edge_is_free_in(Scope::Between, &edge[0], &edge[1])).then_some(path)
    }

    /// The shortest way on which every arm goes or waits, from stop to stop, without meeting another (A*).
    fn through_lattice(&mut self, start: &[f64], tracks: &[Track]) -> Option<Vec<Vec<f64>>> {
        let lattice = Lattice::new(tracks)?;
        let mut costs = vec![f64::INFINITY; lattice.nodes];
        let mut came_from = vec![usize::MAX; lattice.nodes];
        let mut closed = vec![false; lattice.nodes];
        let mut known = Known::new(&lattice);
        let mut open = BinaryHeap::from([Open { estimate: lattice.left(0), node: 0 }]);
        costs[0] = 0.0;
        while let Some(Open { node, .. }) = open.pop() {
            if std::mem::replace(&mut closed[node], true) {
                continue;
            }
            if node + 1 == lattice.nodes {
                let mut path = vec![lattice.configuration(start, tracks, node)];
                let mut node = node;
                while node != 0 {
                    node = came_from[node];
                    path.push(lattice.configuration(start, tracks, node));
                }
                path.reverse();
                return Some(path);
            }
            let from = lattice.configuration(start, tracks, node);
            for (next, step) in lattice.successors(node) {
                let cost = costs[node] + step;
                if closed[next] || cost >= costs[next] {
                    continue;
                }
                let to = lattice.configuration(start, tracks, next);
                if self.step_is_free(&lattice, &mut known, (node, &from), (next, &to)) {
                    (costs[next], came_from[next]) = (cost, node);
                    open.push(Open { estimate: cost + lattice.left(next), node: next });
                }
            }
        }
        None
    }
}

impl Planner<'_> {
    /// Whether no two arms meet on a step through the lattice; what is known of two arms holds wherever the others are.
    fn step_is_free(
        &mut self,
        lattice: &Lattice,
        known: &mut Known,
        (node, from): (usize, &[f64]),
        (next, to): (usize, &[f64]),
    ) -> bool {
        let stops = |axis: &Axis| (lattice.stop(node, axis), lattice.stop(next, axis));
        lattice.axes.iter().enumerate().all(|(one, first)| {
            lattice.axes.iter().enumerate().skip(one + 1).all(|(other, second)| {
                let ((i, to_i), (j, to_j)) = (stops(first), stops(second));
                let entry = 4 * (i * second.stops.len() + j) + 2 * (to_i - i) + (to_j - j);
                *known.0[one * lattice.axes.len() + other][entry]
                    .get_or_insert_with(|| self.edge_is_free_in(Scope::Pair(one, other), from, to))
            })
        })
    }
}

/// For two arms, from which stops, and which of both goes on: whether that is free, where it was asked.
struct Known(Vec<Vec<Option<bool>>>);

impl Known {
    fn new(lattice: &Lattice) -> Self {
        let pairs = lattice.axes.iter().enumerate().flat_map(|(one, first)| {
            let table = move |(other, second): (usize, &Axis)| {
                if one < other { vec![None; 4 * first.stops.len() * second.stops.len()] } else { Vec::new() }
            };
            lattice.axes.iter().enumerate().map(table)
        });
        Self(pairs.collect())
    }
}

impl Track {
    /// How much of the way lies before each point, 0 to 1.
    fn shares(&self) -> Vec<f64> {
        let total = length(&self.points);
        let mut done = 0.0;
        let mut shares = vec![0.0];
        for edge in self.points.windows(2) {
            done += distance(&edge[0], &edge[1]);
            shares.push((done / total).min(1.0));
        }
        shares
    }

    fn at(&self, share: f64) -> Vec<f64> {
        let shares = self.shares();
        if shares.len() == 1 {
            return self.points[0].clone();
        }
        let after = shares.partition_point(|&before| before <= share).clamp(1, shares.len() - 1);
        let (low, high) = (shares[after - 1], shares[after]);
        let fraction = if high > low { ((share - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
        blend(&self.points[after - 1], &self.points[after], fraction)
    }
}

/// How far every arm has come, as one number; the last one is the goal.
struct Lattice {
    nodes: usize,
    /// For each arm its stops, how far each is along its way (rad), and how many nodes one stop counts for.
    axes: Vec<Axis>,
}

struct Axis {
    stops: Vec<Vec<f64>>,
    along: Vec<f64>,
    stride: usize,
}

impl Lattice {
    fn new(tracks: &[Track]) -> Option<Self> {
        let parts = match tracks.len() {
            2 => 16.0,
            3 => 14.0,
            _ => 4.0,
        };
        let mut nodes = 1_usize;
        let mut axes = Vec::with_capacity(tracks.len());
        for track in tracks {
            let spacing = length(&track.points) / parts;
            let (mut stops, mut along) = (vec![track.points[0].clone()], vec![0.0]);
            for edge in track.points.windows(2) {
                let (count, edge_length) =
                    ((distance(&edge[0], &edge[1]) / spacing).ceil().max(1.0) as usize, distance(&edge[0], &edge[1]));
                let before = along[along.len() - 1];
                for i in 1..=count {
                    let fraction = i as f64 / count as f64;
                    stops.push(blend(&edge[0], &edge[1], fraction));
                    along.push(before + edge_length * fraction);
                }
            }
            axes.push(Axis { stride: nodes, along, stops });
            nodes *= axes[axes.len() - 1].stops.len();
        }
        (nodes <= MAX_NODES).then_some(Self { nodes, axes })
    }

    fn stop(&self, node: usize, axis: &Axis) -> usize {
        node / axis.stride % axis.stops.len()
    }

    fn configuration(&self, start: &[f64], tracks: &[Track], node: usize) -> Vec<f64> {
        let mut q = start.to_vec();
        for (track, axis) in tracks.iter().zip(&self.axes) {
            q[track.joints.clone()].copy_from_slice(&axis.stops[self.stop(node, axis)]);
        }
        q
    }

    /// The least that is left to go (rad).
    fn left(&self, node: usize) -> f64 {
        let left = |axis: &Axis| axis.along[axis.along.len() - 1] - axis.along[self.stop(node, axis)];
        self.axes.iter().map(|axis| left(axis).powi(2)).sum::<f64>().sqrt()
    }

    /// Nodes in which some arms, at least one, have come one stop further, and how far that is (rad).
    fn successors(&self, node: usize) -> Vec<(usize, f64)> {
        let advance = |movers: usize| {
            let (mut next, mut square) = (node, 0.0);
            for (_, axis) in self.axes.iter().enumerate().filter(|(index, _)| movers >> index & 1 == 1) {
                let stop = self.stop(node, axis);
                square += (axis.along.get(stop + 1)? - axis.along[stop]).powi(2);
                next += axis.stride;
            }
            Some((next, square.sqrt()))
        };
        (1..1 << self.axes.len()).filter_map(advance).collect()
    }
}

/// A node to look at, the cheapest first, of equals the one with the lowest number.
struct Open {
    estimate: f64,
    node: usize,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        other.estimate.total_cmp(&self.estimate).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}
