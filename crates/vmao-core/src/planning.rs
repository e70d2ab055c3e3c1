//! Motion planning for all arms together: straight line, arms one by one, RRT-Connect in all joints, then shortcuts.
//!
//! RRT-Connect is Kuffner & LaValle, ICRA 2000, in the joint space of all arms at once. Edges are checked without gaps
//! ([`CollisionChecker::edge_is_free`]): a path is clear by half the margin everywhere, not only at samples.

use crate::{
    collision::{CollisionChecker, CollisionPair, CollisionWorld},
    joint_path::{Tree, at_length, blend, distance, largest_turn, length, remove_collinear},
    random::Stream,
    swept::Scope,
    time_parameterization::{MotionLimits, Trajectory},
};
use std::{fmt, ops::Range};

/// How hard to look for a path and how closely to check it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanSettings {
    /// Longest new branch of a tree, by its most moved joint (rad).
    pub extension: f64,
    /// Most random samples.
    pub max_iterations: usize,
    /// Most attempts to shorten a path.
    pub shortcut_iterations: usize,
    /// Shortening ends after this many attempts in succession that gained less than a thousandth.
    pub shortcut_patience: usize,
    /// Least distance between things that must not touch (m).
    pub margin: f64,
    /// Arms that stay at their start; they are in the way of the others, but may keep the contacts they have.
    pub frozen_arms: Vec<usize>,
}

impl Default for PlanSettings {
    fn default() -> Self {
        let (extension, margin) = (0.6, 0.005);
        let (shortcut_iterations, shortcut_patience) = (150, 6);
        Self { extension, max_iterations: 20_000, shortcut_iterations, shortcut_patience, margin, frozen_arms: Vec::new() }
    }
}

/// A path, or why there is none.
#[derive(Debug, Clone, PartialEq)]
pub enum PlanOutcome {
    /// Waypoints from start to goal, joined by straight lines in joint space; each holds all arms' angles (rad).
    Path(Vec<Vec<f64>>),
    /// No path.
    Failed(PlanFailure),
}

/// Why there is no path.
#[derive(Debug, Clone, PartialEq)]
pub enum PlanFailure {
    /// The start is closer than the margin to a collision.
    StartInCollision(CollisionPair),
    /// The goal is closer than the margin to a collision.
    GoalInCollision(CollisionPair),
    /// The start is outside the joint limits by more than [`START_TOLERANCE`], or the goal is outside.
    OutOfLimits {
        /// Whether it is the goal.
        at_goal: bool,
        /// Index of the arm.
        arm: usize,
        /// Index of the joint in its arm.
        joint: usize,
        /// Its angle (rad).
        angle: f64,
        /// Lowest and highest angle (rad).
        range: [f64; 2],
    },
    /// No path was found in `max_iterations` samples; this does not say that there is none.
    BudgetExhausted,
}

impl fmt::Display for PlanFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StartInCollision(pair) => write!(f, "at the start, {pair}"),
            Self::GoalInCollision(pair) => write!(f, "at the end, {pair}"),
            Self::OutOfLimits { at_goal, arm, joint, angle, range: [low, high] } => {
                let end = if *at_goal { "end" } else { "start" };
                write!(f, "at the {end}, joint {} of arm {arm} is at {angle} rad, outside its limits [{low}, {high}]", joint + 1)
            }
            Self::BudgetExhausted => write!(f, "no path found within the budget of samples; there may be one"),
        }
    }
}

/// How far outside its limits a joint may start (rad): controllers overshoot by less.
pub const START_TOLERANCE: f64 = 0.01;

/// A collision-free path of all arms from `start` to `goal` (flat, arm after arm, rad).
///
/// A joint that starts outside its limits by at most [`START_TOLERANCE`] starts at the limit: the path's first point may
/// differ from `start` by that. A frozen arm stays at its start, wherever that is and whatever the goal says. Panics if
/// `start` or `goal` has not one angle per joint.
pub fn plan(world: &CollisionWorld, start: &[f64], goal: &[f64], settings: &PlanSettings, stream: &mut Stream) -> PlanOutcome {
    let mut planner = Planner::new(world, settings);
    assert!(start.len() == planner.free.len() && goal.len() == start.len(), "one angle per joint of all arms");
    let start: Vec<f64> = (0..start.len()).map(|i| planner.start_angle(i, start[i])).collect();
    let goal: Vec<f64> = (0..start.len()).map(|i| if planner.free[i] { goal[i] } else { start[i] }).collect();
    for (at_goal, q) in [(false, &start), (true, &goal)] {
        if let Some(failure) = planner.out_of_limits(at_goal, q) {
            return PlanOutcome::Failed(failure);
        }
    }
    if let Some(pair) = planner.checker.check(&start, settings.margin) {
        return PlanOutcome::Failed(PlanFailure::StartInCollision(pair));
    }
    if let Some(pair) = planner.checker.check(&goal, settings.margin) {
        return PlanOutcome::Failed(PlanFailure::GoalInCollision(pair));
    }
    match planner.find(&start, &goal, stream) {
        Some(mut path) => {
            planner.shorten(&mut path, stream);
            PlanOutcome::Path(path)
        }
        None => PlanOutcome::Failed(PlanFailure::BudgetExhausted),
    }
}

/// The first edge of `path` that comes closer to a collision than the margin, and what collides there.
///
/// For paths made elsewhere, such as tracked lines of the tool; checked without gaps, like plans. Panics if a waypoint has
/// not one angle per joint.
pub fn first_collision(world: &CollisionWorld, path: &[Vec<f64>], settings: &PlanSettings) -> Option<(usize, CollisionPair)> {
    let mut checker = CollisionChecker::with_frozen(world, &settings.frozen_arms);
    if let Some(pair) = path.first().and_then(|start| checker.check(start, settings.margin)) {
        return Some((0, pair));
    }
    let hit = |(edge, ends): (usize, &[Vec<f64>])| Some((edge, checker.check_edge(&ends[0], &ends[1], settings.margin)?));
    path.windows(2).enumerate().find_map(hit)
}

/// Times a path, cutting its corners as widely as stays free of collision by half the margin, sampled every 5 ms.
///
/// Corners come within 0.2 rad of their waypoint down to 0.001 rad; with `None` even the least cut collides.
pub fn time_path(
    world: &CollisionWorld,
    path: &[Vec<f64>],
    limits: &MotionLimits,
    settings: &PlanSettings,
) -> Option<Trajectory> {
    const SAMPLE_PERIOD: f64 = 0.005;
    let mut checker = CollisionChecker::with_frozen(world, &settings.frozen_arms);
    [0.2, 0.05, 0.01, 0.001].into_iter().find_map(|deviation| {
        let trajectory = Trajectory::new(path, limits, deviation);
        let samples = (trajectory.duration() / SAMPLE_PERIOD).ceil() as usize;
        let mut free = |time: f64| checker.is_free(&trajectory.at(time).0, settings.margin / 2.0);
        (0..=samples).all(|i| free(i as f64 * SAMPLE_PERIOD)).then_some(trajectory)
    })
}

pub(crate) struct Planner<'a> {
    world: &'a CollisionWorld,
    settings: &'a PlanSettings,
    /// The pairs that count now.
    scope: Scope,
    checker: CollisionChecker<'a>,
    /// Whether each joint may move.
    free: Vec<bool>,
    /// The arm of each joint.
    arm_of: Vec<usize>,
    limits: Vec<[f64; 2]>,
}

impl<'a> Planner<'a> {
    fn new(world: &'a CollisionWorld, settings: &'a PlanSettings) -> Self {
        let arms = || world.arms.iter().enumerate().flat_map(|(arm, model)| model.chain.joints.iter().map(move |j| (arm, j)));
        Self {
            world,
            settings,
            scope: Scope::All,
            checker: CollisionChecker::with_frozen(world, &settings.frozen_arms),
            free: arms().map(|(arm, _)| !settings.frozen_arms.contains(&arm)).collect(),
            arm_of: arms().map(|(arm, _)| arm).collect(),
            limits: arms().map(|(_, joint)| [joint.lower, joint.upper]).collect(),
        }
    }

    /// The angle joint `i` starts at: one a little outside its limits is at the limit, those of frozen arms stay.
    fn start_angle(&self, i: usize, angle: f64) -> f64 {
        let [low, high] = self.limits[i];
        let inside = angle.clamp(low, high);
        if self.free[i] && (inside - angle).abs() <= START_TOLERANCE { inside } else { angle }
    }

    fn out_of_limits(&self, at_goal: bool, q: &[f64]) -> Option<PlanFailure> {
        let outside = |&i: &usize| self.free[i] && !(self.limits[i][0]..=self.limits[i][1]).contains(&q[i]);
        let i = (0..q.len()).find(outside)?;
        let (arm, range) = (self.arm_of[i], self.limits[i]);
        let joint = self.arm_of[..i].iter().filter(|&&other| other == arm).count();
        Some(PlanFailure::OutOfLimits { at_goal, arm, joint, angle: q[i], range })
    }

    fn find(&mut self, start: &[f64], goal: &[f64], stream: &mut Stream) -> Option<Vec<Vec<f64>>> {
        if self.edge_is_free(start, goal) {
            return Some(vec![start.to_vec(), goal.to_vec()]);
        }
        // Arms that only get in each other's way are soonest timed; arms that must change places soonest found in all
        // joints at once. What neither finds quickly gets more of both.
        let samples = self.settings.max_iterations;
        [(3, samples / 20), (30, samples - samples / 20)].into_iter().find_map(|(attempts, samples)| {
            let timed = self.coordinated(start, goal, attempts, stream);
            timed.or_else(|| self.grow_trees(start, goal, samples, stream))
        })
    }

    /// The joints of each arm.
    pub(crate) fn arms(&self) -> Vec<Range<usize>> {
        self.arm_of
            .chunk_by(|a, b| a == b)
            .scan(0, |first, own| {
                let joints = *first..*first + own.len();
                *first = joints.end;
                Some(joints)
            })
            .collect()
    }

    /// A short way of one arm as if no other moved; both ends differ in its joints only.
    pub(crate) fn alone(
        &mut self,
        joints: &Range<usize>,
        start: &[f64],
        goal: &[f64],
        stream: &mut Stream,
    ) -> Option<Vec<Vec<f64>>> {
        const SHARE: usize = 4; // of the samples, so that the search in all joints has its own
        let free = (0..self.free.len()).map(|i| joints.contains(&i)).collect();
        let all = std::mem::replace(&mut self.free, free);
        self.scope = Scope::Own(self.arm_of[joints.start]);
        let mut path = if self.edge_is_free(start, goal) {
            Some(vec![start.to_vec(), goal.to_vec()])
        } else {
            self.grow_trees(start, goal, self.settings.max_iterations / SHARE, stream)
        };
        if let Some(path) = &mut path {
            self.shorten(path, stream);
        }
        (self.scope, self.free) = (Scope::All, all);
        path
    }

    fn grow_trees(&mut self, start: &[f64], goal: &[f64], samples: usize, stream: &mut Stream) -> Option<Vec<Vec<f64>>> {
        let mut trees = [Tree::new(start), Tree::new(goal)];
        let mut side = 0;
        for _ in 0..samples {
            let limits = self.limits.iter().zip(&self.free).zip(start);
            let sample: Vec<f64> =
                limits.map(|((&[low, high], &free), &at)| if free { stream.range(low, high) } else { at }).collect();
            if let Some(node) = self.extend(&mut trees[side], &sample) {
                let target = trees[side].point(node).to_vec();
                let mut reached = None;
                while let Some(next) = self.extend(&mut trees[1 - side], &target) {
                    if trees[1 - side].point(next) == target {
                        reached = Some(next);
                        break;
                    }
                }
                if let Some(other) = reached {
                    let (from_start, from_goal) = if side == 0 { (node, other) } else { (other, node) };
                    let mut path = trees[0].path_to(from_start);
                    path.reverse();
                    path.extend(trees[1].path_to(from_goal).into_iter().skip(1));
                    return Some(path);
                }
            }
            // the smaller tree grows next, so that neither side stays a stub
            side = usize::from(trees[1].len() < trees[0].len());
        }
        None
    }

    /// Grows `tree` from its nearest node towards `target` by at most one extension; the new node, if the way is free.
    fn extend(&mut self, tree: &mut Tree, target: &[f64]) -> Option<usize> {
        let nearest = tree.nearest(target);
        let from = tree.point(nearest);
        let turn = largest_turn(from, target);
        if turn == 0.0 {
            return None;
        }
        let fraction = self.settings.extension / turn;
        let to = if fraction >= 1.0 { target.to_vec() } else { blend(from, target, fraction) };
        self.edge_is_free(from, &to).then(|| tree.push(&to, nearest))
    }

    fn edge_is_free(&mut self, from: &[f64], to: &[f64]) -> bool {
        self.edge_is_free_in(self.scope, from, to)
    }

    pub(crate) fn edge_is_free_in(&mut self, scope: Scope, from: &[f64], to: &[f64]) -> bool {
        self.checker.edge_is_free_in(scope, from, to, self.settings.margin)
    }

    fn is_free(&mut self, path: &[Vec<f64>]) -> bool {
        path.windows(2).all(|edge| self.edge_is_free(&edge[0], &edge[1]))
    }

    /// Replaces random stretches by straight lines, of all arms or of one arm alone, where that is free and shorter.
    fn shorten(&mut self, path: &mut Vec<Vec<f64>>, stream: &mut Stream) {
        let arms = if self.scope == Scope::All { self.world.arms.len() } else { 1 };
        let mut failures = 0;
        for _ in 0..self.settings.shortcut_iterations {
            if path.len() <= 2 || failures > self.settings.shortcut_patience {
                break;
            }
            failures += 1;
            let total = length(path);
            let (a, b) = (stream.unit() * total, stream.unit() * total);
            let choice = if arms > 1 { stream.index(arms + 1) } else { 0 };
            let (first, from) = at_length(path, a.min(b));
            let (last, to) = at_length(path, a.max(b));
            if first == last {
                continue;
            }
            let mut stretch = vec![from];
            if choice < arms && arms > 1 {
                stretch.extend_from_slice(&path[first + 1..=last]);
                stretch.push(to);
                self.straighten_arm(&mut stretch, choice);
            } else {
                stretch.push(to);
            }
            let mut candidate = path[..=first].to_vec();
            candidate.extend(stretch.iter().cloned());
            candidate.extend_from_slice(&path[last + 1..]);
            // the stretch begins on the path, which is clear
            if length(&candidate) < total * (1.0 - 1e-3) && self.is_free(&stretch) {
                candidate.dedup();
                *path = candidate;
                failures = 0;
            }
        }
        remove_collinear(path);
    }

    /// Lets one arm go straight over a stretch while the others keep their way.
    fn straighten_arm(&self, stretch: &mut [Vec<f64>], arm: usize) {
        let total = length(stretch);
        let (Some(from), Some(to)) = (stretch.first().cloned(), stretch.last().cloned()) else { return };
        let mut done = 0.0;
        let mut before = from.clone();
        for point in stretch.iter_mut() {
            done += distance(&before, point);
            before.clone_from(point);
            for i in (0..point.len()).filter(|&i| self.arm_of[i] == arm) {
                point[i] = from[i] + (to[i] - from[i]) * (done / total).min(1.0);
            }
        }
    }
}
