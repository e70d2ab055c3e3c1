//! Whether a goal is within the arms' reach: a property of start, goal and arms, the same for all contact models.

use crate::assignment::{arrangements, assignments};
use crate::grasping::{GraspConfig, clear_of_table, opening_for};
use crate::scene::Scene;
use std::sync::Arc;
use vmao_core::contact::PartId;
use vmao_core::geometry::Pose;
use vmao_core::gripper_pose::gripper_poses;
use vmao_core::inverse_kinematics::{IkOutcome, IkSettings, InverseKinematics};
use vmao_core::outcome::Reachability;
use vmao_core::robots::RobotModel;

/// How near a solution must come, and how long it is looked for: many grasps are tried, and one is enough.
const SETTINGS: IkSettings = IkSettings { position_tolerance: 1e-4, rotation_tolerance: 1e-3, max_iterations: 60, restarts: 8 };

/// Inverse kinematics of every arm, as [`reachability`] asks it; arms of one kind share theirs.
pub(crate) fn prepared(robots: &[RobotModel]) -> Vec<Arc<InverseKinematics>> {
    let mut prepared: Vec<Arc<InverseKinematics>> = Vec::new();
    for (arm, robot) in robots.iter().enumerate() {
        let same = robots[..arm].iter().position(|other| other == robot);
        let new = || Arc::new(InverseKinematics::new(robot.tool_chain(), &SETTINGS));
        prepared.push(same.map_or_else(new, |other| Arc::clone(&prepared[other])));
    }
    prepared
}

/// Whether all parts can be held where they are at `start` and, by the same grasps, at `goal`.
///
/// Looks for joint positions of all demonstrated contacts from all approaches. Collisions, and the way between, play no part.
pub(crate) fn reachability(scene: &Scene, config: &GraspConfig, start: &[Pose], goal: &[Pose]) -> Reachability {
    let (arms, parts) = (scene.robots.len(), start.len());
    let mut known: Vec<Option<Reachability>> = vec![None; arms * parts];
    let mut pair = |arm: usize, part: usize| {
        *known[arm * parts + part].get_or_insert_with(|| part_reachability(scene, config, (arm, part), &start[part], &goal[part]))
    };
    // The nearest arms are asked first: mostly they are the answer.
    for order in assignments(scene, &[], &[start, goal]) {
        if order.iter().enumerate().all(|(part, arm)| pair(usize::from(arm.0), part) == Reachability::Reachable) {
            return Reachability::Reachable;
        }
    }
    let mut best = Reachability::Unreachable;
    arrangements(arms, parts, &mut |order| {
        let mut whole = Reachability::Reachable;
        for (part, &arm) in order.iter().enumerate() {
            match pair(arm, part) {
                Reachability::Reachable => {}
                Reachability::Unknown if whole == Reachability::Reachable => whole = Reachability::Unknown,
                Reachability::Unknown => {}
                Reachability::Unreachable => whole = Reachability::Unreachable,
            }
        }
        match whole {
            Reachability::Reachable => best = whole,
            Reachability::Unknown if best == Reachability::Unreachable => best = whole,
            Reachability::Unknown | Reachability::Unreachable => {}
        }
    });
    best
}

/// Whether this arm can hold this part at both places by one of the demonstrated grasps.
fn part_reachability(
    scene: &Scene,
    config: &GraspConfig,
    (arm, part): (usize, usize),
    start: &Pose,
    goal: &Pose,
) -> Reachability {
    let (robot, kinematics) = (&scene.robots[arm], &scene.inverse_kinematics()[arm]);
    let base_from_world = scene.world_from_bases[arm].inverse();
    let goal_from_start = goal * start.inverse();
    let mut found = Reachability::Unreachable;
    let contacts = scene.demonstrations.iter().flatten().filter(|contact| contact.part == PartId(part as u16));
    for contact in contacts {
        let fingers = contact.fingers.map(|point| start * point);
        let Some(opening) = opening_for(robot, config, contact.width()) else { continue };
        for pose in gripper_poses(&fingers, config.approaches) {
            let Some(world_from_tool) = clear_of_table(robot, config, &pose, opening) else { continue };
            let ask = |world_from_tool: &Pose| kinematics.solve(&(base_from_world * world_from_tool), &robot.home);
            // Goals are farther away: most that fails, fails there.
            let outcomes = match ask(&(goal_from_start * world_from_tool)) {
                IkOutcome::Unreachable { .. } => continue,
                at_goal => (at_goal, ask(&world_from_tool)),
            };
            match outcomes {
                (IkOutcome::Solved { .. }, IkOutcome::Solved { .. }) => return Reachability::Reachable,
                (_, IkOutcome::Unreachable { .. }) => {}
                _ => found = Reachability::Unknown,
            }
        }
    }
    found
}
