//! Cuts the curves of a pose's solutions at the joint limits: each piece is a branch.

use super::self_motion::{STRIDE, SelfMotion, distance, foot};
use crate::{
    damped_least_squares::{Joints, MAX_JOINTS},
    kinematics::ChainJoint,
};
use std::f64::consts::TAU;

/// Solutions along which the arm can move inside its limits, from end to end.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) points: Vec<Joints>,
    pub(super) closed: bool,
}

impl Piece {
    /// The point of the polyline nearest to `q`, and its distance (rad, over all joints).
    pub(super) fn nearest(&self, q: &Joints) -> (Joints, f64) {
        let closing = self.closed.then(|| (&self.points[self.points.len() - 1], &self.points[0]));
        let pairs = self.points.windows(2).map(|pair| (&pair[0], &pair[1])).chain(closing);
        let feet = pairs.map(|(a, b)| foot(a, b, q)).map(|point| (point, distance(&point, q)));
        let first = (self.points[0], distance(&self.points[0], q));
        feet.fold(first, |best, next| if next.1 < best.1 { next } else { best })
    }

    /// Whether some point is as near to `q` as neighbouring points are to each other.
    pub(super) fn passes(&self, q: &Joints) -> bool {
        self.points.iter().any(|point| point.iter().zip(q).all(|(a, b)| (a - b).abs() < STRIDE))
    }
}

/// Consecutive points of a curve, all turned by the same whole turns to lie inside the limits.
struct Run {
    begin: usize,
    turns: Joints,
    points: Vec<Joints>,
}

/// The pieces of a curve inside the limits; a joint that can turn further than once gives several.
pub(super) fn pieces(curve: &SelfMotion, limits: &[ChainJoint]) -> Vec<Piece> {
    let (mut runs, mut going): (Vec<Run>, Vec<Run>) = (Vec::new(), Vec::new());
    for (at, point) in curve.points.iter().enumerate() {
        let inside = turns_inside(point, limits);
        let (on, ended): (Vec<Run>, Vec<Run>) = going.into_iter().partition(|run| inside.contains(&run.turns));
        runs.extend(ended);
        going = on;
        for turns in inside {
            if going.iter().all(|run| run.turns != turns) {
                going.push(Run { begin: at, turns, points: Vec::new() });
            }
        }
        for run in &mut going {
            run.points.push(std::array::from_fn(|i| point[i] + run.turns[i]));
        }
    }
    let unfinished = runs.len();
    runs.extend(going);
    let Some(closure) = curve.closure else {
        return runs.into_iter().map(|run| Piece { points: run.points, closed: false }).collect();
    };
    joined(&runs, unfinished, &closure)
}

/// Joins the runs that reach the curve's last point to those that begin at its first.
fn joined(runs: &[Run], unfinished: usize, closure: &Joints) -> Vec<Piece> {
    let follower = |index: usize| {
        let turns: Joints = std::array::from_fn(|i| runs[index].turns[i] + closure[i]);
        let follows = |run: &Run| run.begin == 0 && distance(&run.turns, &turns) < 1e-6;
        (index >= unfinished).then(|| runs.iter().position(follows)).flatten()
    };
    let followed: Vec<Option<usize>> = (0..runs.len()).map(follower).collect();
    let mut pieces = Vec::new();
    for first in 0..runs.len() {
        let closed = followed[first] == Some(first);
        if followed.contains(&Some(first)) && !closed {
            continue;
        }
        let (mut points, mut run) = (runs[first].points.clone(), first);
        while let Some(next) = followed[run].filter(|_| !closed) {
            points.extend(&runs[next].points);
            run = next;
        }
        pieces.push(Piece { points, closed });
    }
    pieces
}

/// All whole turns of the joints (rad) that bring `point` inside the limits.
fn turns_inside(point: &Joints, limits: &[ChainJoint]) -> Vec<Joints> {
    let mut found = vec![[0.0; MAX_JOINTS]];
    for (i, limits) in limits.iter().enumerate() {
        let (least, most) = ((limits.lower - point[i]) / TAU - 1e-12, (limits.upper - point[i]) / TAU + 1e-12);
        let turns: Vec<f64> = (least.ceil() as i32..=most.floor() as i32)
            .map(|turns| f64::from(turns) * TAU)
            .filter(|turn| (limits.lower..=limits.upper).contains(&(point[i] + turn)))
            .collect();
        let with = |(before, turn): (&Joints, f64)| {
            let mut all = *before;
            all[i] = turn;
            all
        };
        found = turns.iter().flat_map(|&turn| found.iter().map(move |before| (before, turn))).map(with).collect();
        if found.is_empty() {
            break;
        }
    }
    found
}
