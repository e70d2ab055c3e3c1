//! Motion planning for all arms together: straight line, one arm at a time, then RRT-Connect, then shortcuts.
//!
//! RRT-Connect is Kuffner & LaValle, ICRA 2000, in the joint space of all arms at once. Edges are checked at
//! `PlanSettings::step`; a finished path is checked again five times finer, and planned anew at a finer step if it fails.

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
    /// Most any joint turns between two collision checks while planning (rad); the result is checked five times finer.
    pub step: f64,
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
        let (step, extension, margin) = (0.05, 0.6, 0.005);
        Self { step, extension, max_iterations: 20_000, shortcut_iterations: 150, margin, frozen_arms: Vec::new() }
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
    /// The start or the goal is outside the joint limits.
    OutOfLimits,
    /// No path was found in `max_iterations` samples; this does not say that there is none.
    BudgetExhausted,
}

impl fmt::Display for PlanFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StartInCollision(pair) => write!(f, "at the start, {pair}"),
            Self::GoalInCollision(pair) => write!(f, "at the end, {pair}"),
            Self::OutOfLimits => write!(f, "start or end outside the joint limits"),
            Self::BudgetExhausted => write!(f, "no path within the budget of samples"),
        }
    }
}

/// A collision-free path of all arms from `start` to `goal` (flat, arm after arm, rad).
///
/// A frozen arm stays at its start whatever the goal says. Panics if `start` or `goal` has not one angle per joint.
pub fn plan(world: &CollisionWorld, start: &[f64], goal: &[f64], settings: &PlanSettings, stream: &mut Stream) -> PlanOutcome {
    let mut planner = Planner::new(world, settings);
    assert!(start.len() == planner.free.len() && goal.len() == start.len(), "one angle per joint of all arms");
    let goal: Vec<f64> = (0..start.len()).map(|i| if planner.free[i] { goal[i] } else { start[i] }).collect();
    if !world.within_limits(start) || !world.within_limits(&goal) {
        return PlanOutcome::Failed(PlanFailure::OutOfLimits);
    }
    if let Some(pair) = planner.checker.check(start, settings.margin) {
        return PlanOutcome::Failed(PlanFailure::StartInCollision(pair));
    }
    if let Some(pair) = planner.checker.check(&goal, settings.margin) {
        return PlanOutcome::Failed(PlanFailure::GoalInCollision(pair));
    }
    let finest = settings.step / FINER;
    for step in [settings.step, settings.step / 2.0, finest] {
        planner.step = step;
        let Some(mut path) = planner.find(start, &goal, stream) else { break };
        planner.shorten(&mut path, stream);
        planner.step = finest;
        if step == finest || planner.is_free(&path) {
            return PlanOutcome::Path(path);
        }
    }
    PlanOutcome::Failed(PlanFailure::BudgetExhausted)
}

/// The first edge of `path` that comes closer to a collision than the margin, and what collides there.
///
/// For paths made elsewhere, such as tracked lines of the tool; checked at a fifth of `settings.step`, like plans.
/// Panics if a waypoint has not one angle per joint.
pub fn first_collision(world: &CollisionWorld, path: &[Vec<f64>], settings: &PlanSettings) -> Option<(usize, CollisionPair)> {
    let mut checker = CollisionChecker::with_frozen(world, &settings.frozen_arms);
    if let Some(pair) = path.first().and_then(|start| checker.check(start, settings.margin)) {
        return Some((0, pair));
    }
    path.windows(2).enumerate().find_map(|(edge, ends)| {
        let count = (largest_turn(&ends[0], &ends[1]) / settings.step * FINER).ceil().max(1.0) as usize;
        (1..=count).find_map(|i| {
            let pair = checker.check(&blend(&ends[0], &ends[1], i as f64 / count as f64), settings.margin)?;
            Some((edge, pair))
        })
    })
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

/// How many times finer than `PlanSettings::step` a finished path is checked.
const FINER: f64 = 5.0;

struct Planner<'a> {
    world: &'a CollisionWorld,
    settings: &'a PlanSettings,
    checker: CollisionChecker<'a>,
    step: f64,
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
            step: settings.step,
            samples_left: settings.max_iterations,
            free: arms().map(|(arm, _)| !settings.frozen_arms.contains(&arm)).collect(),
            arm_of: arms().map(|(arm, _)| arm).collect(),
            limits: arms().map(|(_, joint)| [joint.lower, joint.upper]).collect(),
        }
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

    /// Whether the straight line is free at the present step, its start excepted; middles first, they fail soonest.
    fn edge_is_free(&mut self, from: &[f64], to: &[f64]) -> bool {
        let count = (largest_turn(from, to) / self.step).ceil().max(1.0) as u32;
        let bits = u32::BITS - count.leading_zeros();
        (0..1_u32 << bits).map(|i| i.reverse_bits() >> (u32::BITS - bits)).filter(|i| (1..=count).contains(i)).all(|i| {
            let q = if i == count { to.to_vec() } else { blend(from, to, f64::from(i) / f64::from(count)) };
            self.checker.is_free(&q, self.settings.margin)
        })
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
