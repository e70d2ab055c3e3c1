//! The task: where the object lies at the start and where it shall go.

use crate::grasping::GraspConfig;
use crate::profile::{Stage, time};
use crate::reachability::reachability;
use crate::scene::Scene;
use nalgebra::{Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::contact::PartId;
use vmao_core::geometry::{Pose, pose_distance};
use vmao_core::object::{Joint, JointKind, ObjectGoal, ObjectState};
use vmao_core::object_centric::{ball_change, joint_errors, joint_positions, part_poses};
use vmao_core::outcome::Reachability;
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
    /// Lowest and highest lift of the object's first part (m).
    pub lift: [f64; 2],
    /// Largest horizontal move (m).
    pub sideways: f64,
    /// Largest turn about the vertical (degrees).
    pub yaw_deg: f64,
    /// Largest tilt from the horizontal (degrees).
    pub tilt_deg: f64,
    /// Every joint changes by at least this share of its range ...
    pub joint_change_share: f64,
    /// ... and a joint that turns by at least this much (degrees).
    pub joint_change_deg: f64,
    /// Whether a goal that is not known to be within reach is drawn anew.
    pub reject_unreachable: bool,
}

/// When a goal counts as met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thresholds {
    /// Of every part's position (m).
    pub position: f64,
    /// Of every part's orientation (degrees).
    pub rotation_deg: f64,
    /// Of every joint that turns (degrees).
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
        .flat_map(|joint| match (joint.kind, joint.limits) {
            (JointKind::Fixed, _) => vec![0.0],
            (JointKind::Ball, limits) => ball_position(largest_turn(limits), stream),
            (_, limits) => {
                let [low, high] = limits.unwrap_or([-1.0, 1.0]);
                vec![stream.range(low, high)]
            }
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
pub(crate) fn lowest_point(scene: &Scene, world_from_root: &Pose, joints: &[f64]) -> f64 {
    let parts = part_poses(&scene.object, &scene.graph, PartId(0), world_from_root, joints);
    let placed = scene.object.parts.iter().zip(&parts);
    let heights = placed.flat_map(|(part, pose)| part.solids.iter().map(move |solid| solid.lowest_point(pose)));
    heights.fold(f64::INFINITY, f64::min)
}

/// What is known of a trial's goal before anything moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalReach {
    /// Whether the arms reach it.
    pub reachability: Reachability,
    /// How many goals were drawn before it and rejected.
    pub redraws: u32,
}

/// Goals drawn anew at most; the last one stays, whatever its reachability.
const MOST_REDRAWS: u32 = 100;

/// The goal of a trial that starts at `start`, the parts' poses there, and what is known of it.
pub(crate) fn draw_goal(
    scene: &Scene,
    (goal, grasp): (&GoalConfig, &GraspConfig),
    start: &ObjectState,
    stream: &mut Stream,
) -> (ObjectGoal, Vec<Pose>, GoalReach) {
    let mut redraws = 0;
    loop {
        let drawn = sample_goal(scene, goal, start, stream);
        let parts = part_poses(&scene.object, &scene.graph, drawn.root, &drawn.world_from_root, &drawn.joint_positions);
        let reachability = time(Stage::Grasping, || reachability(scene, grasp, &start.world_from_parts, &parts));
        if !goal.reject_unreachable || reachability == Reachability::Reachable || redraws == MOST_REDRAWS {
            return (drawn, parts, GoalReach { reachability, redraws });
        }
        redraws += 1;
    }
}

/// A goal for an object that lies at `start`: lifted, moved, turned, tilted, every joint changed; never met at the start.
///
/// Lift, move, turn and tilt are those of part 0.
pub(crate) fn sample_goal(scene: &Scene, config: &GoalConfig, start: &ObjectState, stream: &mut Stream) -> ObjectGoal {
    let root = PartId(0);
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
    let joints = scene.object.positions_by_joint(&start.joint_positions);
    let joint_positions = joints.flat_map(|(joint, now)| changed_joint(joint, config, now, stream)).collect();
    ObjectGoal { root, world_from_root: Pose::from_parts(position.into(), turn * world_from_root.rotation), joint_positions }
}

/// A position of the joint within its limits that differs from `now` by at least the configured change, where it can.
fn changed_joint(joint: &Joint, config: &GoalConfig, now: &[f64], stream: &mut Stream) -> Vec<f64> {
    let least_turn = config.joint_change_deg.to_radians();
    match joint.kind {
        JointKind::Fixed => vec![0.0],
        JointKind::Ball => {
            let largest = largest_turn(joint.limits);
            changed_ball(now, largest, (config.joint_change_share * largest).max(least_turn), stream)
        }
        JointKind::Revolute | JointKind::Prismatic => {
            let now = now[0];
            let [low, high] = joint.limits.unwrap_or([now - 1.0, now + 1.0]);
            let least = if joint.kind == JointKind::Revolute { least_turn } else { 0.0 };
            vec![changed(now, low, high, (config.joint_change_share * (high - low)).max(least), stream)]
        }
    }
}

/// The largest angle that a ball joint with these limits may be turned by (rad).
fn largest_turn(limits: Option<[f64; 2]>) -> f64 {
    limits.map_or(1.0, |[_, largest]| largest)
}

/// A rotation vector of any direction, its angle uniform up to `largest` (rad).
fn ball_position(largest: f64, stream: &mut Stream) -> Vec<f64> {
    let direction = Vector3::from_fn(|_, _| stream.normal()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
    (direction * stream.range(0.0, largest)).iter().copied().collect()
}

/// A ball's position at least `change` (rad) away from `now`; the furthest of all tries if none is.
fn changed_ball(now: &[f64], largest: f64, change: f64, stream: &mut Stream) -> Vec<f64> {
    // Half of all directions point away from `now`: so many tries fail only where the limits leave no room.
    const TRIES: usize = 64;
    let mut furthest = (0.0, now.to_vec());
    for _ in 0..TRIES {
        let position = ball_position(largest, stream);
        let distance = ball_change(now, &position).norm();
        if distance > furthest.0 {
            furthest = (distance, position);
        }
        if distance >= change {
            break;
        }
    }
    furthest.1
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

/// The largest errors from the goal: of part positions (m), part rotations (rad), joints that turn (rad) and that slide (m).
pub(crate) fn goal_errors(scene: &Scene, goal_parts: &[Pose], goal: &ObjectGoal, state: &ObjectState) -> [f64; 4] {
    let mut errors = [0.0_f64; 4];
    for (wanted, is) in goal_parts.iter().zip(&state.world_from_parts) {
        let [position, rotation] = pose_distance(wanted, is);
        errors[0] = errors[0].max(position);
        errors[1] = errors[1].max(rotation);
    }
    let measured = joint_positions(&scene.object, &state.world_from_parts);
    for (joint, error) in scene.object.joints.iter().zip(joint_errors(&scene.object, &goal.joint_positions, &measured)) {
        let kind = match joint.kind {
            JointKind::Revolute | JointKind::Ball => 2,
            JointKind::Prismatic => 3,
            JointKind::Fixed => continue,
        };
        errors[kind] = errors[kind].max(error);
    }
    errors
}

/// The smallest factor on all thresholds at which these errors count as being at the goal.
pub(crate) fn threshold_factor(thresholds: &Thresholds, errors: &[f64; 4]) -> f64 {
    let (rotation, turn) = (thresholds.rotation_deg.to_radians(), thresholds.joint_deg.to_radians());
    let allowed = [thresholds.position, rotation, turn, thresholds.joint_m];
    errors.iter().zip(allowed).map(|(error, allowed)| error / allowed).fold(0.0, f64::max)
}
