//! A chain prepared for many poses: stored starts, a bound of its reach, branches.

use super::{
    IkOutcome, IkSettings, outcome,
    reach::ReachBound,
    self_motion::{Curve, distance},
    stored::StoredStarts,
};
use crate::{
    damped_least_squares::{Attempt, Goal, Joints, MAX_JOINTS, Solver},
    geometry::Pose,
    kinematics::SerialChain,
    random::Stream,
};
use std::f64::consts::TAU;

/// Stored starts tried from the pose's own cell of the table.
const FIRST_STARTS: usize = 12;
/// Most iterations from a stored start: it is near already, or the way is blocked by a limit.
const FEW_ITERATIONS: usize = 20;
/// A seed whose tool is at most this far from the pose (m and rad together) goes before the stored starts.
const NEAR: f64 = 0.3;
/// Starts from which branches are looked for: stored ones, and random ones in the limits.
const BRANCH_STARTS: [usize; 2] = [160, 40];

/// One branch of the solutions of a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// Its configuration nearest to the seed (rad).
    pub joint_positions: Vec<f64>,
    /// Of a 7-joint chain, configurations along the whole branch at most 0.15 rad apart, each a solution (rad).
    pub path: Vec<Vec<f64>>,
    /// Whether the path closes on itself; otherwise limits end it.
    pub closed: bool,
}

/// Inverse kinematics of one chain of up to 8 joints. Answers are pure functions of chain, settings, pose and seed.
#[derive(Debug, Clone)]
pub struct InverseKinematics {
    chain: SerialChain,
    solver: Solver,
    stored: StoredStarts,
    reach: Option<ReachBound>,
}

impl InverseKinematics {
    /// Prepares `chain`, which takes some milliseconds. Panics if it has more than 8 joints or limits in the wrong order.
    pub fn new(chain: SerialChain, settings: &IkSettings) -> Self {
        let solver = Solver::new(&chain, settings);
        let (stored, reach) = (StoredStarts::new(&solver), ReachBound::new(&solver));
        Self { chain, solver, stored, reach }
    }

    /// The chain.
    pub fn chain(&self) -> &SerialChain {
        &self.chain
    }

    /// Angles that put the tool at `base_from_tool`, the first found: from stored starts, from `seed`, from random ones.
    ///
    /// A seed whose tool is already near goes first. Angles of the seed outside the limits are moved to them.
    /// Panics if `seed` does not fit the chain.
    pub fn solve(&self, base_from_tool: &Pose, seed: &[f64]) -> IkOutcome {
        let (goal, seed) = (Goal::new(base_from_tool), self.solver.joints(seed));
        let most = self.solver.settings.max_iterations;
        let away = self.solver.evaluate(&goal, &seed).0;
        let mut best = Attempt { q: seed, error: away, solved: false };
        if !away.iter().all(|x| x.is_finite()) {
            return self.verdict(&goal, &best);
        }
        let near = away.norm() < NEAR;
        if near && self.improve(&mut best, &goal, seed, most) {
            return self.verdict(&goal, &best);
        }
        let mut starts = [[0.0; MAX_JOINTS]; FIRST_STARTS];
        let count = self.stored.nearest(&self.solver, &goal, &mut starts);
        for (index, start) in starts.iter().take(count).enumerate() {
            if self.improve(&mut best, &goal, *start, FEW_ITERATIONS) {
                return self.verdict(&goal, &best);
            }
            if index == 0 && self.excluded(&goal) {
                return self.verdict(&goal, &best);
            }
        }
        if !near && self.improve(&mut best, &goal, seed, most) || self.excluded(&goal) {
            return self.verdict(&goal, &best);
        }
        let restarts = self.solver.settings.restarts;
        let around = self.stored.around(&self.solver, &goal, restarts / 2);
        let random = self.random_starts().take(restarts - around.len());
        for start in around.into_iter().chain(random) {
            if self.improve(&mut best, &goal, start, most) {
                break;
            }
        }
        self.verdict(&goal, &best)
    }

    /// The outcomes of [`Self::solve`] for each pose from one seed, whatever their order and number.
    pub fn solve_batch(&self, base_from_tools: &[Pose], seed: &[f64]) -> Vec<IkOutcome> {
        base_from_tools.iter().map(|pose| self.solve(pose, seed)).collect()
    }

    /// Like [`Self::solve`], but the solution nearest to `seed` (least Σ (qᵢ − seedᵢ)²) of all [`Self::branches`].
    pub fn nearest(&self, base_from_tool: &Pose, seed: &[f64]) -> IkOutcome {
        let (goal, joints) = (Goal::new(base_from_tool), self.solver.joints(seed));
        let Some(first) = self.curves(&goal, &joints).into_iter().next() else { return self.solve(base_from_tool, seed) };
        self.verdict(&goal, &Attempt { q: first.0, error: self.solver.evaluate(&goal, &first.0).0, solved: true })
    }

    /// All branches found of the solutions of a pose, the nearest to `seed` first; none if it was not reached.
    ///
    /// The solutions of a 7-joint arm form curves, cut to pieces by the limits; a branch is a piece. Pieces are looked for
    /// from 200 starts, so that a short one can be missed. With another number of joints every solution found that
    /// differs from the others is a branch of its own.
    pub fn branches(&self, base_from_tool: &Pose, seed: &[f64]) -> Vec<Branch> {
        let (goal, seed) = (Goal::new(base_from_tool), self.solver.joints(seed));
        let count = self.solver.count();
        let branch = |(q, curve): (Joints, Curve)| Branch {
            joint_positions: q[..count].to_vec(),
            path: curve.points.iter().map(|point| point[..count].to_vec()).collect(),
            closed: curve.closed,
        };
        self.curves(&goal, &seed).into_iter().map(branch).collect()
    }

    /// The branches with their points nearest to `seed`, the nearest first.
    fn curves(&self, goal: &Goal, seed: &Joints) -> Vec<(Joints, Curve)> {
        let error = self.solver.evaluate(goal, seed).0;
        if !error.iter().all(|x| x.is_finite()) || self.excluded(goal) {
            return Vec::new();
        }
        let mut curves: Vec<Curve> = Vec::new();
        let stored = self.stored.around(&self.solver, goal, BRANCH_STARTS[0]);
        let starts = [*seed].into_iter().chain(stored).chain(self.random_starts().take(BRANCH_STARTS[1]));
        for start in starts {
            let attempt = self.solver.descend(goal, start, self.solver.settings.max_iterations);
            if attempt.solved {
                self.collect(goal, attempt.q, &mut curves);
            }
        }
        let mut found = Vec::with_capacity(curves.len());
        for curve in curves {
            let near = curve.nearest(seed).0;
            let q = self.solver.approach(goal, &near, seed).unwrap_or(curve.points[0]);
            found.push((q, curve));
        }
        found.sort_by(|a, b| distance(&a.0, seed).total_cmp(&distance(&b.0, seed)));
        found
    }

    /// Adds the branch through the solution `q` unless it is known, and those that differ from it by whole turns of joints.
    fn collect(&self, goal: &Goal, q: Joints, curves: &mut Vec<Curve>) {
        let mut open = vec![q];
        while let Some(q) = open.pop() {
            if curves.iter().any(|curve| curve.holds(&q)) {
                continue;
            }
            let curve = self.solver.trace(goal, &q);
            for (i, limits) in self.solver.joints.iter().enumerate().filter(|(_, limits)| limits.upper - limits.lower >= TAU) {
                for turn in [-TAU, TAU] {
                    let inside = |q: &Joints| (limits.lower..=limits.upper).contains(&(q[i] + turn));
                    // one point of each stretch that the turn leaves inside the limits
                    let begins = (0..curve.points.len())
                        .filter(|&at| inside(&curve.points[at]) && (at == 0 || !inside(&curve.points[at - 1])));
                    open.extend(begins.map(|at| {
                        let mut turned = curve.points[at];
                        turned[i] += turn;
                        turned
                    }));
                }
            }
            curves.push(curve);
        }
    }

    /// Descends from `start` and keeps what is better than `best`; whether the pose is reached.
    fn improve(&self, best: &mut Attempt, goal: &Goal, start: Joints, most: usize) -> bool {
        let attempt = self.solver.descend(goal, start, most);
        if attempt.solved || attempt.error.norm() < best.error.norm() {
            *best = attempt;
        }
        best.solved
    }

    fn excluded(&self, goal: &Goal) -> bool {
        let IkSettings { position_tolerance, rotation_tolerance, .. } = self.solver.settings;
        self.reach.as_ref().is_some_and(|reach| reach.excludes(goal, position_tolerance, rotation_tolerance))
    }

    fn verdict(&self, goal: &Goal, best: &Attempt) -> IkOutcome {
        outcome(best, self.solver.count(), || self.excluded(goal))
    }

    fn random_starts(&self) -> impl Iterator<Item = Joints> {
        let mut stream = Stream::new(1, &[u64::from_le_bytes(*b"ikstarts")]);
        std::iter::repeat_with(move || self.solver.joints(&self.chain.sample(&mut stream)))
    }
}
