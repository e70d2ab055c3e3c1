//! A chain prepared for many poses: stored starts, a bound of its reach, branches.

use super::{
    IkOutcome, IkSettings, outcome,
    pieces::{Piece, pieces},
    reach::ReachBound,
    self_motion::{STRIDE, SelfMotion, distance},
    stored::StoredStarts,
};
use crate::{
    damped_least_squares::{Attempt, Goal, Joints, MAX_JOINTS, PATIENCE, Solver},
    geometry::Pose,
    kinematics::SerialChain,
    random::Stream,
};
use nalgebra::Vector6;

/// Stored starts tried from the pose's own cell of the table.
const FIRST_STARTS: usize = 12;
/// Most iterations from a stored start: it is near already, or the way is blocked by a limit.
const FEW_ITERATIONS: usize = 12;
/// Iterations without a tenth less error after which a stored start is given up.
const LITTLE_PATIENCE: usize = 1;
/// A seed whose tool is at most this far from the pose (m, and difference of the rotation matrices, together) goes before
/// the stored starts.
const NEAR: f64 = 0.3;
/// Pairs of angle intervals that a proof of unreachability looks at, at first and at most.
const FEW_CELLS: usize = 100;
const MOST_CELLS: usize = 20_000;
/// Stored starts, each followed by a random one, from which curves of solutions are looked for at most.
const CURVE_STARTS: usize = 300;
/// Solutions in a row that lie on curves known before, after which no further curve is looked for.
const ENOUGH: usize = 100;

/// One branch of the solutions of a pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// Its configuration nearest to the seed (rad).
    pub joint_positions: Vec<f64>,
    /// Of a 7-joint chain, solutions along the whole branch (rad), neighbours at most 0.15 apart, ends at most 0.03 from a limit.
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

/// A seed inside the limits and where it puts the tool.
struct Seed {
    q: Joints,
    tool: Goal,
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
        self.solve_from(&Goal::new(base_from_tool), &self.seed(seed))
    }

    /// The outcomes of [`Self::solve`] for each pose from one seed, whatever their order and number.
    pub fn solve_batch(&self, base_from_tools: &[Pose], seed: &[f64]) -> Vec<IkOutcome> {
        let seed = self.seed(seed);
        base_from_tools.iter().map(|pose| self.solve_from(&Goal::new(pose), &seed)).collect()
    }

    fn seed(&self, q: &[f64]) -> Seed {
        let q = self.solver.joints(q);
        Seed { q, tool: self.solver.tool(&q) }
    }

    fn solve_from(&self, goal: &Goal, seed: &Seed) -> IkOutcome {
        let most = self.solver.settings.max_iterations;
        let mut best = Attempt { q: seed.q, error: Vector6::repeat(f64::INFINITY), solved: false };
        if !goal.is_finite() {
            return self.verdict(goal, &best);
        }
        let near = (goal.position - seed.tool.position).norm() + (goal.rotation - seed.tool.rotation).norm() < NEAR;
        if near && self.improve(&mut best, goal, seed.q, most, PATIENCE) {
            return self.verdict(goal, &best);
        }
        let mut starts = [[0.0; MAX_JOINTS]; FIRST_STARTS];
        let count = self.stored.nearest(&self.solver, goal, &mut starts);
        if starts[..count].iter().any(|start| self.improve(&mut best, goal, *start, FEW_ITERATIONS, LITTLE_PATIENCE)) {
            return self.verdict(goal, &best);
        }
        // a hasty proof first: most poses out of reach are clearly so, and most others are solved by one start more
        if self.excluded(goal, FEW_CELLS) {
            return self.verdict(goal, &best);
        }
        let restarts = self.solver.settings.restarts;
        let around = self.stored.around(&self.solver, goal, restarts / 2);
        if around.iter().any(|start| self.improve(&mut best, goal, *start, FEW_ITERATIONS, LITTLE_PATIENCE)) {
            return self.verdict(goal, &best);
        }
        if !near && self.improve(&mut best, goal, seed.q, most, PATIENCE) || self.excluded(goal, MOST_CELLS) {
            return self.verdict(goal, &best);
        }
        self.random_starts().take(restarts - around.len()).any(|start| self.improve(&mut best, goal, start, most, PATIENCE));
        self.verdict(goal, &best)
    }

    /// Like [`Self::solve`], but the solution nearest to `seed` (least Σ (qᵢ − seedᵢ)²) of all [`Self::branches`].
    pub fn nearest(&self, base_from_tool: &Pose, seed: &[f64]) -> IkOutcome {
        let (goal, joints) = (Goal::new(base_from_tool), self.solver.joints(seed));
        let gaps: Vec<(Joints, f64)> = self.pieces(&goal, &joints).iter().map(|piece| piece.nearest(&joints)).collect();
        let least = gaps.iter().map(|gap| gap.1).fold(f64::INFINITY, f64::min);
        // a polyline can be nearer or further than its curve, by less than a stride
        let close = gaps.iter().filter(|gap| gap.1 <= least + STRIDE);
        let exact = close.filter_map(|(near, _)| self.solver.approach(&goal, near, &joints));
        match exact.min_by(|a, b| distance(a, &joints).total_cmp(&distance(b, &joints))) {
            Some(q) => self.verdict(&goal, &Attempt { q, error: self.solver.evaluate(&goal, &q).0, solved: true }),
            None => self.solve(base_from_tool, seed),
        }
    }

    /// All branches found of the solutions of a pose, the nearest to `seed` first; none if it was not reached.
    ///
    /// The solutions of a 7-joint arm form closed curves, which the limits cut to pieces; a branch is a piece. A curve is
    /// followed to its end, so that one solution on it leads to all its pieces; curves are looked for until 100 solutions
    /// in a row lie on known ones. A curve that few starts lead to can be missed, and where two curves nearly touch, branches
    /// can overlap. With another number of joints every
    /// solution found that differs from the others is a branch of its own.
    pub fn branches(&self, base_from_tool: &Pose, seed: &[f64]) -> Vec<Branch> {
        let (goal, seed) = (Goal::new(base_from_tool), self.solver.joints(seed));
        let count = self.solver.count();
        let nearest = |piece: Piece| {
            // a point alone would slide over the surface that it lies on to the one place nearest to the seed
            let slid = (piece.points.len() > 1).then(|| self.solver.approach(&goal, &piece.nearest(&seed).0, &seed)).flatten();
            (slid.unwrap_or(piece.points[0]), piece)
        };
        let mut found: Vec<(Joints, Piece)> = self.pieces(&goal, &seed).into_iter().map(nearest).collect();
        found.sort_by(|a, b| distance(&a.0, &seed).total_cmp(&distance(&b.0, &seed)));
        let branch = |(q, piece): (Joints, Piece)| Branch {
            joint_positions: q[..count].to_vec(),
            path: piece.points.iter().map(|point| point[..count].to_vec()).collect(),
            closed: piece.closed,
        };
        found.into_iter().map(branch).collect()
    }

    /// All pieces of the curves of solutions that were found.
    fn pieces(&self, goal: &Goal, seed: &Joints) -> Vec<Piece> {
        if !goal.is_finite() || self.excluded(goal, MOST_CELLS) {
            return Vec::new();
        }
        let (mut curves, mut found): (Vec<SelfMotion>, Vec<Piece>) = (Vec::new(), Vec::new());
        let mut stored = self.stored.around(&self.solver, goal, CURVE_STARTS).into_iter();
        let mixed = self.random_starts().take(CURVE_STARTS).flat_map(|random| stored.next().into_iter().chain([random]));
        let starts = [*seed].into_iter().chain(mixed);
        let mut unchanged = 0;
        for start in starts {
            if unchanged == ENOUGH {
                break;
            }
            let Attempt { q, solved, .. } = self.solver.descend(goal, start, self.solver.settings.max_iterations, PATIENCE);
            if !solved {
                continue;
            }
            unchanged += 1;
            if !curves.iter().any(|curve| curve.holds(&q)) {
                unchanged = 0;
                let mut curve = self.solver.trace(goal, &q);
                if curve.closure.is_none() {
                    // a walk that stuck at a singular place before is now taken from its other side
                    curve.points.retain(|point| !curves.iter().any(|known| known.holds(point)));
                }
                found.extend(pieces(&curve, &self.solver.joints));
                curves.push(curve);
            } else if !found.iter().any(|piece| piece.passes(&q)) {
                // so short a piece that the trace stepped over it
                found.push(Piece { points: vec![q], closed: false });
            }
        }
        found
    }

    /// Descends from `start` and keeps what is better than `best`; whether the pose is reached.
    fn improve(&self, best: &mut Attempt, goal: &Goal, start: Joints, most: usize, patience: usize) -> bool {
        let attempt = self.solver.descend(goal, start, most, patience);
        if attempt.solved || attempt.error.norm() < best.error.norm() {
            *best = attempt;
        }
        best.solved
    }

    /// Whether the pose is proven out of reach, looking at no more than `cells` pairs of angle intervals.
    fn excluded(&self, goal: &Goal, cells: usize) -> bool {
        let IkSettings { position_tolerance, rotation_tolerance, .. } = self.solver.settings;
        self.reach.as_ref().is_some_and(|reach| reach.excludes(goal, position_tolerance, rotation_tolerance, cells))
    }

    fn verdict(&self, goal: &Goal, best: &Attempt) -> IkOutcome {
        if best.error[0].is_finite() {
            return outcome(best, self.solver.count(), || self.excluded(goal, MOST_CELLS));
        }
        // nothing was tried, or squares overflowed
        let error = self.solver.evaluate(goal, &best.q).0;
        outcome(&Attempt { error, ..*best }, self.solver.count(), || self.excluded(goal, MOST_CELLS))
    }

    fn random_starts(&self) -> impl Iterator<Item = Joints> {
        let mut stream = Stream::new(1, &[u64::from_le_bytes(*b"ikstarts")]);
        std::iter::repeat_with(move || self.solver.joints(&self.chain.sample(&mut stream)))
    }
}
