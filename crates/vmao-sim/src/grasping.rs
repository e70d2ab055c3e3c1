//! From contact points to a gripper pose that the arm can reach, hold through the motion, and get to unhindered.

use crate::failure::Failure;
use crate::planning_world::{Obstacles, collision_world, lowest_gripper_point};
use crate::simulation::Simulation;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use vmao_core::collision::CollisionChecker;
use vmao_core::contact::{ArmId, PartId};
use vmao_core::geometry::{Pose, interpolate};
use vmao_core::gripper_pose::{GripperPose, gripper_poses};
use vmao_core::inverse_kinematics::{IkSettings, posture_cost, solve_nearest, track};
use vmao_core::outcome::FailureStage;
use vmao_core::random::Stream;

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
    /// Cost of an approach per squared radian from straight down, against the posture's cost.
    pub tilt_cost: f64,
    /// Gripper poses of each arm that are tried in combination.
    pub shortlist: usize,
    /// Joint solutions compared for each gripper pose.
    pub ik_candidates: usize,
    /// Random starts of each joint solution search.
    pub ik_restarts: usize,
    /// Share of the gripper's greatest force it closes with.
    pub closing_share: f64,
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
    pub(crate) world_from_tool: Pose,
    /// Gap to open the pads to before the approach (m).
    pub(crate) opening: f64,
    /// Joint positions from the stand-off to the grasp.
    pub(crate) approach: Vec<Vec<f64>>,
    /// Joint positions at the end of the motion that follows.
    pub(crate) carried_to: Vec<f64>,
    cost: f64,
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
pub(crate) const MAX_JOINT_STEP: f64 = 0.6;

pub(crate) fn ik_settings(restarts: usize) -> IkSettings {
    IkSettings { position_tolerance: 1e-4, rotation_tolerance: 1e-3, max_iterations: 60, restarts }
}

/// Gripper poses on these world points that the arm reaches and can carry along `part_motion`, best first.
///
/// `part_motion` are the part's poses along the planned motion, the present one first.
pub(crate) fn reachable_grasps(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    (arm, part): (ArmId, PartId),
    fingers: &[Point3<f64>; 2],
    part_motion: &[Pose],
    stream: &mut Stream,
) -> Result<Vec<Grasp>, Failure> {
    let index = usize::from(arm.0);
    let robot = &simulation.scene.robots[index];
    let width = (fingers[0] - fingers[1]).norm();
    if width > robot.gripper.max_opening() - 0.004 {
        let limit = robot.gripper.max_opening();
        return Err(Failure::new(
            FailureStage::Unreachable,
            format!("contacts {width:.3} m apart; the gripper opens {limit:.3} m"),
        ));
    }
    let opening = (width + config.opening_margin).min(robot.gripper.max_opening());
    let poses = gripper_poses(fingers, config.approaches);
    if poses.is_empty() {
        return Err(Failure::new(FailureStage::Unreachable, "both fingers on one point"));
    }
    let mut above_table = 0;
    let mut found = Vec::new();
    for pose in poses {
        let lowest = lowest_gripper_point(robot, &pose.world_from_tool, opening);
        let missing = config.table_clearance - lowest;
        let rise = -(pose.world_from_tool.rotation * nalgebra::Vector3::z()).z;
        // Raised back along the approach until the fingertips clear the table.
        let retreat = if missing <= 0.0 { 0.0 } else { missing / rise.max(1e-3) };
        if retreat > config.max_retreat {
            continue;
        }
        above_table += 1;
        let world_from_tool = pose.backed_off(retreat);
        found.extend(carried_grasp(
            simulation,
            config,
            (arm, part),
            &GripperPose { world_from_tool, ..pose },
            opening,
            part_motion,
            stream,
        ));
    }
    if found.is_empty() {
        let why = format!("arm {} reaches none of {above_table} gripper poses on part {} and its goal", arm.0, part.0);
        return Err(Failure::new(FailureStage::Unreachable, why));
    }
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    Ok(found)
}

fn carried_grasp(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    (arm, part): (ArmId, PartId),
    pose: &GripperPose,
    opening: f64,
    part_motion: &[Pose],
    stream: &mut Stream,
) -> Option<Grasp> {
    let index = usize::from(arm.0);
    let chain = &simulation.chains[index];
    let base_from_world = simulation.scene.world_from_bases[index].inverse();
    let settings = ik_settings(config.ik_restarts);
    let now = simulation.joint_positions(index);
    let standoff = base_from_world * pose.backed_off(config.standoff);
    let grasp = base_from_world * pose.world_from_tool;
    let outcome = solve_nearest(chain, &standoff, now.as_slice(), config.ik_candidates, &settings, stream);
    let start = outcome.solution()?;
    let line: Vec<Pose> =
        (1..APPROACH_WAYPOINTS).map(|i| interpolate(&standoff, &grasp, i as f64 / (APPROACH_WAYPOINTS - 1) as f64)).collect();
    let mut approach = vec![start.to_vec()];
    approach.extend(track(chain, &line, start, MAX_JOINT_STEP, &settings).ok()?);
    let part_from_tool = part_motion[0].inverse() * pose.world_from_tool;
    let carried: Vec<Pose> =
        part_motion[1..].iter().map(|world_from_part| base_from_world * world_from_part * part_from_tool).collect();
    let motion = track(chain, &carried, approach.last()?, MAX_JOINT_STEP, &settings).ok()?;
    let carried_to = motion.last().or(approach.last())?.clone();
    let home = &simulation.scene.robots[index].home;
    let cost = config.tilt_cost * pose.approach_angle.powi(2)
        + posture_cost(chain, start, now.as_slice())
        + posture_cost(chain, &carried_to, home);
    Some(Grasp { arm, part, world_from_tool: pose.world_from_tool, opening, approach, carried_to, cost })
}

/// One grasp for each arm such that no two arms, parts or the table meet at stand-off, grasp and the motion's end.
///
/// Combinations are tried by total cost; the first ones that are free are returned, best first, for the planner.
pub(crate) fn compatible_grasps(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    candidates: &[Vec<Grasp>],
    holders: &[(usize, usize)],
) -> Result<Vec<Vec<Grasp>>, Failure> {
    let mut combinations: Vec<(f64, Vec<usize>)> = vec![(0.0, Vec::new())];
    for grasps in candidates {
        let extend = |(cost, chosen): &(f64, Vec<usize>)| {
            let (cost, chosen) = (*cost, chosen.clone());
            (0..grasps.len().min(config.shortlist)).map(move |next| {
                let mut longer = chosen.clone();
                longer.push(next);
                (cost + grasps[next].cost, longer)
            })
        };
        combinations = combinations.iter().flat_map(extend).collect();
        combinations.sort_by(|a, b| a.0.total_cmp(&b.0));
        combinations.truncate(config.shortlist * config.shortlist);
    }
    let mut openings: Vec<f64> = (0..simulation.scene.robots.len()).map(|arm| simulation.opening(arm)).collect();
    for grasps in candidates {
        openings[usize::from(grasps[0].arm.0)] = grasps.iter().map(|grasp| grasp.opening).fold(0.0, f64::max);
    }
    let grasped: Vec<(usize, usize)> = candidates.iter().map(|g| (usize::from(g[0].arm.0), usize::from(g[0].part.0))).collect();
    let touching: Vec<(usize, usize)> = holders.iter().chain(&grasped).copied().collect();
    let at_standoff = collision_world(simulation, &openings, &Obstacles::Parts(holders));
    let at_grasp = collision_world(simulation, &openings, &Obstacles::Parts(&touching));
    let at_goal = collision_world(simulation, &openings, &Obstacles::Nothing);
    let mut checkers = [CollisionChecker::new(&at_standoff), CollisionChecker::new(&at_grasp), CollisionChecker::new(&at_goal)];
    let mut blocked = String::new();
    let mut free = Vec::new();
    for (_, combination) in combinations {
        let chosen: Vec<&Grasp> = combination.iter().zip(candidates).map(|(&i, grasps)| &grasps[i]).collect();
        let phases: [fn(&Grasp) -> &[f64]; 3] = [|g| g.standoff(), |g| g.grasp(), |g| &g.carried_to];
        let margins = [config.plan_margin, config.table_clearance / 2.0, config.plan_margin];
        let hit = (0..3).find_map(|phase| {
            let q = joint_positions_with(simulation, &chosen, phases[phase]);
            checkers[phase].check(&q, margins[phase])
        });
        match hit {
            None => free.push(chosen.into_iter().cloned().collect()),
            Some(pair) => blocked = pair.to_string(),
        }
        if free.len() >= 3 {
            break;
        }
    }
    if free.is_empty() {
        return Err(Failure::new(FailureStage::NoPlan, format!("no free combination of gripper poses; last: {blocked}")));
    }
    Ok(free)
}

/// Joint positions of all arms (flat), those of the grasping arms taken by `phase`, the others as they are now.
pub(crate) fn joint_positions_with(simulation: &Simulation<'_>, grasps: &[&Grasp], phase: fn(&Grasp) -> &[f64]) -> Vec<f64> {
    let arms = 0..simulation.scene.robots.len();
    arms.flat_map(|arm| match grasps.iter().find(|grasp| usize::from(grasp.arm.0) == arm) {
        Some(grasp) => phase(grasp).to_vec(),
        None => simulation.joint_positions(arm).as_slice().to_vec(),
    })
    .collect()
}
