//! From contact points to a gripper pose that the arm can reach, hold through the motion, and get to unhindered.

use crate::cameras::TABLE_PLANE_HEIGHT;
use crate::failure::Failure;
use crate::simulation::Simulation;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::contact::{ArmId, PartId};
use vmao_core::geometry::{Pose, interpolate};
use vmao_core::gripper_pose::{GripperPose, gripper_poses, squared};
use vmao_core::inverse_kinematics::{IkSettings, posture_cost, solutions, track};
use vmao_core::observation::{Observation, PointLabel};
use vmao_core::outcome::FailureStage;
use vmao_core::random::Stream;
use vmao_core::robots::RobotModel;

/// How grasps are chosen and made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspConfig {
    /// Approach directions tried about the closing axis.
    pub approaches: usize,
    /// Start of the straight approach, this far back (m).
    pub standoff: f64,
    /// The pads are opened this much wider than the contacts are apart (m).
    pub opening_margin: f64,
    /// Fingers keep this far above the table (m) ...
    pub table_clearance: f64,
    /// ... for which the grasp may be shifted back along its approach by at most this (m).
    pub max_retreat: f64,
    /// Distance that plans keep from everything (m).
    pub plan_margin: f64,
    /// Preferred lean of the approach away from the arm's own base, per unit down (–).
    pub lean_forward: f64,
    /// Preferred lean towards the object's other parts, so that the hand stays outside, per unit down (–).
    pub lean_inward: f64,
    /// Distance from each other at which arms plan to carry the object (m); less of it where it leaves no way (D18).
    pub carry_margin: f64,
    /// Cost of an approach per squared deviation from that direction, against the posture's cost.
    pub approach_cost: f64,
    /// The closing axis may be turned by up to this to lie square to the bar that is grasped (degrees).
    pub squaring_deg: f64,
    /// Gripper poses of each arm that are tried in combination.
    pub shortlist: usize,
    /// Joint solutions compared for each gripper pose.
    pub ik_candidates: usize,
    /// Random starts of each joint solution search.
    pub ik_restarts: usize,
    /// Force with which each pad closes (N), as far as the gripper can.
    pub closing_force: f64,
    /// How long the fingers may take to close (s).
    pub closing_seconds: f64,
    /// Each pad must press on the part with at least this (N) for a hold.
    pub hold_force: f64,
}

/// A grasp that can be reached and carried through the planned motion.
#[derive(Debug, Clone)]
pub(crate) struct Grasp {
    pub(crate) arm: ArmId,
    pub(crate) part: PartId,
    /// Which of the gripper poses on its contacts this is.
    pub(crate) pose: usize,
    pub(crate) world_from_tool: Pose,
    /// Gap to open the pads to before the approach (m).
    pub(crate) opening: f64,
    /// Joint positions from the stand-off to the grasp.
    pub(crate) approach: Vec<Vec<f64>>,
    /// Joint positions along the motion that follows.
    pub(crate) carried: Vec<Vec<f64>>,
    pub(crate) cost: f64,
}

impl Grasp {
    pub(crate) fn standoff(&self) -> &[f64] {
        &self.approach[0]
    }

    pub(crate) fn grasp(&self) -> &[f64] {
        &self.approach[self.approach.len() - 1]
    }
}

/// Waypoints of the straight approach, and the largest joint step between neighbouring waypoints of a motion (rad).
const APPROACH_WAYPOINTS: usize = 6;
/// Branches of joint solutions kept of each gripper pose.
const BRANCHES: usize = 5;
/// The elbow is looked for swung to both sides by this much, besides where it is (rad).
const ELBOW_SWING: f64 = 0.9;
pub(crate) const MAX_JOINT_STEP: f64 = 0.6;

pub(crate) fn ik_settings(restarts: usize) -> IkSettings {
    IkSettings { position_tolerance: 1e-4, rotation_tolerance: 1e-3, max_iterations: 60, restarts }
}

/// Gripper poses on these world points that the arm reaches and can carry along `motion`, best first.
///
/// `motion` are the poses of all parts along the planned motion, those at the grasp first; `cloud` shows the object.
pub(crate) fn reachable_grasps(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    (arm, part): (ArmId, PartId),
    (cloud, fingers): (&[Point3<f64>], &[Point3<f64>; 2]),
    motion: &[Vec<Pose>],
    stream: &mut Stream,
) -> Result<Vec<Grasp>, Failure> {
    let index = usize::from(arm.0);
    let robot = &simulation.scene.robots[index];
    let squared = squared(fingers, cloud, config.squaring_deg.to_radians());
    let fingers = squared.as_ref().unwrap_or(fingers);
    let width = (fingers[0] - fingers[1]).norm();
    let Some(opening) = opening_for(robot, config, width) else {
        let limit = robot.gripper.max_opening();
        return Err(Failure::new(
            FailureStage::Unreachable,
            format!("contacts {width:.3} m apart; the gripper opens {limit:.3} m"),
        ));
    };
    let poses = gripper_poses(fingers, config.approaches);
    if poses.is_empty() {
        return Err(Failure::new(FailureStage::Unreachable, "both fingers on one point"));
    }
    let mut above_table = 0;
    let mut found = Vec::new();
    for (index, pose) in poses.into_iter().enumerate() {
        let Some(world_from_tool) = clear_of_table(robot, config, &pose, opening) else { continue };
        above_table += 1;
        let ways =
            carried_grasps(simulation, config, (arm, part), &GripperPose { world_from_tool, ..pose }, opening, motion, stream);
        found.extend(ways.into_iter().map(|grasp| Grasp { pose: index, ..grasp }));
    }
    if found.is_empty() {
        let why = format!("arm {} reaches none of {above_table} gripper poses on part {} and its goal", arm.0, part.0);
        return Err(Failure::new(FailureStage::Unreachable, why));
    }
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    Ok(found)
}

/// The gap to open the pads to (m) for contacts `width` (m) apart; none if the gripper does not open so far.
pub(crate) fn opening_for(robot: &RobotModel, config: &GraspConfig, width: f64) -> Option<f64> {
    (width <= robot.gripper.span()[1]).then(|| (width + config.opening_margin).min(robot.gripper.max_opening()))
}

/// The gripper pose raised back along its approach until the fingertips clear the table; none if that takes too much.
pub(crate) fn clear_of_table(robot: &RobotModel, config: &GraspConfig, pose: &GripperPose, opening: f64) -> Option<Pose> {
    let lowest = robot.lowest_gripper_point(&pose.world_from_tool, opening);
    let missing = config.table_clearance - lowest;
    let rise = -(pose.world_from_tool.rotation * Vector3::z()).z;
    let retreat = if missing <= 0.0 { 0.0 } else { missing / rise.max(1e-3) };
    (retreat <= config.max_retreat).then(|| pose.backed_off(retreat))
}

/// Points that lie neither on an arm, which knows where it is, nor on the table's plane.
pub(crate) fn object_cloud(observation: &Observation) -> Vec<Point3<f64>> {
    let seen = observation.points.iter().zip(&observation.labels);
    seen.filter(|(_, label)| !matches!(label, PointLabel::Arm(_)))
        .map(|(point, _)| Point3::from(point.map(f64::from)))
        .filter(|point| point.z > TABLE_PLANE_HEIGHT)
        .collect()
}

/// The ways in which the arm can take this gripper pose and carry it along the motion: different branches of its elbow and wrist.
fn carried_grasps(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    (arm, part): (ArmId, PartId),
    pose: &GripperPose,
    opening: f64,
    motion: &[Vec<Pose>],
    stream: &mut Stream,
) -> Vec<Grasp> {
    let index = usize::from(arm.0);
    let chain = &simulation.chains[index];
    let base_from_world = simulation.scene.world_from_bases[index].inverse();
    let settings = ik_settings(config.ik_restarts);
    let now = simulation.joint_positions(index);
    let standoff = base_from_world * pose.backed_off(config.standoff);
    let grasp = base_from_world * pose.world_from_tool;
    let mut starts = solutions(chain, &standoff, now.as_slice(), config.ik_candidates, &settings, stream);
    for swing in [ELBOW_SWING, -ELBOW_SWING] {
        // Turned about the vertical at the base and back at the upper arm: the hand stays, the elbow goes aside.
        let mut seed = now.as_slice().to_vec();
        seed[0] += swing;
        seed[2] -= swing;
        starts.extend(solutions(chain, &standoff, &seed, 1, &ik_settings(0), stream));
    }
    let line: Vec<Pose> =
        (1..APPROACH_WAYPOINTS).map(|i| interpolate(&standoff, &grasp, i as f64 / (APPROACH_WAYPOINTS - 1) as f64)).collect();
    let place = usize::from(part.0);
    let part_from_tool = motion[0][place].inverse() * pose.world_from_tool;
    let carried: Vec<Pose> = motion[1..].iter().map(|parts| base_from_world * parts[place] * part_from_tool).collect();
    let preferred = preferred_approach(simulation, config, (index, part), &motion[0], &pose.world_from_tool);
    let deviation = (pose.world_from_tool.rotation * Vector3::z() - preferred).norm_squared();
    let home = &simulation.scene.robots[index].home;
    let reach = |start: Vec<f64>| {
        let mut approach = vec![start];
        approach.extend(track(chain, &line, &approach[0], MAX_JOINT_STEP, &settings).ok()?);
        let carried = track(chain, &carried, approach.last()?, MAX_JOINT_STEP, &settings).ok()?;
        let posture = posture_cost(chain, &approach[0], now.as_slice()) + posture_cost(chain, carried.last()?, home);
        let cost = config.approach_cost * deviation + posture;
        Some(Grasp { arm, part, pose: 0, world_from_tool: pose.world_from_tool, opening, approach, carried, cost })
    };
    starts.into_iter().filter_map(reach).take(BRANCHES).collect()
}

/// The approach that leaves the other arms most room: down, leaning in from the arm's own side and from outside the object.
fn preferred_approach(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    (arm, part): (usize, PartId),
    world_from_parts: &[Pose],
    world_from_tool: &Pose,
) -> Vector3<f64> {
    let level = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0).try_normalize(1e-9).unwrap_or_else(Vector3::zeros);
    let here = world_from_tool.translation.vector;
    let forward = level(here - simulation.scene.world_from_bases[arm].translation.vector);
    let centers = simulation.scene.hold_centers.iter().zip(world_from_parts).map(|(center, part)| part * center);
    let others = centers.enumerate().filter(|(other, _)| *other != usize::from(part.0));
    let inward: Vector3<f64> = others.map(|(_, center)| level(center.coords - here)).sum();
    (forward * config.lean_forward + level(inward) * config.lean_inward - Vector3::z()).normalize()
}
