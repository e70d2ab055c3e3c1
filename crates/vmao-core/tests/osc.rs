//! The operational space controller against its closed forms, on random configurations of the Panda.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use nalgebra::{SMatrix, Vector3, Vector6};
use vmao_core::geometry::{Pose, rotation_exp};
use vmao_core::osc::{ArmState, GripperGoal, Jacobian, JointLimits, JointVector, MassMatrix, OscGains, pose_error, torques};
use vmao_core::random::Stream;
use vmao_core::robots::panda;

const GAINS: OscGains = OscGains {
    position_stiffness: 400.0,
    rotation_stiffness: 300.0,
    damping_ratio: 0.9,
    posture_stiffness: 100.0,
    singularity_damping: 0.0,
    singularity_onset: 0.0,
    max_position_error: 0.05,
    max_rotation_error: 0.3,
};

fn unlimited() -> JointLimits {
    limited(JointVector::repeat(1e12))
}

/// Torques limited, speeds not.
fn limited(torque: JointVector) -> JointLimits {
    JointLimits { torque, velocity: JointVector::repeat(1e12) }
}

fn random_vector(stream: &mut Stream, size: f64) -> JointVector {
    JointVector::from_fn(|_, _| stream.range(-size, size))
}

/// A moving Panda in a random configuration with a random positive definite mass matrix.
fn arm(stream: &mut Stream) -> ArmState {
    let chain = panda().tool_chain();
    let q = chain.sample(stream);
    let root: MassMatrix = SMatrix::from_fn(|_, _| stream.range(-0.5, 0.5));
    ArmState {
        q: JointVector::from_row_slice(&q),
        qd: random_vector(stream, 1.0),
        world_from_tool: chain.tool_pose(&q),
        jacobian: Jacobian::from_iterator(chain.jacobian(&q).iter().copied()),
        mass: root * root.transpose() + MassMatrix::identity() * 0.2,
        bias: random_vector(stream, 20.0),
    }
}

/// A goal within the errors that are acted on, with a twist and a posture of its own.
fn near_goal(state: &ArmState, stream: &mut Stream) -> GripperGoal {
    let vector = |stream: &mut Stream, size: f64| Vector3::from_fn(|_, _| stream.range(-size, size));
    let mut world_from_tool = state.world_from_tool;
    world_from_tool.translation.vector += vector(stream, 0.02);
    world_from_tool.rotation = rotation_exp(&vector(stream, 0.1)) * world_from_tool.rotation;
    GripperGoal { world_from_tool, twist: Vector6::from_fn(|_, _| stream.range(-0.3, 0.3)), posture: random_vector(stream, 2.0) }
}

/// Acceleration of the tool that torques beyond the bias cause: J M⁻¹ (τ − h).
fn task_acceleration(state: &ArmState, torque: &JointVector) -> Vector6<f64> {
    state.jacobian * state.mass.cholesky().unwrap().solve(&(torque - state.bias))
}

#[test]
fn an_arm_at_its_goal_and_at_rest_is_held_by_exactly_the_bias() {
    let mut stream = Stream::new(1, &[]);
    for _ in 0..100 {
        let state = ArmState { qd: JointVector::zeros(), ..arm(&mut stream) };
        let goal = GripperGoal { world_from_tool: state.world_from_tool, twist: Vector6::zeros(), posture: state.q };
        let torque = torques(&GAINS, &state, &goal, &unlimited());
        assert!((torque - state.bias).amax() < 1e-9, "{torque} instead of {}", state.bias);
    }
}

#[test]
fn the_tool_accelerates_as_stiffness_and_damping_command() {
    let mut stream = Stream::new(2, &[]);
    for _ in 0..100 {
        let state = arm(&mut stream);
        let goal = near_goal(&state, &mut stream);
        let error = pose_error(&goal.world_from_tool, &state.world_from_tool);
        let lack = goal.twist - state.jacobian * state.qd;
        let wanted = Vector6::from_fn(|row, _| {
            let stiffness = if row < 3 { 400.0_f64 } else { 300.0 };
            stiffness * error[row] + 2.0 * 0.9 * stiffness.sqrt() * lack[row]
        });
        let found = task_acceleration(&state, &torques(&GAINS, &state, &goal, &unlimited()));
        assert!((found - wanted).amax() < 1e-7 * wanted.amax().max(1.0), "{found} instead of {wanted}");
    }
}

#[test]
fn the_posture_moves_the_joints_but_never_the_tool() {
    let mut stream = Stream::new(3, &[]);
    for _ in 0..100 {
        let state = arm(&mut stream);
        let goal = near_goal(&state, &mut stream);
        let elsewhere = GripperGoal { posture: goal.posture + random_vector(&mut stream, 1.0), ..goal.clone() };
        let torque = torques(&GAINS, &state, &goal, &unlimited());
        let other = torques(&GAINS, &state, &elsewhere, &unlimited());
        assert!((torque - other).amax() > 1e-3, "the posture has no effect");
        let moved = task_acceleration(&state, &torque) - task_acceleration(&state, &other);
        assert!(moved.amax() < 1e-6, "the posture accelerates the tool by {moved}");
    }
}

#[test]
fn saturation_keeps_the_limits_and_the_direction() {
    let mut stream = Stream::new(4, &[]);
    let mut saturated = 0;
    for trial in 0..200 {
        let strength = [1.0, 100.0][trial % 2];
        let limit = JointVector::from_row_slice(&[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]) * strength;
        let state = ArmState { bias: random_vector(&mut stream, 10.0), ..arm(&mut stream) };
        let goal = near_goal(&state, &mut stream);
        let free = torques(&GAINS, &state, &goal, &unlimited()) - state.bias;
        let torque = torques(&GAINS, &state, &goal, &limited(limit));
        assert!(torque.iter().zip(&limit).all(|(torque, limit)| torque.abs() <= *limit), "{torque}");
        let kept = torque - state.bias;
        let cosine = kept.dot(&free) / (kept.norm() * free.norm());
        assert!(cosine > 1.0 - 1e-9, "turned away: cosine {cosine}");
        if (kept - free).amax() > 1e-9 {
            saturated += 1;
            assert!(kept.norm() < free.norm());
        }
    }
    assert!((20..200).contains(&saturated), "{saturated} of 200 saturate: the case shows nothing");
}

#[test]
fn a_bias_beyond_the_limits_is_cut_and_leaves_no_room() {
    let mut stream = Stream::new(5, &[]);
    let state = ArmState { bias: JointVector::repeat(100.0), ..arm(&mut stream) };
    let goal = near_goal(&state, &mut stream);
    let limit = JointVector::repeat(12.0);
    assert_eq!(torques(&GAINS, &state, &goal, &limited(limit)), limit);
}

#[test]
fn a_singular_arm_stays_within_the_bound_of_its_damping() {
    // ‖Jᵀ Λ‖ ≤ √λ_max(M) max(1/√ε₀, √(2/s₀)), however singular J is: with s < s₀/2 at least a quarter of ε₀ is added, and
    // with s ≥ s₀/2 no eigenvalue is below it.
    let (damping, onset) = (1e-3, 5e-3);
    let gains = OscGains { singularity_damping: damping, singularity_onset: onset, posture_stiffness: 0.0, ..GAINS };
    let mut stream = Stream::new(6, &[]);
    let state = ArmState { qd: JointVector::zeros(), ..arm(&mut stream) };
    let goal = GripperGoal { twist: Vector6::repeat(1.0), ..near_goal(&state, &mut stream) };
    let error = pose_error(&goal.world_from_tool, &state.world_from_tool);
    let commanded = Vector6::from_fn(|row, _| {
        let stiffness = if row < 3 { 400.0_f64 } else { 300.0 };
        stiffness * error[row] + 2.0 * 0.9 * stiffness.sqrt()
    });
    let worst = (1.0 / damping.sqrt()).max((2.0 / onset).sqrt());
    let bound = state.mass.symmetric_eigenvalues().max().sqrt() * worst * commanded.norm();
    let mut largest_undamped: f64 = 0.0;
    for exponent in 0..=48 {
        let mut state = state.clone();
        state.jacobian.row_mut(2).scale_mut(10_f64.powf(-0.25 * f64::from(exponent)));
        let torque = torques(&gains, &state, &goal, &unlimited()) - state.bias;
        assert!(torque.norm() <= bound, "{} above {bound} at 1e-{exponent}", torque.norm());
        let undamped = OscGains { singularity_damping: 0.0, ..gains };
        largest_undamped = largest_undamped.max((torques(&undamped, &state, &goal, &unlimited()) - state.bias).norm());
    }
    assert!(largest_undamped > 10.0 * bound, "the case is not singular: {largest_undamped}");
}

#[test]
fn torques_are_finite_for_half_turns_zero_errors_and_no_jacobian() {
    let mut stream = Stream::new(7, &[]);
    for damping in [0.0, 1e-3] {
        let gains = OscGains { singularity_damping: damping, singularity_onset: 5.0 * damping, ..GAINS };
        for turn in [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(1.0, -1.0, 1.0).normalize()] {
            for still in [true, false] {
                let mut state = arm(&mut stream);
                if still {
                    state.jacobian = Jacobian::zeros();
                }
                let rotation = rotation_exp(&(turn * std::f64::consts::PI)) * state.world_from_tool.rotation;
                let world_from_tool = Pose::from_parts(state.world_from_tool.translation, rotation);
                let goal = GripperGoal { world_from_tool, twist: Vector6::zeros(), posture: state.q };
                let torque = torques(&gains, &state, &goal, &limited(JointVector::repeat(87.0)));
                assert!(torque.iter().all(|torque| torque.is_finite() && torque.abs() <= 87.0), "{turn:?}: {torque}");
            }
        }
    }
}

#[test]
fn a_half_turn_is_acted_on_like_any_turn_beyond_the_largest() {
    let mut stream = Stream::new(8, &[]);
    let state = ArmState { qd: JointVector::zeros(), ..arm(&mut stream) };
    let at = |angle: f64, shift: f64| {
        let rotation = rotation_exp(&(Vector3::y() * angle)) * state.world_from_tool.rotation;
        let mut world_from_tool = Pose::from_parts(state.world_from_tool.translation, rotation);
        world_from_tool.translation.vector.x += shift;
        let goal = GripperGoal { world_from_tool, twist: Vector6::zeros(), posture: state.q };
        torques(&GAINS, &state, &goal, &unlimited())
    };
    assert!((at(std::f64::consts::PI - 1e-6, 10.0) - at(0.3, 0.05)).amax() < 1e-6, "a far goal pulls harder than the largest");
    assert!((at(0.1, 0.01) - at(0.3, 0.05)).amax() > 1e-3, "near goals are not told apart");
}

#[test]
fn a_joint_beyond_its_speed_limit_is_slowed_and_others_are_left_alone() {
    let mut stream = Stream::new(10, &[]);
    for _ in 0..50 {
        let state = arm(&mut stream);
        let goal = near_goal(&state, &mut stream);
        let free = torques(&GAINS, &state, &goal, &unlimited());
        let accelerated = |torque: &JointVector| state.mass.cholesky().unwrap().solve(&(torque - free));
        let slow = JointLimits { velocity: state.qd.map(f64::abs) * 1.01, ..unlimited() };
        assert_eq!(torques(&GAINS, &state, &goal, &slow), free, "nothing is too fast");
        let mut velocity = state.qd.map(f64::abs) * 2.0;
        velocity[3] /= 4.0;
        let change = accelerated(&torques(&GAINS, &state, &goal, &JointLimits { velocity, ..unlimited() }));
        assert!(change[3] * state.qd[3] < 0.0, "joint 4 is not slowed: {change}");
        assert!((change[3].abs() - 50.0 * state.qd[3].abs()).abs() < 1e-6, "half its speed is to go: {change}");
        assert!((0..7).all(|joint| joint == 3 || change[joint].abs() < 1e-6), "others are moved: {change}");
    }
}

#[test]
fn a_mass_matrix_that_is_not_positive_definite_leaves_the_bias() {
    let mut stream = Stream::new(9, &[]);
    let state = ArmState { mass: MassMatrix::zeros(), ..arm(&mut stream) };
    let goal = near_goal(&state, &mut stream);
    assert_eq!(torques(&GAINS, &state, &goal, &unlimited()), state.bias);
}
