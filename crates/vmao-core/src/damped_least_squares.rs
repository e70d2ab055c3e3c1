//! One descent of inverse kinematics: damped least squares with an active set of joint limits.
//!
//! The damping is that of Sugihara ("Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method",
//! IEEE T-RO 2011): proportional to the squared error, plus a small constant. No iteration allocates.

use crate::{
    geometry::{Pose, rotation_log},
    inverse_kinematics::{IkSettings, cost},
    kinematics::{ChainJoint, SerialChain},
    small_systems::{NormalEquations, sines_cosines},
};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3, Vector6};

/// Most joints of a chain that inverse kinematics solves; fixed so that the iteration does not allocate.
pub(crate) const MAX_JOINTS: usize = 8;

/// The angles of a chain, unused places at zero.
pub(crate) type Joints = [f64; MAX_JOINTS];

/// Share of the half range from the middle of the limits at which a joint begins to feel them.
pub(crate) const LIMIT_ZONE: f64 = 0.8;
/// Share of the squared error in the damping.
const DAMPING: f64 = 0.1;
/// Constant part of the damping (m², rad²): small against the error's own share until it is nearly gone.
const LEAST_DAMPING: f64 = 1e-8;
/// Longest step of one joint in one iteration (rad): beyond it the linear model says nothing.
const LONGEST_STEP: f64 = 1.0;
/// Iterations without a tenth less error after which a start is given up, where nothing says that it is near.
pub(crate) const PATIENCE: usize = 8;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Goal {
    pub(crate) position: Vector3<f64>,
    pub(crate) rotation: Matrix3<f64>,
}

impl Goal {
    pub(crate) fn new(pose: &Pose) -> Self {
        Self { position: pose.translation.vector, rotation: *pose.rotation.to_rotation_matrix().matrix() }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position.iter().chain(self.rotation.iter()).all(|x| x.is_finite())
    }
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Attempt {
    pub(crate) q: Joints,
    pub(crate) error: Vector6<f64>,
    pub(crate) solved: bool,
}

/// Rotation and translation of a fixed transform.
pub(crate) type Fixed = (Matrix3<f64>, Vector3<f64>);

/// A chain as the iteration wants it.
#[derive(Debug, Clone)]
pub(crate) struct Solver {
    pub(crate) settings: IkSettings,
    pub(crate) joints: Vec<ChainJoint>,
    /// Fixed transforms before each joint, and after the last.
    pub(crate) fixed: [Fixed; MAX_JOINTS + 1],
}

/// Where the tool is, and each joint's axis and a point on it.
struct Placed {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    axes: [Vector3<f64>; MAX_JOINTS],
    origins: [Vector3<f64>; MAX_JOINTS],
}

impl Solver {
    pub(crate) fn new(chain: &SerialChain, settings: &IkSettings) -> Self {
        assert!(chain.len() <= MAX_JOINTS, "a chain of {} joints, at most {MAX_JOINTS} are solved", chain.len());
        let mut fixed = [(Matrix3::identity(), Vector3::zeros()); MAX_JOINTS + 1];
        let poses = chain.joints.iter().map(|joint| &joint.parent_from_joint).chain([&chain.last_from_tool]);
        for (slot, pose) in fixed.iter_mut().zip(poses) {
            *slot = (*pose.rotation.to_rotation_matrix().matrix(), pose.translation.vector);
        }
        Self { settings: *settings, joints: chain.joints.clone(), fixed }
    }

    pub(crate) fn count(&self) -> usize {
        self.joints.len()
    }

    /// The angles inside the limits; one that is not a number becomes the middle of its limits.
    pub(crate) fn joints(&self, q: &[f64]) -> Joints {
        assert_eq!(q.len(), self.count(), "one angle per joint");
        let mut joints = [0.0; MAX_JOINTS];
        for (slot, (joint, &angle)) in joints.iter_mut().zip(self.joints.iter().zip(q)) {
            let angle = if angle.is_nan() { (joint.lower + joint.upper) / 2.0 } else { angle };
            *slot = angle.clamp(joint.lower, joint.upper);
        }
        joints
    }

    fn place(&self, q: &Joints) -> Placed {
        let mut rotation = Matrix3::identity();
        let mut position = Vector3::zeros();
        let (mut axes, mut origins) = ([Vector3::zeros(); MAX_JOINTS], [Vector3::zeros(); MAX_JOINTS]);
        let (sines, cosines) = sines_cosines(q);
        for i in 0..self.count() {
            position += rotation * self.fixed[i].1;
            rotation *= self.fixed[i].0;
            (axes[i], origins[i]) = (rotation.column(2).into_owned(), position);
            let (sine, cosine) = (sines[i], cosines[i]);
            let (x, y) = (rotation.column(0).into_owned(), rotation.column(1).into_owned());
            rotation.set_column(0, &(x * cosine + y * sine));
            rotation.set_column(1, &(y * cosine - x * sine));
        }
        position += rotation * self.fixed[self.count()].1;
        rotation *= self.fixed[self.count()].0;
        Placed { rotation, position, axes, origins }
    }

    /// The pose that `q` reaches.
    pub(crate) fn tool(&self, q: &Joints) -> Goal {
        let Placed { rotation, position, .. } = self.place(q);
        Goal { position, rotation }
    }

    /// Rotation and origin of the last link.
    pub(crate) fn last_link(&self, q: &Joints) -> Fixed {
        let placed = self.place(q);
        (placed.rotation * self.fixed[self.count()].0.transpose(), placed.origins[self.count() - 1])
    }

    /// Error (goal − tool, linear then angular) and the Jacobian's columns at `q`.
    pub(crate) fn evaluate(&self, goal: &Goal, q: &Joints) -> (Vector6<f64>, [Vector6<f64>; MAX_JOINTS]) {
        let Placed { rotation, position, axes, origins } = self.place(q);
        let mut columns = [Vector6::zeros(); MAX_JOINTS];
        for i in 0..self.count() {
            let linear = axes[i].cross(&(position - origins[i]));
            columns[i] = Vector6::new(linear.x, linear.y, linear.z, axes[i].x, axes[i].y, axes[i].z);
        }
        let (linear, angular) = (goal.position - position, turn_between(&rotation, &goal.rotation));
        (Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z), columns)
    }

    pub(crate) fn within(&self, error: &Vector6<f64>) -> bool {
        error.fixed_rows::<3>(0).norm() <= self.settings.position_tolerance
            && error.fixed_rows::<3>(3).norm() <= self.settings.rotation_tolerance
    }

    /// The damped step Jᵀ(JJᵀ + λ)⁻¹(e − Jz) + z over the joints that their limits do not stop; z is the wish of the null space.
    pub(crate) fn step(&self, q: &Joints, error: &Vector6<f64>, columns: &[Vector6<f64>; MAX_JOINTS], wish: &Joints) -> Joints {
        let damping = DAMPING * error.norm_squared() + LEAST_DAMPING;
        let mut free = [true; MAX_JOINTS];
        let mut step = [0.0; MAX_JOINTS];
        for _ in 0..self.count() {
            let mut residual = *error;
            for i in (0..self.count()).filter(|&i| free[i]) {
                residual -= columns[i] * wish[i];
            }
            let moving = (0..self.count()).filter(|&i| free[i]).map(|i| &columns[i]);
            let Some(normal) = NormalEquations::new(moving, damping) else { return [0.0; MAX_JOINTS] };
            let weights = normal.solve(&residual);
            let mut stopped = false;
            for (i, limits) in self.joints.iter().enumerate() {
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

    pub(crate) fn advance(&self, q: &Joints, step: &Joints) -> Joints {
        let mut moved = *q;
        for (i, limits) in self.joints.iter().enumerate() {
            moved[i] = (q[i] + step[i]).clamp(limits.lower, limits.upper);
        }
        moved
    }

    /// Follows the damped step from one start until solved, after `most` iterations or out of patience.
    pub(crate) fn descend(&self, goal: &Goal, start: Joints, most: usize, patience: usize) -> Attempt {
        let mut q = start;
        let mut best = Attempt { q, error: Vector6::repeat(f64::INFINITY), solved: false };
        let (mut mark, mut waited) = (f64::INFINITY, 0);
        for _ in 0..=most {
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
            } else if waited > patience {
                break;
            }
            q = self.advance(&q, &self.step(&q, &error, &columns, &[0.0; MAX_JOINTS]));
        }
        best
    }

    /// From a solution, slides along the null space to a solution of lower cost.
    pub(crate) fn settle(&self, goal: &Goal, start: Attempt, seed: &Joints) -> Attempt {
        const ITERATIONS: usize = 40;
        const STILL: f64 = 1e-3; // rad
        let cost = |q: &Joints| cost(&self.joints, q, seed);
        let mut best = start;
        let mut least = cost(&best.q);
        let mut q = start.q;
        for _ in 0..ITERATIONS {
            let (error, columns) = self.evaluate(goal, &q);
            let here = cost(&q);
            if self.within(&error) && here < least {
                (best, least) = (Attempt { q, error, solved: true }, here);
            }
            let mut wish = [0.0; MAX_JOINTS];
            for (i, limits) in self.joints.iter().enumerate() {
                wish[i] = 0.3 * (seed[i] - q[i]) + self.repulsion(i, q[i]) * (limits.upper - limits.lower) * 0.1;
            }
            // far from the pose the wish only gets in the way
            let calm = if error.norm() < 0.02 { 1.0 } else { 0.0 };
            let moved = self.advance(&q, &self.step(&q, &error, &columns, &wish.map(|w| (w * calm).clamp(-0.1, 0.1))));
            let turn = moved.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            q = moved;
            if turn < STILL {
                break;
            }
        }
        // the last point slid to is rarely exact: finish it, and keep it if it is better
        let last = self.descend(goal, q, self.settings.max_iterations, PATIENCE);
        if last.solved && cost(&last.q) < least { last } else { best }
    }

    /// Direction and strength, in [−1, 1], in which joint `i` at `angle` is pushed by the limit it is near to.
    fn repulsion(&self, i: usize, angle: f64) -> f64 {
        let limits = &self.joints[i];
        let half = (limits.upper - limits.lower) / 2.0;
        let place = (angle - (limits.upper + limits.lower) / 2.0) / half;
        -place.signum() * ((place.abs() - LIMIT_ZONE).max(0.0) / (1.0 - LIMIT_ZONE))
    }

    /// From `start` to a near pose, leaning away from the limits by at most a third of `max_joint_step`.
    pub(crate) fn follow(&self, goal: &Goal, start: Joints, max_joint_step: f64) -> Attempt {
        let mut q = start;
        let mut wish = [0.0; MAX_JOINTS];
        for (i, limits) in self.joints.iter().enumerate() {
            let width = limits.upper - limits.lower;
            wish[i] = (self.repulsion(i, q[i]) * width * 0.02).clamp(-max_joint_step / 3.0, max_joint_step / 3.0);
        }
        let (error, columns) = self.evaluate(goal, &q);
        q = self.advance(&q, &self.step(&q, &error, &columns, &wish));
        self.descend(goal, q, self.settings.max_iterations, PATIENCE)
    }
}

/// The rotation vector that turns the frame `from` to the frame `to`, in the frame that both are given in.
fn turn_between(from: &Matrix3<f64>, to: &Matrix3<f64>) -> Vector3<f64> {
    const NEARLY_HALF: f64 = -0.9;
    // twice the sine times the axis, and twice the cosine plus one
    let (mut axis, mut trace) = (Vector3::zeros(), 0.0);
    for (a, b) in from.column_iter().zip(to.column_iter()) {
        axis += a.cross(&b);
        trace += a.dot(&b);
    }
    let (sine, cosine) = (axis.norm() / 2.0, (trace - 1.0) / 2.0);
    if cosine < NEARLY_HALF {
        let turn = Rotation3::from_matrix_unchecked(to * from.transpose());
        return rotation_log(&UnitQuaternion::from_rotation_matrix(&turn));
    }
    if sine < 0.05 && cosine > 0.0 {
        // the arcsine's series, of which the first term left out is below 1e-12
        let square = sine * sine;
        return axis * (0.5 + square * (1.0 / 12.0 + square * (3.0 / 80.0 + square * (5.0 / 224.0 + square * (35.0 / 2304.0)))));
    }
    axis * (sine.atan2(cosine) / (2.0 * sine))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation_exp;
    use std::f64::consts::PI;

    #[test]
    fn the_turn_between_two_frames_is_the_logarithm_of_their_quotient() {
        let from = rotation_exp(&Vector3::new(0.3, -1.1, 0.7));
        for angle in [0.0, 1e-300, 1e-9, 0.04999, 0.05001, 1.0, 2.6, 2.7, 3.1, PI - 1e-9] {
            let turn = Vector3::new(0.36, -0.48, 0.8) * angle;
            let to = rotation_exp(&turn) * from;
            let [from, to] = [from, to].map(|frame| *frame.to_rotation_matrix().matrix());
            let found = turn_between(&from, &to);
            assert!((found - turn).norm() < 1e-9 * angle + 1e-15, "{angle}: {found}");
        }
    }
}
