//! The scene as the planner sees it: arms as solids on chains, the object's parts as obstacles, the table as a floor.

use crate::scene::Scene;
use crate::simulation::Simulation;
use vmao_core::collision::{CollisionWorld, Obstacle};
use vmao_core::geometry::Pose;
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
    let arms = (0..scene.robots.len())
        .map(|arm| scene.robots[arm].collision_model(scene.world_from_bases[arm], openings[arm]))
        .collect();
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
