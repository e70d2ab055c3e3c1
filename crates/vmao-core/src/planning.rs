//! Motion planning for all arms together: straight line, one arm at a time, then RRT-Connect, then shortcuts.
//!
//! RRT-Connect is Kuffner & LaValle, ICRA 2000, in the joint space of all arms at once. Edges are checked without gaps
//! ([`CollisionChecker::edge_is_free`]): a path is clear by half the margin everywhere, not only at samples.

use crate::{
    collision::{CollisionChecker, CollisionPair, CollisionWorld},
    joint_path::{Tree, at_length, blend, distance, largest_turn, length, remove_collinear},
    random::Stream,
    time_parameterization::{MotionLimits, Trajectory},
};
use std::fmt;

/// How hard to look for a path and how closely to check it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanSettings {
    /// Longest new branch of a tree, by its most moved joint (rad).
    pub extension: f64,
    /// Most random samples.
    pub max_iterations: usize,
    /// Attempts to shorten the path.
    pub shortcut_iterations: usize,
    /// Least distance between things that must not touch (m).
    pub margin: f64,
    /// Arms that stay at their start; they are in the way of the others, but may keep the contacts they have.
    pub frozen_arms: Vec<usize>,
}

impl Default for PlanSettings {
    fn default() -> Self {
        let (extension, margin) = (0.6, 0.005);
        Self { extension, max_iterations: 20_000, shortcut_iterations: 150, margin, frozen_arms: Vec::new() }
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

struct Planner<'a> {
    world: &'a CollisionWorld,
    settings: &'a PlanSettings,
    checker: CollisionChecker<'a>,
    samples_left: usize,
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
            checker: CollisionChecker::with_frozen(world, &settings.frozen_arms),
            samples_left: settings.max_iterations,
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
        self.one_arm_after_the_other(start, goal).or_else(|| self.grow_trees(start, goal, stream))
    }

    /// Tries to move whole arms in turn, in every order: cheap, and often all that crossed arms need.
    fn one_arm_after_the_other(&mut self, start: &[f64], goal: &[f64]) -> Option<Vec<Vec<f64>>> {
        const MOST_ARMS: usize = 4; // 24 orders
        let moves = |&arm: &usize| (0..start.len()).any(|i| self.arm_of[i] == arm && start[i] != goal[i]);
        let arms: Vec<usize> = (0..self.world.arms.len()).filter(moves).collect();
        if arms.len() < 2 || arms.len() > MOST_ARMS {
            return None;
        }
        orders(&arms).into_iter().find_map(|order| {
            let mut path = vec![start.to_vec()];
            for arm in order {
                let from = path.last()?;
                let to: Vec<f64> = (0..from.len()).map(|i| if self.arm_of[i] == arm { goal[i] } else { from[i] }).collect();
                if !self.edge_is_free(from, &to) {
                    return None;
                }
                path.push(to);
            }
            Some(path)
        })
    }

    fn grow_trees(&mut self, start: &[f64], goal: &[f64], stream: &mut Stream) -> Option<Vec<Vec<f64>>> {
        let mut trees = [Tree::new(start), Tree::new(goal)];
        let mut side = 0;
        while self.samples_left > 0 {
            self.samples_left -= 1;
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
        self.checker.edge_is_free(from, to, self.settings.margin)
    }

    fn is_free(&mut self, path: &[Vec<f64>]) -> bool {
        path.windows(2).all(|edge| self.edge_is_free(&edge[0], &edge[1]))
    }

    /// Replaces random stretches by straight lines, of all arms or of one arm alone, where that is free and shorter.
    fn shorten(&mut self, path: &mut Vec<Vec<f64>>, stream: &mut Stream) {
        let arms = self.world.arms.len();
        for _ in 0..self.settings.shortcut_iterations {
            if path.len() <= 2 {
                return;
            }
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
            let start_is_free = |this: &mut Self| this.checker.is_free(&stretch[0], this.settings.margin);
            if length(&candidate) < total - 1e-9 && start_is_free(self) && self.is_free(&stretch) {
                candidate.dedup();
                *path = candidate;
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

fn orders(items: &[usize]) -> Vec<Vec<usize>> {
    if items.is_empty() {
        return vec![Vec::new()];
    }
    let led_by = |i: usize| {
        let rest: Vec<usize> = items.iter().copied().filter(|&item| item != items[i]).collect();
        orders(&rest).into_iter().map(move |mut order| {
            order.insert(0, items[i]);
            order
        })
    };
    (0..items.len()).flat_map(led_by).collect()
}
