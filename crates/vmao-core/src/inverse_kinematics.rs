//! Inverse kinematics inside the joint limits: damped least squares with an active set of limits, and restarts.
//!
//! The damping is that of Sugihara ("Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method",
//! IEEE T-RO 2011): proportional to the squared error, plus a small constant.

use crate::{
    geometry::{Pose, rotation_log},
    kinematics::SerialChain,
    random::Stream,
};
use nalgebra::{Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};

/// Most joints of a chain that this module solves; fixed so that the iteration does not allocate.
pub const MAX_JOINTS: usize = 8;

type Joints = [f64; MAX_JOINTS];

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
    /// Nothing within the tolerances was found.
    NoSolution {
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
            Self::NoSolution { .. } => None,
        }
    }
}

/// Angles that put the tool at `base_from_tool`: the first found, from `seed`, then from random starts in the limits.
///
/// Panics if `seed` does not fit the chain or the chain has more than [`MAX_JOINTS`] joints.
pub fn solve(chain: &SerialChain, base_from_tool: &Pose, seed: &[f64], settings: &IkSettings, stream: &mut Stream) -> IkOutcome {
    let solver = Solver::new(chain, seed, settings);
    let goal = Goal::new(base_from_tool);
    let mut best = solver.descend(&goal, solver.joints(seed));
    for _ in 0..settings.restarts {
        if best.solved {
            break;
        }
        let attempt = solver.descend(&goal, solver.joints(&chain.sample(stream)));
        if attempt.solved || attempt.error.norm() < best.error.norm() {
            best = attempt;
        }
    }
    solver.outcome(&best)
}

/// Like [`solve`], but of up to `candidates` solutions the one of least [`posture_cost`], each slid along its null space.
pub fn solve_nearest(
    chain: &SerialChain,
    base_from_tool: &Pose,
    seed: &[f64],
    candidates: usize,
    settings: &IkSettings,
    stream: &mut Stream,
) -> IkOutcome {
    let solver = Solver::new(chain, seed, settings);
    let goal = Goal::new(base_from_tool);
    let mut best: Option<(f64, Attempt)> = None;
    let mut closest = solver.descend(&goal, solver.joints(seed));
    let mut found = 0;
    let mut attempt = closest;
    for _ in 0..=settings.restarts {
        if attempt.solved {
            let settled = solver.settle(&goal, attempt, seed);
            let cost = posture_cost(chain, &settled.q[..solver.count], seed);
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, settled));
            }
            found += 1;
            if found >= candidates {
                break;
            }
        } else if attempt.error.norm() < closest.error.norm() {
            closest = attempt;
        }
        attempt = solver.descend(&goal, solver.joints(&chain.sample(stream)));
    }
    solver.outcome(&best.map_or(closest, |(_, attempt)| attempt))
}

/// How far `q` is from `seed` and how near to its limits: Σ ((qᵢ − seedᵢ)/rᵢ)² + Σ max(0, |2(qᵢ − mᵢ)/rᵢ| − 0.8)² · 25.
///
/// rᵢ is the width of the limits and mᵢ their middle: a joint at its limit costs as much as one turned through its range.
pub fn posture_cost(chain: &SerialChain, q: &[f64], seed: &[f64]) -> f64 {
    let cost = |((joint, &angle), &wanted): ((&crate::kinematics::ChainJoint, &f64), &f64)| {
        let (range, middle) = (joint.upper - joint.lower, (joint.upper + joint.lower) / 2.0);
        let crowding = ((2.0 * (angle - middle) / range).abs() - LIMIT_ZONE).max(0.0) / (1.0 - LIMIT_ZONE);
        ((angle - wanted) / range).powi(2) + crowding * crowding
    };
    chain.joints.iter().zip(q).zip(seed).map(cost).sum()
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
    let solver = Solver::new(chain, start, settings);
    let mut q = solver.joints(start);
    let mut path = Vec::with_capacity(poses.len());
    for (index, pose) in poses.iter().enumerate() {
        let attempt = solver.follow(&Goal::new(pose), q, max_joint_step);
        let step = attempt.q.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if !attempt.solved || step > max_joint_step {
            return Err(index);
        }
        q = attempt.q;
        path.push(q[..solver.count].to_vec());
    }
    Ok(path)
}

/// Share of the half range from the middle of the limits at which a joint begins to feel them.
const LIMIT_ZONE: f64 = 0.8;
/// Constant part of the damping (m², rad²): small against the error's own share until it is nearly gone.
const LEAST_DAMPING: f64 = 1e-8;
/// Longest step of one joint in one iteration (rad): beyond it the linear model says nothing.
const LONGEST_STEP: f64 = 1.0;
/// Iterations without a tenth less error after which a start is given up.
const PATIENCE: usize = 8;

struct Goal {
    position: Vector3<f64>,
    rotation: Matrix3<f64>,
}

impl Goal {
    fn new(pose: &Pose) -> Self {
        Self { position: pose.translation.vector, rotation: *pose.rotation.to_rotation_matrix().matrix() }
    }
}

#[derive(Clone, Copy)]
struct Attempt {
    q: Joints,
    error: Vector6<f64>,
    solved: bool,
}

struct Solver<'a> {
    chain: &'a SerialChain,
    settings: &'a IkSettings,
    count: usize,
    /// Fixed transforms before each joint, and after the last: rotation and translation.
    fixed: [(Matrix3<f64>, Vector3<f64>); MAX_JOINTS + 1],
}

impl<'a> Solver<'a> {
    fn new(chain: &'a SerialChain, seed: &[f64], settings: &'a IkSettings) -> Self {
        assert!(chain.len() <= MAX_JOINTS, "a chain of {} joints, at most {MAX_JOINTS} are solved", chain.len());
        assert_eq!(seed.len(), chain.len(), "one angle per joint");
        let mut fixed = [(Matrix3::identity(), Vector3::zeros()); MAX_JOINTS + 1];
        let poses = chain.joints.iter().map(|joint| &joint.parent_from_joint).chain([&chain.last_from_tool]);
        for (slot, pose) in fixed.iter_mut().zip(poses) {
            *slot = (*pose.rotation.to_rotation_matrix().matrix(), pose.translation.vector);
        }
        Self { chain, settings, count: chain.len(), fixed }
    }

    fn joints(&self, q: &[f64]) -> Joints {
        let mut joints = [0.0; MAX_JOINTS];
        for (slot, (joint, &angle)) in joints.iter_mut().zip(self.chain.joints.iter().zip(q)) {
            *slot = angle.clamp(joint.lower, joint.upper);
        }
        joints
    }

    /// Error (goal − tool, linear then angular) and the Jacobian's columns at `q`.
    fn evaluate(&self, goal: &Goal, q: &Joints) -> (Vector6<f64>, [Vector6<f64>; MAX_JOINTS]) {
        let mut rotation = Matrix3::identity();
        let mut position = Vector3::zeros();
        let (mut axes, mut origins) = ([Vector3::zeros(); MAX_JOINTS], [Vector3::zeros(); MAX_JOINTS]);
        for i in 0..self.count {
            position += rotation * self.fixed[i].1;
            rotation *= self.fixed[i].0;
            (axes[i], origins[i]) = (rotation.column(2).into_owned(), position);
            let (sine, cosine) = q[i].sin_cos();
            let (x, y) = (rotation.column(0).into_owned(), rotation.column(1).into_owned());
            rotation.set_column(0, &(x * cosine + y * sine));
            rotation.set_column(1, &(y * cosine - x * sine));
        }
        position += rotation * self.fixed[self.count].1;
        rotation *= self.fixed[self.count].0;
        let mut columns = [Vector6::zeros(); MAX_JOINTS];
        for i in 0..self.count {
            let linear = axes[i].cross(&(position - origins[i]));
            columns[i] = Vector6::new(linear.x, linear.y, linear.z, axes[i].x, axes[i].y, axes[i].z);
        }
        let turn = Rotation3::from_matrix_unchecked(goal.rotation * rotation.transpose());
        let (linear, angular) = (goal.position - position, rotation_log(&UnitQuaternion::from_rotation_matrix(&turn)));
        (Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z), columns)
    }

    fn within(&self, error: &Vector6<f64>) -> bool {
        error.fixed_rows::<3>(0).norm() <= self.settings.position_tolerance
            && error.fixed_rows::<3>(3).norm() <= self.settings.rotation_tolerance
    }

    /// The damped step Jᵀ(JJᵀ + λ)⁻¹(e − Jz) + z over the joints that their limits do not stop; z is the wish of the null space.
    fn step(&self, q: &Joints, error: &Vector6<f64>, columns: &[Vector6<f64>; MAX_JOINTS], wish: &Joints) -> Joints {
        let damping = 0.5 * error.norm_squared() + LEAST_DAMPING;
        let mut free = [true; MAX_JOINTS];
        let mut step = [0.0; MAX_JOINTS];
        for _ in 0..self.count {
            let mut normal = Matrix6::identity() * damping;
            let mut residual = *error;
            for i in (0..self.count).filter(|&i| free[i]) {
                normal.ger(1.0, &columns[i], &columns[i], 1.0);
                residual -= columns[i] * wish[i];
            }
            let Some(factor) = normal.cholesky() else { return [0.0; MAX_JOINTS] };
            let weights = factor.solve(&residual);
            let mut stopped = false;
            for i in 0..self.count {
                let limits = &self.chain.joints[i];
                step[i] = if free[i] { columns[i].dot(&weights) + wish[i] } else { 0.0 };
                if (step[i] > 0.0 && q[i] >= limits.upper) || (step[i] < 0.0 && q[i] <= limits.lower) {
                    (free[i], stopped) = (false, true);
                    step[i] = 0.0;
                }
            }
            if !stopped {
                break;
            }
        }
        let longest = step.iter().fold(LONGEST_STEP, |most, s| most.max(s.abs()));
        step.map(|s| s * LONGEST_STEP / longest)
    }

    fn advance(&self, q: &Joints, step: &Joints) -> Joints {
        let mut moved = *q;
        for (i, limits) in self.chain.joints.iter().enumerate() {
            moved[i] = (q[i] + step[i]).clamp(limits.lower, limits.upper);
        }
        moved
    }

    /// Follows the damped step from one start until solved, out of iterations or out of patience.
    fn descend(&self, goal: &Goal, start: Joints) -> Attempt {
        let mut q = start;
        let mut best = Attempt { q, error: Vector6::repeat(f64::INFINITY), solved: false };
        let (mut mark, mut waited) = (f64::INFINITY, 0);
        for _ in 0..=self.settings.max_iterations {
            let (error, columns) = self.evaluate(goal, &q);
            let size = error.norm();
            if size < best.error.norm() {
                best = Attempt { q, error, solved: self.within(&error) };
            }
            if best.solved {
                break;
            }
            waited += 1;
            if size < 0.9 * mark {
                (mark, waited) = (size, 0);
            } else if waited > PATIENCE {
                break;
            }
            q = self.advance(&q, &self.step(&q, &error, &columns, &[0.0; MAX_JOINTS]));
        }
        best
    }

    /// From a solution, slides along the null space to a solution of lower [`posture_cost`].
    fn settle(&self, goal: &Goal, start: Attempt, seed: &[f64]) -> Attempt {
        const ITERATIONS: usize = 40;
        let mut best = start;
        let mut least = posture_cost(self.chain, &best.q[..self.count], seed);
        let mut q = start.q;
        for _ in 0..ITERATIONS {
            let (error, columns) = self.evaluate(goal, &q);
            let cost = posture_cost(self.chain, &q[..self.count], seed);
            if self.within(&error) && cost < least {
                (best, least) = (Attempt { q, error, solved: true }, cost);
            }
            let mut wish = [0.0; MAX_JOINTS];
            for (i, limits) in self.chain.joints.iter().enumerate() {
                wish[i] = 0.3 * (seed[i] - q[i]) + self.repulsion(i, q[i]) * (limits.upper - limits.lower) * 0.1;
            }
            // far from the pose the wish only gets in the way
            let calm = if error.norm() < 0.02 { 1.0 } else { 0.0 };
            q = self.advance(&q, &self.step(&q, &error, &columns, &wish.map(|w| (w * calm).clamp(-0.1, 0.1))));
        }
        // the last point slid to is rarely exact: finish it, and keep it if it is better
        let last = self.descend(goal, q);
        if last.solved && posture_cost(self.chain, &last.q[..self.count], seed) < least { last } else { best }
    }

    /// Direction and strength, in [−1, 1], in which joint `i` at `angle` is pushed by the limit it is near to.
    fn repulsion(&self, i: usize, angle: f64) -> f64 {
        let limits = &self.chain.joints[i];
        let half = (limits.upper - limits.lower) / 2.0;
        let place = (angle - (limits.upper + limits.lower) / 2.0) / half;
        -place.signum() * ((place.abs() - LIMIT_ZONE).max(0.0) / (1.0 - LIMIT_ZONE))
    }

    /// From `start` to a near pose, leaning away from the limits by at most a third of `max_joint_step`.
    fn follow(&self, goal: &Goal, start: Joints, max_joint_step: f64) -> Attempt {
        let mut q = start;
        let mut wish = [0.0; MAX_JOINTS];
        for i in 0..self.count {
            let width = self.chain.joints[i].upper - self.chain.joints[i].lower;
            wish[i] = (self.repulsion(i, q[i]) * width * 0.02).clamp(-max_joint_step / 3.0, max_joint_step / 3.0);
        }
        let (error, columns) = self.evaluate(goal, &q);
        q = self.advance(&q, &self.step(&q, &error, &columns, &wish));
        self.descend(goal, q)
    }

    fn outcome(&self, attempt: &Attempt) -> IkOutcome {
        let joint_positions = attempt.q[..self.count].to_vec();
        let position_error = attempt.error.fixed_rows::<3>(0).norm();
        let rotation_error = attempt.error.fixed_rows::<3>(3).norm();
        if attempt.solved {
            IkOutcome::Solved { joint_positions, position_error, rotation_error }
        } else {
            IkOutcome::NoSolution { closest: joint_positions, position_error, rotation_error }
        }
    }
}
