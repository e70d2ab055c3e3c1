//! The task: where the object lies at the start and where it shall go.

use crate::scene::Scene;
use nalgebra::{Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::contact::PartId;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::object::{JointKind, ObjectGoal, ObjectState};
use vmao_core::object_centric::{joint_positions, part_poses};
use vmao_core::random::Stream;

/// Where objects start: on the table, at any heading.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartConfig {
    /// Largest distance of the object from the centre along x and y (m).
    pub half_width: f64,
}

/// From what start to what goal: the distribution that all methods share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalConfig {
    /// Lowest and highest lift of the root part (m).
    pub lift: [f64; 2],
    /// Largest horizontal move (m).
    pub sideways: f64,
    /// Largest turn about the vertical (degrees).
    pub yaw_deg: f64,
    /// Largest tilt from the horizontal (degrees).
    pub tilt_deg: f64,
    /// Every joint changes by at least this share of its range ...
    pub joint_change_share: f64,
    /// ... and a revolute joint by at least this much (degrees).
    pub joint_change_deg: f64,
}

/// When a goal counts as met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Of every part's position (m).
    pub position: f64,
    /// Of every part's orientation (degrees).
    pub rotation_deg: f64,
    /// Of every revolute joint (degrees).
    pub joint_deg: f64,
    /// Of every prismatic joint (m).
    pub joint_m: f64,
    /// For how long (s).
    pub hold_seconds: f64,
}

/// A start pose on the table and joint positions, before settling.
pub(crate) fn sample_start(scene: &Scene, config: &StartConfig, stream: &mut Stream) -> (Pose, Vec<f64>) {
    let joints: Vec<f64> = scene
        .object
        .joints
        .iter()
        .map(|joint| {
            let [low, high] = joint.limits.unwrap_or([-1.0, 1.0]);
            if joint.kind == JointKind::Fixed { 0.0 } else { stream.range(low, high) }
        })
        .collect();
    let x = stream.range(-config.half_width, config.half_width);
    let y = stream.range(-config.half_width, config.half_width);
    let yaw = stream.range(-std::f64::consts::PI, std::f64::consts::PI);
    let lying = Pose::new(Vector3::new(x, y, 0.0), Vector3::z() * yaw);
    let lowest = lowest_point(scene, &lying, &joints);
    // A little above the table, so that settling starts from free fall and never from penetration.
    (Pose::translation(0.0, 0.0, 0.002 - lowest) * lying, joints)
}

/// Height of the lowest point of the object.
fn lowest_point(scene: &Scene, world_from_root: &Pose, joints: &[f64]) -> f64 {
    let parts = part_poses(&scene.object, &scene.graph, PartId(0), world_from_root, joints);
    let placed = scene.object.parts.iter().zip(&parts);
    let heights = placed.flat_map(|(part, pose)| part.solids.iter().map(move |solid| solid.lowest_point(pose)));
    heights.fold(f64::INFINITY, f64::min)
}

/// A goal for an object that lies at `start`: lifted, moved, turned, tilted, every joint changed; never met at the start.
pub(crate) fn sample_goal(
    scene: &Scene,
    config: &GoalConfig,
    start: &ObjectState,
    root: PartId,
    stream: &mut Stream,
) -> ObjectGoal {
    let world_from_root = &start.world_from_parts[usize::from(root.0)];
    let heading = stream.range(-std::f64::consts::PI, std::f64::consts::PI);
    // Uniform over the disc.
    let distance = config.sideways * stream.unit().sqrt();
    let lift = stream.range(config.lift[0], config.lift[1]);
    let yaw = stream.range(-config.yaw_deg, config.yaw_deg).to_radians();
    let tilt = stream.range(0.0, config.tilt_deg).to_radians();
    let tilt_heading = stream.range(-std::f64::consts::PI, std::f64::consts::PI);
    let tilt_axis = Unit::new_normalize(Vector3::new(tilt_heading.cos(), tilt_heading.sin(), 0.0));
    let turn = UnitQuaternion::from_axis_angle(&tilt_axis, tilt) * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    let position = world_from_root.translation.vector + Vector3::new(distance * heading.cos(), distance * heading.sin(), lift);
    let joint_positions = scene
        .object
        .joints
        .iter()
        .zip(&start.joint_positions)
        .map(|(joint, &now)| {
            let [low, high] = joint.limits.unwrap_or([now - 1.0, now + 1.0]);
            match joint.kind {
                JointKind::Fixed => 0.0,
                JointKind::Revolute => changed(
                    now,
                    low,
                    high,
                    (config.joint_change_share * (high - low)).max(config.joint_change_deg.to_radians()),
                    stream,
                ),
                JointKind::Prismatic => changed(now, low, high, config.joint_change_share * (high - low), stream),
            }
        })
        .collect();
    ObjectGoal { root, world_from_root: Pose::from_parts(position.into(), turn * world_from_root.rotation), joint_positions }
}

/// Uniform over [low, high] without the interval nearer than `change` to `now`; the far end if nothing is left.
fn changed(now: f64, low: f64, high: f64, change: f64, stream: &mut Stream) -> f64 {
    let below = (now - change - low).max(0.0);
    let above = (high - now - change).max(0.0);
    let draw = stream.unit() * (below + above);
    if below + above <= 0.0 {
        if high - now > now - low { high } else { low }
    } else if draw < below {
        low + draw
    } else {
        now + change + (draw - below)
    }
}

/// The largest part position error (m), part rotation error (rad) and joint error (rad or m) from the goal.
pub(crate) fn goal_errors(scene: &Scene, goal_parts: &[Pose], goal: &ObjectGoal, state: &ObjectState) -> [f64; 3] {
    let mut errors = [0.0_f64; 3];
    for (wanted, is) in goal_parts.iter().zip(&state.world_from_parts) {
        errors[0] = errors[0].max((wanted.translation.vector - is.translation.vector).norm());
        errors[1] = errors[1].max(rotation_distance(&wanted.rotation, &is.rotation));
    }
    let measured = joint_positions(&scene.object, &state.world_from_parts);
    for (wanted, is) in goal.joint_positions.iter().zip(&measured) {
        errors[2] = errors[2].max((wanted - is).abs());
    }
    errors
}

/// The smallest factor on all thresholds at which the object counts as being at its goal.
pub(crate) fn threshold_factor(
    scene: &Scene,
    thresholds: &Thresholds,
    goal_parts: &[Pose],
    goal: &ObjectGoal,
    state: &ObjectState,
) -> f64 {
    let [position, rotation, _] = goal_errors(scene, goal_parts, goal, state);
    let mut factor = (position / thresholds.position).max(rotation / thresholds.rotation_deg.to_radians());
    let measured = joint_positions(&scene.object, &state.world_from_parts);
    for ((joint, wanted), is) in scene.object.joints.iter().zip(&goal.joint_positions).zip(&measured) {
        let allowed = match joint.kind {
            JointKind::Revolute => thresholds.joint_deg.to_radians(),
            JointKind::Prismatic => thresholds.joint_m,
            JointKind::Fixed => continue,
        };
        factor = factor.max((wanted - is).abs() / allowed);
    }
    factor
}
