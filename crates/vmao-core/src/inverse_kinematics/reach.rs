//! A proof that a pose is out of reach, from lengths and limits alone.
//!
//! A point A on the second axis moves with the first joint only, a point B on the last axis but one, seen from the wanted
//! pose, with the last joint only; their distance depends on the joints between. If no pair of first and last angles
//! inside the limits puts A and B at a distance that the joints between can give, no configuration reaches the pose.

use crate::damped_least_squares::{Fixed, Goal, Solver};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Points of two axes nearer than this are one point (m).
const COINCIDENT: f64 = 1e-9;

#[derive(Debug, Clone)]
pub(super) struct ReachBound {
    base_from_first: Fixed,
    /// A, in the frame of the first link.
    shoulder: Vector3<f64>,
    /// B, in the frame of the last joint, before it turns.
    wrist: Vector3<f64>,
    last_from_tool: Fixed,
    /// Limits of the first and of the last joint (rad).
    limits: [[f64; 2]; 2],
    /// Least and greatest distance between A and B (m).
    nearest: f64,
    farthest: f64,
}

impl ReachBound {
    /// None for a chain of less than 4 joints, about which nothing is claimed.
    pub(super) fn new(solver: &Solver) -> Option<Self> {
        let n = solver.count();
        if n < 4 {
            return None;
        }
        let fixed = &solver.fixed;
        // heights[i]: the chosen point of axis i, for 1 <= i <= n - 2; the ends lie as near to their neighbours as they can
        let mut heights = [0.0; crate::damped_least_squares::MAX_JOINTS];
        for i in 2..=n - 2 {
            heights[i] = feet(&fixed[i]).1;
        }
        (heights[1], heights[2]) = feet(&fixed[2]);
        if n > 5 {
            heights[n - 3] = feet(&fixed[n - 2]).0;
        }
        let lengths: Vec<f64> =
            (1..n - 2).map(|i| (at(&fixed[i + 1], heights[i + 1]) - Vector3::z() * heights[i]).norm()).collect();
        let (nearest, farthest) = distances(solver, &heights, &lengths);
        let limits = [0, n - 1].map(|i| [solver.joints[i].lower, solver.joints[i].upper]);
        Some(Self {
            base_from_first: fixed[0],
            shoulder: at(&fixed[1], heights[1]),
            wrist: back(&fixed[n - 1], &(Vector3::z() * heights[n - 2])),
            last_from_tool: fixed[n],
            limits,
            nearest,
            farthest,
        })
    }

    /// Whether it is proven with `most` pairs of angle intervals that no configuration inside the limits has its tool within
    /// these tolerances of the pose (m, rad).
    pub(super) fn excludes(&self, goal: &Goal, position_tolerance: f64, rotation_tolerance: f64, most: usize) -> bool {
        let (turn, offset) = &self.last_from_tool;
        let base_from_last = goal.rotation * turn.transpose();
        let last = goal.position - base_from_last * offset;
        if !last.iter().all(|x| x.is_finite()) {
            return true;
        }
        // a tool within the tolerances has its B this near to the B of the exact pose; the rest is for rounding
        let lever = offset.norm() + self.wrist.norm();
        let margin = position_tolerance + rotation_tolerance * lever + 1e-9;
        let arms = [self.shoulder.xy().norm(), self.wrist.xy().norm()];
        let mut cells = vec![self.limits];
        let mut seen = 0;
        while let Some(cell) = cells.pop() {
            seen += 1;
            let middle = cell.map(|[low, high]| (low + high) / 2.0);
            let (near, far) = (self.base_from_first.0 * turned(middle[0], &self.shoulder), turned(-middle[1], &self.wrist));
            let distance = (last + base_from_last * far - self.base_from_first.1 - near).norm();
            if (self.nearest - margin..=self.farthest + margin).contains(&distance) || seen > most {
                return false;
            }
            // a point turned by an angle moves by at most the arc, and never by more than the diameter
            let moves = [0, 1].map(|i| arms[i] * ((cell[i][1] - cell[i][0]) / 2.0).min(2.0));
            let reached = moves[0] + moves[1];
            if distance - reached > self.farthest + margin || distance + reached < self.nearest - margin {
                continue;
            }
            let split = usize::from(moves[1] > moves[0]);
            for half in [[cell[split][0], middle[split]], [middle[split], cell[split][1]]] {
                let mut part = cell;
                part[split] = half;
                cells.push(part);
            }
        }
        true
    }
}

/// Least and greatest distance between the points at `heights[1]` and `heights[n - 2]` of their axes.
fn distances(solver: &Solver, heights: &[f64], lengths: &[f64]) -> (f64, f64) {
    let (n, fixed) = (solver.count(), &solver.fixed);
    // joint i leaves the distance alone if all chosen points on one side of it lie on its axis
    let still = |i: usize| lengths[..i - 1].iter().all(|&l| l < COINCIDENT) || lengths[i - 1..].iter().all(|&l| l < COINCIDENT);
    let moving: Vec<usize> = (2..n - 2).filter(|&i| !still(i)).collect();
    let &[joint] = moving.as_slice() else {
        // a polygon closes if its longest side is no longer than the others together
        let (sum, longest) = (lengths.iter().sum::<f64>(), lengths.iter().copied().fold(0.0, f64::max));
        return ((2.0 * longest - sum).max(0.0), sum);
    };
    let mut a = Vector3::z() * heights[1];
    for step in &fixed[2..=joint] {
        a = back(step, &a);
    }
    let b =
        fixed[joint + 1..=n - 2].iter().rev().fold(Vector3::z() * heights[n - 2], |point, (turn, offset)| turn * point + offset);
    let distance = |angle: f64| (turned(angle, &b) - a).norm();
    let limits = &solver.joints[joint];
    let straight = (a.y * b.x - a.x * b.y).atan2(a.x * b.x + a.y * b.y);
    let extremes = (-4..=4).map(|half_turns| straight + f64::from(half_turns) * PI);
    let inside = extremes.filter(|angle| (limits.lower..=limits.upper).contains(angle));
    let candidates = inside.chain([limits.lower, limits.upper]).map(distance);
    let slack = 1e-12; // rounding
    candidates.fold((f64::INFINITY, 0.0), |(least, most), d| (least.min(d - slack), f64::max(most, d + slack)))
}

fn at((turn, offset): &Fixed, height: f64) -> Vector3<f64> {
    turn.column(2) * height + offset
}

fn back((turn, offset): &Fixed, point: &Vector3<f64>) -> Vector3<f64> {
    turn.transpose() * (point - offset)
}

fn turned(angle: f64, point: &Vector3<f64>) -> Vector3<f64> {
    let (sine, cosine) = angle.sin_cos();
    Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0) * point
}

/// Heights of the feet of the common normal of an axis and the next one, on each; of parallel axes, of one such normal.
fn feet((turn, offset): &Fixed) -> (f64, f64) {
    let axis = turn.column(2);
    let off_parallel = 1.0 - axis.z * axis.z;
    if off_parallel < 1e-12 {
        return (offset.z, 0.0);
    }
    let along = axis.dot(offset);
    let other = (axis.z * offset.z - along) / off_parallel;
    (offset.z + other * axis.z, other)
}
