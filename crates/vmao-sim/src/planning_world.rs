//! The scene as the planner sees it: arms as solids on chains, the object's parts as obstacles, the table as a floor.

use crate::scene::Scene;
use crate::simulation::Simulation;
use vmao_core::collision::{ArmCollisionModel, CollisionWorld, LinkSolid, Obstacle};
use vmao_core::geometry::Pose;
use vmao_core::robots::RobotModel;
use vmao_core::shape::Solid;

/// Which parts of the object are in the way.
pub(crate) enum Obstacles<'a> {
    /// Every part, where it is now. Arms may touch the parts that they hold or are about to hold: (arm, part).
    Parts(&'a [(usize, usize)]),
    /// Only the arms themselves: the object moves with them, away from the table.
    Nothing,
}

/// The collision world of the scene now, each gripper open by `openings` (m).
pub(crate) fn collision_world(simulation: &Simulation<'_>, openings: &[f64], obstacles: &Obstacles<'_>) -> CollisionWorld {
    collision_world_at(simulation.scene, &simulation.object_state().world_from_parts, openings, obstacles)
}

/// The same with the object's parts at `world_from_parts`.
pub(crate) fn collision_world_at(
    scene: &Scene,
    world_from_parts: &[Pose],
    openings: &[f64],
    obstacles: &Obstacles<'_>,
) -> CollisionWorld {
    let arms = (0..scene.robots.len()).map(|arm| arm_model(scene, arm, openings[arm])).collect();
    let mut world = CollisionWorld { arms, ..CollisionWorld::default() };
    if let Obstacles::Parts(holders) = obstacles {
        world.floor_height = Some(0.0);
        for (part, (description, world_from_part)) in scene.object.parts.iter().zip(world_from_parts).enumerate() {
            for solid in &description.solids {
                let obstacle = world.obstacles.len();
                world.allowed.extend(holders.iter().filter(|(_, held)| *held == part).map(|(arm, _)| (*arm, obstacle)));
                let carrier_from_solid = world_from_part * solid.carrier_from_solid;
                world
                    .obstacles
                    .push(Obstacle { name: description.name.clone(), solid: Solid { carrier_from_solid, ..solid.clone() } });
            }
        }
    }
    world
}

/// What `world` is to one of its arms if the others were not there; it becomes arm 0.
pub(crate) fn with_one_arm(mut world: CollisionWorld, arm: usize) -> CollisionWorld {
    world.arms = vec![world.arms.swap_remove(arm)];
    world.allowed.retain(|(holder, _)| *holder == arm);
    world.allowed.iter_mut().for_each(|(holder, _)| *holder = 0);
    world
}

fn arm_model(scene: &Scene, arm: usize, opening: f64) -> ArmCollisionModel {
    let robot: &RobotModel = &scene.robots[arm];
    let mut solids: Vec<LinkSolid> = robot.base.solids.iter().map(|solid| LinkSolid { link: 0, solid: solid.clone() }).collect();
    for (index, joint) in robot.joints.iter().enumerate() {
        solids.extend(joint.link.solids.iter().map(|solid| LinkSolid { link: index + 1, solid: solid.clone() }));
    }
    let last = robot.joints.len();
    solids.extend(gripper_solids(robot, opening).into_iter().map(|solid| LinkSolid { link: last, solid }));
    // The same neighbours may overlap as in the simulator's model: links that are two apart.
    let ignored_links = (0..last).map(|link| (link, link + 2)).chain([(last - 3, last)]).filter(|(_, b)| *b <= last).collect();
    ArmCollisionModel { chain: robot.tool_chain(), world_from_base: scene.world_from_bases[arm], solids, ignored_links }
}

/// Hand and fingers, in the frame of the arm's last link, the pads `opening` (m) apart.
pub(crate) fn gripper_solids(robot: &RobotModel, opening: f64) -> Vec<Solid> {
    let gripper = &robot.gripper;
    let place = |carrier: Pose, solid: &Solid| Solid { carrier_from_solid: carrier * solid.carrier_from_solid, ..solid.clone() };
    let mut solids: Vec<Solid> = gripper.hand.solids.iter().map(|solid| place(gripper.last_from_hand, solid)).collect();
    let travel = ((opening - gripper.closed_gap) / 2.0).clamp(0.0, gripper.travel);
    for finger in &gripper.fingers {
        let carrier = gripper.last_from_hand * finger.hand_from_finger * Pose::translation(0.0, travel, 0.0);
        solids.extend(finger.link.solids.iter().chain([&finger.pad]).map(|solid| place(carrier, solid)));
    }
    solids
}

/// Height of the gripper's lowest point with its tool at `world_from_tool` (m).
pub(crate) fn lowest_gripper_point(robot: &RobotModel, world_from_tool: &Pose, opening: f64) -> f64 {
    let tool_from_last = (robot.gripper.last_from_hand * robot.gripper.hand_from_tool).inverse();
    let world_from_last = world_from_tool * tool_from_last;
    gripper_solids(robot, opening).iter().map(|solid| solid.lowest_point(&world_from_last)).fold(f64::INFINITY, f64::min)
}
