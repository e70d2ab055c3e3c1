//! The configurations of one pose: curves along which a 7-joint arm moves while its tool stands still.
//!
//! Without limits the curves are closed. A curve is traced from one of its points, predictor along the null space and
//! Newton's corrector, until it comes back, each joint by a whole number of turns. `pieces.rs` cuts it at the limits.

use crate::{
    damped_least_squares::{Goal, Joints, MAX_JOINTS, PATIENCE, Solver},
    small_systems::NormalEquations,
};
use nalgebra::Vector6;
use std::f64::consts::TAU;

/// Longest distance between neighbouring points of a curve (rad, over all joints).
pub(super) const STRIDE: f64 = 0.1;
/// The same where a limit is nearer than [`STRIDE`].
const STRIDE_AT_LIMIT: f64 = 0.02;
/// Shortest stride, at a sharp bend (rad).
const SHORTEST: f64 = 1e-4;
/// Cosine of the greatest turn between neighbouring tangents.
const STRAIGHT: f64 = 0.94;
/// A configuration nearer than this to a traced curve lies on it (rad).
const SAME: f64 = 0.02;
/// Every so manieth point is looked out for, so that a walk in circles ends.
const ANCHOR_SPACING: usize = 16;
/// Points of a curve at most; the longest seen have some hundred.
const MOST_POINTS: usize = 5000;

type Columns = [Vector6<f64>; MAX_JOINTS];

/// All configurations that the arm can move to from one, if it had no limits.
#[derive(Debug, Clone)]
pub(super) struct SelfMotion {
    pub(super) points: Vec<Joints>,
    /// From the first point to where the curve comes back to it, whole turns; none if it was not traced to its end.
    pub(super) closure: Option<Joints>,
}

impl SelfMotion {
    /// Whether `q` lies on the curve but for whole turns of its joints.
    pub(super) fn holds(&self, q: &Joints) -> bool {
        let beside = |point: &Joints| -> Joints { std::array::from_fn(|i| turned_near(q[i], point[i])) };
        let near = |point: &Joints| point.iter().zip(q).all(|(a, &b)| (turned_near(b, *a) - a).abs() < STRIDE + SAME);
        let last = self.closure.map(|closure| std::array::from_fn(|i| self.points[0][i] + closure[i]));
        let ends = self.points[1..].iter().chain(&last);
        self.points.iter().zip(ends).any(|(a, b)| near(a) && distance(&foot(a, b, &beside(a)), &beside(a)) < SAME)
            || self.points.iter().any(|point| near(point) && distance(point, &beside(point)) < SAME)
    }
}

/// The angle that differs from `angle` by whole turns and is nearest to `other`.
fn turned_near(angle: f64, other: f64) -> f64 {
    let turns = (other - angle) / TAU;
    // `round` is a call where the processor's baseline has no instruction for it
    angle + TAU * f64::from((turns + 0.5_f64.copysign(turns)) as i32)
}

/// The point of the segment from `a` to `b` nearest to `q`.
pub(super) fn foot(a: &Joints, b: &Joints, q: &Joints) -> Joints {
    let along: Joints = std::array::from_fn(|i| b[i] - a[i]);
    let share = (dot(&along, &std::array::from_fn(|i| q[i] - a[i])) / dot(&along, &along).max(1e-30)).clamp(0.0, 1.0);
    std::array::from_fn(|i| a[i] + share * along[i])
}

fn dot(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Distance between two configurations (rad, over all joints).
pub(super) fn distance(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

impl Solver {
    /// The curve through the solution `q`. Of a chain that has not 7 joints, `q` alone: a point, or part of a surface.
    pub(super) fn trace(&self, goal: &Goal, q: &Joints) -> SelfMotion {
        let tangent = if self.count() == 7 { self.tangent(goal, q) } else { None };
        let Some(tangent) = tangent else { return SelfMotion { points: vec![*q], closure: None } };
        let (forward, closure) = self.walk(goal, q, &tangent);
        let mut points = vec![*q];
        if closure.is_none() {
            points = self.walk(goal, q, &tangent.map(|t| -t)).0;
            points.reverse();
            points.push(*q);
        }
        points.extend(forward);
        SelfMotion { points, closure }
    }

    /// The points after `start` in one direction, and how far all turned when the curve came back, if it did.
    fn walk(&self, goal: &Goal, start: &Joints, direction: &Joints) -> (Vec<Joints>, Option<Joints>) {
        let (mut q, mut tangent, mut stride, mut walked) = (*start, *direction, STRIDE, 0.0);
        let mut anchors = vec![(*start, *direction, 0.0)];
        let mut points: Vec<Joints> = Vec::new();
        while points.len() < MOST_POINTS && stride >= SHORTEST {
            stride = stride.min(self.longest_stride(&q));
            let ahead = std::array::from_fn(|i| q[i] + stride * tangent[i]);
            let landed = self.correct(goal, &ahead, &tangent);
            let straight = |(next, along): &(Joints, Joints)| {
                dot(along, &tangent) > STRAIGHT && (0.5 * stride..1.5 * stride).contains(&distance(next, &q))
            };
            let Some((next, along)) = landed.filter(straight) else {
                stride /= 2.0;
                continue;
            };
            walked += stride;
            let returns = |(anchor, heading, passed): &(Joints, Joints, f64)| {
                let back: Joints = std::array::from_fn(|i| turned_near(anchor[i], next[i]));
                let here = walked - passed > 1.5 * STRIDE
                    && dot(&along, heading) > 0.0
                    && distance(&foot(&q, &next, &back), &back) < SAME;
                here.then_some(back)
            };
            if let Some((index, back)) = anchors.iter().enumerate().find_map(|(index, anchor)| Some((index, returns(anchor)?))) {
                if index == 0 {
                    return (points, Some(std::array::from_fn(|i| back[i] - start[i])));
                }
                // Back anywhere but at the start, the walk has slipped to a neighbouring curve at a nearly singular place,
                // and has followed a stretch before the anchor twice.
                let known = points[..ANCHOR_SPACING * index].to_vec();
                let twice =
                    |point: &Joints| known.windows(2).any(|pair| distance(&foot(&pair[0], &pair[1], point), point) < SAME);
                while points.len() > known.len() && points.last().is_some_and(twice) {
                    points.pop();
                }
                return (points, None);
            }
            if points.len() % ANCHOR_SPACING == ANCHOR_SPACING - 1 {
                anchors.push((next, along, walked));
            }
            (q, tangent) = (next, along);
            points.push(q);
            stride *= 1.5;
        }
        (points, None)
    }

    /// Short where the curve may pass a limit, so that no piece of it is stepped over.
    fn longest_stride(&self, q: &Joints) -> f64 {
        let mut at_limit = false;
        for (limits, &angle) in self.joints.iter().zip(q) {
            let middle = (limits.lower + limits.upper) / 2.0;
            if (turned_near(angle, middle) - middle).abs() > (limits.upper - limits.lower) / 2.0 + STRIDE {
                return STRIDE;
            }
            at_limit |= [limits.lower, limits.upper].iter().any(|limit| (turned_near(angle, *limit) - limit).abs() < STRIDE);
        }
        if at_limit { STRIDE_AT_LIMIT } else { STRIDE }
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

    fn factor(&self, columns: &Columns) -> Option<NormalEquations> {
        NormalEquations::new(columns[..self.count()].iter(), 1e-12)
    }

    /// The part of `wish` that leaves the tool where it is: (I − Jᵀ(JJᵀ)⁻¹J) wish.
    fn project(&self, columns: &Columns, factor: &NormalEquations, wish: &Joints) -> Joints {
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
            let landed = self.descend(goal, q, self.settings.max_iterations, PATIENCE);
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
