//! The configurations of one pose: curves along which a 7-joint arm moves while its tool stands still.
//!
//! Inside the limits they fall into pieces, and a piece is a branch. A branch is traced from one of its points both ways,
//! predictor along the null space and Newton's corrector, until a limit stops it or it closes.

use crate::damped_least_squares::{Goal, Joints, MAX_JOINTS, Solver};
use nalgebra::{Cholesky, Const, Matrix6, Vector6};

/// Longest distance between neighbouring points of a branch (rad, over all joints).
pub(super) const STRIDE: f64 = 0.1;
/// Shortest stride, at a sharp bend or before a limit (rad).
const SHORTEST: f64 = 1e-4;
/// Cosine of the greatest turn between neighbouring tangents.
const STRAIGHT: f64 = 0.94;
/// A configuration nearer than this to a traced branch lies on it (rad).
const SAME: f64 = 0.02;
/// Points of a branch at most; the longest seen have a few hundred.
const MOST_POINTS: usize = 5000;

type Factor = Cholesky<f64, Const<6>>;
type Columns = [Vector6<f64>; MAX_JOINTS];

/// One piece of the set of solutions, from end to end.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    pub(super) points: Vec<Joints>,
    pub(super) closed: bool,
}

impl Curve {
    /// The point of the polyline nearest to `q`, and its distance (rad, over all joints).
    pub(super) fn nearest(&self, q: &Joints) -> (Joints, f64) {
        let mut best = (self.points[0], distance(&self.points[0], q));
        let pairs = self.points.windows(2).map(|pair| (&pair[0], &pair[1]));
        let closing = self.closed.then(|| (&self.points[self.points.len() - 1], &self.points[0]));
        for (a, b) in pairs.chain(closing) {
            let along: Joints = std::array::from_fn(|i| b[i] - a[i]);
            let share = (dot(&along, &std::array::from_fn(|i| q[i] - a[i])) / dot(&along, &along).max(1e-30)).clamp(0.0, 1.0);
            let point = std::array::from_fn(|i| a[i] + share * along[i]);
            let gap = distance(&point, q);
            if gap < best.1 {
                best = (point, gap);
            }
        }
        best
    }

    pub(super) fn holds(&self, q: &Joints) -> bool {
        self.nearest(q).1 < SAME
    }
}

fn dot(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Distance between two configurations (rad, over all joints).
pub(super) fn distance(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

impl Solver {
    /// The branch through the solution `q`. Of a chain that has not 7 joints, `q` alone: a point or part of a surface.
    pub(super) fn trace(&self, goal: &Goal, q: &Joints) -> Curve {
        let alone = Curve { points: vec![*q], closed: false };
        if self.count() != 7 {
            return alone;
        }
        let Some(tangent) = self.tangent(goal, q) else { return alone };
        let (forward, closed) = self.walk(goal, q, &tangent);
        let mut points = Vec::new();
        if !closed {
            points = self.walk(goal, q, &tangent.map(|t| -t)).0;
            points.reverse();
        }
        points.push(*q);
        points.extend(forward);
        Curve { points, closed }
    }

    /// The points after `start` in one direction, and whether the walk came back to it.
    fn walk(&self, goal: &Goal, start: &Joints, direction: &Joints) -> (Vec<Joints>, bool) {
        let (mut q, mut tangent, mut stride) = (*start, *direction, STRIDE);
        let mut points: Vec<Joints> = Vec::new();
        while points.len() < MOST_POINTS && stride >= SHORTEST {
            let ahead = std::array::from_fn(|i| q[i] + stride * tangent[i]);
            let Some((next, along)) = self.correct(goal, &ahead, &tangent) else {
                stride /= 2.0;
                continue;
            };
            let moved = distance(&next, &q);
            if dot(&along, &tangent) < STRAIGHT || moved > 1.5 * stride || moved < 0.5 * stride {
                stride /= 2.0;
                continue;
            }
            if let Some(share) = self.share_inside(&q, &next) {
                // up to just before the limit; a second try there is too short to go on
                stride *= 0.95 * share;
                continue;
            }
            if points.len() > 2 && distance(&next, start) < 0.75 * stride && dot(&along, direction) > 0.5 {
                return (points, true);
            }
            (q, tangent) = (next, along);
            points.push(q);
            stride = (stride * 1.5).min(STRIDE);
        }
        (points, false)
    }

    /// How much of the way from `q` to `next` lies inside the limits; none if all of it.
    fn share_inside(&self, q: &Joints, next: &Joints) -> Option<f64> {
        let mut least = None;
        for (i, limits) in self.joints.iter().enumerate() {
            let limit = next[i].clamp(limits.lower, limits.upper);
            if limit != next[i] {
                let share = ((limit - q[i]) / (next[i] - q[i])).clamp(0.0, 1.0);
                least = Some(least.unwrap_or(1.0_f64).min(share));
            }
        }
        least
    }

    /// Newton's method from `q` without regard to the limits, to the solution and its tangent, which looks along `before`.
    fn correct(&self, goal: &Goal, q: &Joints, before: &Joints) -> Option<(Joints, Joints)> {
        const ITERATIONS: usize = 6;
        let mut q = *q;
        for _ in 0..ITERATIONS {
            let (error, columns) = self.evaluate(goal, &q);
            let factor = self.factor(&columns)?;
            if self.within(&error) {
                let tangent = self.project(&columns, &factor, before);
                let length = dot(&tangent, &tangent).sqrt();
                return (length > 1e-6).then(|| (q, tangent.map(|t| t / length)));
            }
            let weights = factor.solve(&error);
            for i in 0..self.count() {
                q[i] += columns[i].dot(&weights);
            }
        }
        None
    }

    fn factor(&self, columns: &Columns) -> Option<Factor> {
        let mut normal = Matrix6::identity() * 1e-12;
        for column in &columns[..self.count()] {
            normal.ger(1.0, column, column, 1.0);
        }
        normal.cholesky()
    }

    /// The part of `wish` that leaves the tool where it is: (I − Jᵀ(JJᵀ)⁻¹J) wish.
    fn project(&self, columns: &Columns, factor: &Factor, wish: &Joints) -> Joints {
        let motion: Vector6<f64> = (0..self.count()).map(|i| columns[i] * wish[i]).sum();
        let weights = factor.solve(&motion);
        let mut left = *wish;
        for i in 0..self.count() {
            left[i] -= columns[i].dot(&weights);
        }
        left
    }

    /// Unit direction of the self-motion at `q`: the longest shadow of a single joint's motion in the null space.
    fn tangent(&self, goal: &Goal, q: &Joints) -> Option<Joints> {
        let (_, columns) = self.evaluate(goal, q);
        let factor = self.factor(&columns)?;
        let shadow = |i: usize| {
            let mut wish = [0.0; MAX_JOINTS];
            wish[i] = 1.0;
            self.project(&columns, &factor, &wish)
        };
        let longest = (0..self.count()).map(shadow).max_by(|a, b| dot(a, a).total_cmp(&dot(b, b)))?;
        let length = dot(&longest, &longest).sqrt();
        (length > 1e-6).then(|| longest.map(|t| t / length))
    }

    /// From a point near a solution, along the branch to the solution nearest to `seed`; none if nothing solves it.
    pub(super) fn approach(&self, goal: &Goal, near: &Joints, seed: &Joints) -> Option<Joints> {
        const ITERATIONS: usize = 30;
        const STILL: f64 = 1e-7; // rad
        let mut best: Option<(f64, Joints)> = None;
        let (mut q, mut pull) = (*near, 1.0);
        for _ in 0..ITERATIONS {
            let landed = self.descend(goal, q, self.settings.max_iterations);
            let gap = distance(&landed.q, seed);
            match best {
                Some((least, before)) if !landed.solved || gap >= least => {
                    if distance(&landed.q, &before) < STILL {
                        break;
                    }
                    // too far: half as much from where it was good
                    pull *= 0.5;
                    q = before;
                }
                _ if !landed.solved => return None,
                _ => {
                    best = Some((gap, landed.q));
                    q = landed.q;
                }
            }
            let (error, columns) = self.evaluate(goal, &q);
            let wish = std::array::from_fn(|i| (pull * (seed[i] - q[i])).clamp(-STRIDE, STRIDE));
            let step = self.step(&q, &error, &columns, &wish);
            if step.iter().all(|s| s.abs() < STILL) {
                break;
            }
            q = self.advance(&q, &step);
        }
        best.map(|(_, q)| q)
    }
}
