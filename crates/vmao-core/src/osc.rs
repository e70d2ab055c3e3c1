//! Operational space control: joint torques that track a gripper target with the arm's own inertia cancelled.

use crate::geometry::{Pose, rotation_log};
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};
use serde::{Deserialize, Serialize};

/// Number of joints of the arms we control.
pub const JOINTS: usize = 7;

/// A vector over the arm's joints.
pub type JointVector = SVector<f64, JOINTS>;
/// The tool's Jacobian: linear rows, then angular, world frame.
pub type Jacobian = SMatrix<f64, 6, JOINTS>;
/// The joint-space mass matrix.
pub type MassMatrix = SMatrix<f64, JOINTS, JOINTS>;

/// Gains. They are accelerations per error: the task inertia turns them into forces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OscGains {
    /// Linear stiffness (1/s²).
    pub position_stiffness: f64,
    /// Angular stiffness (1/s²).
    pub rotation_stiffness: f64,
    /// Damping ratio of both (–).
    pub damping_ratio: f64,
    /// Null-space posture stiffness (1/s²), critically damped.
    pub posture_stiffness: f64,
    /// Added to the diagonal of J M⁻¹ Jᵀ (1/kg) at a singular pose, so that the arm stays bounded.
    pub singularity_damping: f64,
    /// How near to a singular pose the damping begins, as 1 / tr (J M⁻¹ Jᵀ)⁻¹ (1/kg).
    pub singularity_onset: f64,
    /// The position error that is acted on at most (m): a far target pulls no harder than this.
    pub max_position_error: f64,
    /// The rotation error that is acted on at most (rad).
    pub max_rotation_error: f64,
}

/// Rate at which speed beyond a joint's limit is taken away (1/s): within a few ticks, but not within one.
const SPEED_LIMIT_DAMPING: f64 = 100.0;

/// What an arm's joints can bear.
#[derive(Debug, Clone)]
pub struct JointLimits {
    /// Largest torques (N·m).
    pub torque: JointVector,
    /// Largest speeds (rad/s).
    pub velocity: JointVector,
}

/// What an arm is doing now.
#[derive(Debug, Clone)]
pub struct ArmState {
    /// Joint positions (rad).
    pub q: JointVector,
    /// Joint velocities (rad/s).
    pub qd: JointVector,
    /// World pose of the tool.
    pub world_from_tool: Pose,
    /// Jacobian of the tool, world frame.
    pub jacobian: Jacobian,
    /// Mass matrix (kg·m²).
    pub mass: MassMatrix,
    /// Gravity, Coriolis and centrifugal torques (N·m).
    pub bias: JointVector,
}

/// Where a gripper shall be and how it shall move.
#[derive(Debug, Clone)]
pub struct GripperGoal {
    /// World pose of the tool.
    pub world_from_tool: Pose,
    /// Its twist, world frame: linear (m/s), then angular (rad/s).
    pub twist: Vector6<f64>,
    /// The joint positions the null space is drawn to (rad).
    pub posture: JointVector,
}

/// Linear-then-angular error from `current` to `goal`, world frame (m, rad).
pub fn pose_error(goal: &Pose, current: &Pose) -> Vector6<f64> {
    let linear = goal.translation.vector - current.translation.vector;
    let angular = rotation_log(&(goal.rotation * current.rotation.inverse()));
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// Joint torques (N·m) that drive the tool toward `goal`, within the joints' limits.
///
/// τ = Jᵀ Λ (K e + D (v* − J q̇)) + Nᵀ M (k (q₀ − q) − d q̇) + h,  Λ = (J M⁻¹ Jᵀ)⁻¹,  N = I − M⁻¹ Jᵀ Λ J
/// (Khatib 1987). `e`, `v*` are linear then angular in the world frame. Near a singular pose Λ is damped.
/// A joint beyond its speed limit is slowed whatever the task wants. When a torque limit is met all but the bias is scaled
/// together, so that the direction of the motion is kept.
pub fn torques(gains: &OscGains, state: &ArmState, goal: &GripperGoal, limits: &JointLimits) -> JointVector {
    let mut error = pose_error(&goal.world_from_tool, &state.world_from_tool);
    clamp_norm(&mut error, 0, gains.max_position_error);
    clamp_norm(&mut error, 3, gains.max_rotation_error);
    let velocity_error = goal.twist - state.jacobian * state.qd;
    let mut acceleration = Vector6::zeros();
    for row in 0..6 {
        let stiffness = if row < 3 { gains.position_stiffness } else { gains.rotation_stiffness };
        acceleration[row] = stiffness * error[row] + 2.0 * gains.damping_ratio * stiffness.sqrt() * velocity_error[row];
    }
    let Some(factor) = state.mass.cholesky() else {
        // A mass matrix that is not positive definite can only come from a broken model; hold still against gravity.
        return saturate(state.bias, &limits.torque);
    };
    let inverse_mass_jt = factor.solve(&state.jacobian.transpose()); // M⁻¹ Jᵀ, 7 x 6
    let inertia = task_inertia(&(state.jacobian * inverse_mass_jt), gains);
    let task = state.jacobian.transpose() * (inertia * acceleration);
    let posture_acceleration =
        (goal.posture - state.q) * gains.posture_stiffness - state.qd * (2.0 * gains.posture_stiffness.sqrt());
    let posture = state.mass * posture_acceleration;
    // Nᵀ τ₀ = τ₀ − Jᵀ Λ J M⁻¹ τ₀
    let null = posture - state.jacobian.transpose() * (inertia * (inverse_mass_jt.transpose() * posture));
    let excess = state.qd.zip_map(&limits.velocity, |speed, limit| speed - speed.clamp(-limit, limit));
    let wanted = task + null - state.mass * excess * SPEED_LIMIT_DAMPING;
    let scale = (0..JOINTS)
        .map(|i| {
            let room = limits.torque[i] - state.bias[i].abs().min(limits.torque[i]);
            if wanted[i].abs() > room { room / wanted[i].abs() } else { 1.0 }
        })
        .fold(1.0, f64::min);
    saturate(wanted * scale + state.bias, &limits.torque)
}

/// Λ = (A + εI)⁻¹ of A = J M⁻¹ Jᵀ, where ε = ε₀ (1 − s/s₀)² for s < s₀ and 0 beyond; s = 1 / tr A⁻¹.
///
/// s lies between a sixth of the least eigenvalue of A and that eigenvalue: a well-conditioned arm is not damped at all.
fn task_inertia(inverse_inertia: &Matrix6<f64>, gains: &OscGains) -> Matrix6<f64> {
    let exact = inverse_inertia.cholesky().map(|factor| factor.inverse());
    let distance = exact.map_or(0.0, |inertia| 1.0 / inertia.trace());
    if let Some(inertia) = exact
        && distance >= gains.singularity_onset
    {
        return inertia;
    }
    let damping = gains.singularity_damping * (1.0 - distance / gains.singularity_onset).powi(2);
    (inverse_inertia + Matrix6::identity() * damping).cholesky().map_or_else(Matrix6::zeros, |factor| factor.inverse())
}

fn clamp_norm(error: &mut Vector6<f64>, from: usize, limit: f64) {
    let norm = error.fixed_rows::<3>(from).norm();
    if norm > limit {
        error.fixed_rows_mut::<3>(from).scale_mut(limit / norm);
    }
}

fn saturate(torque: JointVector, limit: &JointVector) -> JointVector {
    torque.zip_map(limit, |torque, limit| torque.clamp(-limit, limit))
}
