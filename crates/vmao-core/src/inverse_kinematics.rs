//! Inverse kinematics inside the joint limits: damped least squares from stored, given and random starts.

mod pieces;
mod prepared;
mod reach;
mod self_motion;
mod stored;

pub use prepared::{Branch, InverseKinematics};

use crate::{
    damped_least_squares::{Attempt, Goal, LIMIT_ZONE, PATIENCE, Solver},
    geometry::Pose,
    joint_path::largest_turn,
    kinematics::{ChainJoint, SerialChain},
    random::Stream,
};

/// When a solution is good enough and how long to look for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IkSettings {
    /// Greatest distance from the wanted position (m).
    pub position_tolerance: f64,
    /// Greatest angle from the wanted orientation (rad).
    pub rotation_tolerance: f64,
    /// Most iterations from one start.
    pub max_iterations: usize,
    /// Most random starts after the seed has failed.
    pub restarts: usize,
}

impl Default for IkSettings {
    fn default() -> Self {
        Self { position_tolerance: 1e-6, rotation_tolerance: 1e-6, max_iterations: 60, restarts: 300 }
    }
}

/// What the search found; every answer lies inside the joint limits.
#[derive(Debug, Clone, PartialEq)]
pub enum IkOutcome {
    /// Angles that reach the pose within the tolerances.
    Solved {
        /// The angles (rad).
        joint_positions: Vec<f64>,
        /// Distance left (m).
        position_error: f64,
        /// Angle left (rad).
        rotation_error: f64,
    },
    /// Nothing within the tolerances was found; there may be a solution.
    NoSolution {
        /// The best angles seen (rad).
        closest: Vec<f64>,
        /// Their distance from the wanted position (m).
        position_error: f64,
        /// Their angle from the wanted orientation (rad).
        rotation_error: f64,
    },
    /// It is proven that no configuration inside the limits reaches the pose within the tolerances.
    Unreachable {
        /// The best angles seen (rad).
        closest: Vec<f64>,
        /// Their distance from the wanted position (m).
        position_error: f64,
        /// Their angle from the wanted orientation (rad).
        rotation_error: f64,
    },
}

impl IkOutcome {
    /// The angles that solve it, if any.
    pub fn solution(&self) -> Option<&[f64]> {
        match self {
            Self::Solved { joint_positions, .. } => Some(joint_positions),
            Self::NoSolution { .. } | Self::Unreachable { .. } => None,
        }
    }
}

/// Up to `candidates` solutions from `seed` and from random starts, slid along their null spaces, without repetition.
///
/// Those of least [`posture_cost`] come first; a few, quickly, where [`InverseKinematics::branches`] looks for all.
/// Empty if the pose was not reached.
pub fn solutions(
    chain: &SerialChain,
    base_from_tool: &Pose,
    seed: &[f64],
    candidates: usize,
    settings: &IkSettings,
    stream: &mut Stream,
) -> Vec<Vec<f64>> {
    const DISTINCT: f64 = 0.1; // rad, of the most different joint
    let solver = Solver::new(chain, settings);
    let (goal, seed) = (Goal::new(base_from_tool), solver.joints(seed));
    let (mut start, mut found) = (seed, Vec::new());
    for _ in 0..=settings.restarts {
        let attempt = solver.descend(&goal, start, settings.max_iterations, PATIENCE);
        if attempt.solved {
            let settled = solver.settle(&goal, attempt, &seed).q;
            found.push((cost(&solver.joints, &settled, &seed), settled));
            if found.len() >= candidates {
                break;
            }
        }
        start = solver.joints(&chain.sample(stream));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<Vec<f64>> = Vec::new();
    for (_, q) in found {
        let q = &q[..solver.count()];
        if kept.iter().all(|other| largest_turn(other, q) > DISTINCT) {
            kept.push(q.to_vec());
        }
    }
    kept
}

/// Joint positions that take the tool through `poses` one after the other from `start`, without a jump.
///
/// No restarts: each pose is reached from the one before, moving no joint by more than `max_joint_step` (rad), while
/// the null space pulls every joint away from its limits. `Err(i)` names the first pose that was not reached so.
pub fn track(
    chain: &SerialChain,
    poses: &[Pose],
    start: &[f64],
    max_joint_step: f64,
    settings: &IkSettings,
) -> Result<Vec<Vec<f64>>, usize> {
    let solver = Solver::new(chain, settings);
    let mut q = solver.joints(start);
    let mut path = Vec::with_capacity(poses.len());
    for (index, pose) in poses.iter().enumerate() {
        let attempt = solver.follow(&Goal::new(pose), q, max_joint_step);
        let step = attempt.q.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if !attempt.solved || step > max_joint_step {
            return Err(index);
        }
        q = attempt.q;
        path.push(q[..solver.count()].to_vec());
    }
    Ok(path)
}

/// How far `q` is from `seed` and how near to its limits: Σ ((qᵢ − seedᵢ)/rᵢ)² + Σ max(0, |2(qᵢ − mᵢ)/rᵢ| − 0.8)² · 25.
///
/// rᵢ is the width of the limits and mᵢ their middle: a joint at its limit costs as much as one turned through its range.
pub fn posture_cost(chain: &SerialChain, q: &[f64], seed: &[f64]) -> f64 {
    cost(&chain.joints, q, seed)
}

pub(crate) fn cost(joints: &[ChainJoint], q: &[f64], seed: &[f64]) -> f64 {
    let cost = |((joint, &angle), &wanted): ((&ChainJoint, &f64), &f64)| {
        let (range, middle) = (joint.upper - joint.lower, (joint.upper + joint.lower) / 2.0);
        let crowding = ((2.0 * (angle - middle) / range).abs() - LIMIT_ZONE).max(0.0) / (1.0 - LIMIT_ZONE);
        ((angle - wanted) / range).powi(2) + crowding * crowding
    };
    joints.iter().zip(q).zip(seed).map(cost).sum()
}

/// What an attempt amounts to; `proven` says of one that failed whether nothing could have succeeded.
fn outcome(attempt: &Attempt, count: usize, proven: impl FnOnce() -> bool) -> IkOutcome {
    // sums of squares of far targets overflow, and an error is a number
    let size = |first: usize| {
        let [x, y, z] = [0, 1, 2].map(|i| attempt.error[first + i]);
        let norm = x.hypot(y).hypot(z);
        if norm.is_finite() { norm } else { f64::MAX }
    };
    let (closest, position_error, rotation_error) = (attempt.q[..count].to_vec(), size(0), size(3));
    if attempt.solved {
        IkOutcome::Solved { joint_positions: closest, position_error, rotation_error }
    } else if proven() {
        IkOutcome::Unreachable { closest, position_error, rotation_error }
    } else {
        IkOutcome::NoSolution { closest, position_error, rotation_error }
    }
}
