//! Which grasps go together: no arm in another's way now, along the motion, or where later arms need room.

use crate::failure::Failure;
use crate::grasping::{Grasp, GraspConfig};
use crate::planning_world::{Obstacles, collision_world, collision_world_at, with_one_arm};
use crate::simulation::Simulation;
use std::collections::BTreeSet;
use vmao_core::collision::{Collider, CollisionChecker, CollisionWorld};
use vmao_core::geometry::Pose;
use vmao_core::outcome::FailureStage;

/// Free combinations of grasps that are handed to the planner.
const PLANNED_COMBINATIONS: usize = 3;
/// Grasps of a later arm of which one must stay free, the best first.
const RESERVED_CHOICES: usize = 60;

/// Combinations of one grasp for each arm, best first.
pub(crate) struct Choices {
    /// Those that leave every later arm a way to its part.
    pub(crate) roomy: Vec<Vec<Grasp>>,
    /// Those that are free now and may leave a later arm none.
    pub(crate) crowded: Vec<Vec<Grasp>>,
}

/// What arms that grasp later will meet: where the parts are by then, and how each of them could take its own.
pub(crate) struct Reserve {
    pub(crate) world_from_parts: Vec<Pose>,
    /// Of each later arm, ways to take its part there.
    pub(crate) grasps: Vec<Vec<Grasp>>,
}

/// The grasps that are free of the table, of the parts where they are at `world_from_parts`, and of their own arm.
pub(crate) fn free_alone(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    holders: &[(usize, usize)],
    world_from_parts: &[Pose],
    grasps: Vec<Grasp>,
) -> Vec<Grasp> {
    let Some(first) = grasps.first() else { return grasps };
    let (arm, part) = (usize::from(first.arm.0), usize::from(first.part.0));
    let mut openings = openings(simulation);
    openings[arm] = first.opening;
    let touching: Vec<(usize, usize)> = holders.iter().copied().chain([(arm, part)]).collect();
    let worlds = [Obstacles::Parts(holders), Obstacles::Parts(&touching), Obstacles::Nothing]
        .map(|obstacles| with_one_arm(collision_world_at(simulation.scene, world_from_parts, &openings, &obstacles), arm));
    let [mut standoff, mut grasped, mut carry] = worlds.each_ref().map(CollisionChecker::new);
    let free = |grasp: &Grasp| {
        standoff.check(grasp.standoff(), config.plan_margin).is_none()
            && grasped.check(grasp.grasp(), config.table_clearance / 2.0).is_none()
            && grasp.carried.iter().all(|q| carry.check(q, config.table_clearance / 2.0).is_none())
    };
    grasps.into_iter().filter(free).collect()
}

/// Choices of one grasp for each arm such that nothing meets at the stand-offs, at the grasps or along the motion.
///
/// Combinations are tried by total cost; the first few that are free are returned, best first, for the planner.
pub(crate) fn compatible_grasps(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    candidates: &[Vec<Grasp>],
    holders: &[(usize, usize)],
    reserve: &Reserve,
) -> Result<Choices, Failure> {
    let mut openings = openings(simulation);
    for grasp in candidates.iter().chain(&reserve.grasps).flatten() {
        let opening = &mut openings[usize::from(grasp.arm.0)];
        *opening = opening.max(grasp.opening);
    }
    let touching: Vec<(usize, usize)> = holders.iter().copied().chain(pairs(candidates)).collect();
    let worlds = [
        collision_world(simulation, &openings, &Obstacles::Parts(holders)),
        collision_world(simulation, &openings, &Obstacles::Parts(&touching)),
        collision_world(simulation, &openings, &Obstacles::Nothing),
    ];
    let [mut standoff, mut grasp, mut carry] = worlds.each_ref().map(CollisionChecker::new);
    let later = later_worlds(simulation, &openings, &touching, reserve);
    let mut room = later.each_ref().map(CollisionChecker::new);
    let mut blocked = None;
    // Hands that meet do so whatever the arms' elbows do.
    let mut hands_meet = BTreeSet::new();
    let last_link = |arm: usize| simulation.chains[arm].len();
    let mut choices = Choices { roomy: Vec::new(), crowded: Vec::new() };
    for combination in cheapest_combinations(candidates, config.shortlist) {
        let chosen: Vec<&Grasp> = combination.iter().zip(candidates).map(|(&index, grasps)| &grasps[index]).collect();
        let poses: Vec<usize> = chosen.iter().map(|grasp| grasp.pose).collect();
        if hands_meet.contains(&poses) {
            continue;
        }
        let with = |phase: &dyn Fn(&Grasp) -> Vec<f64>| joint_positions_with(simulation, &chosen, phase);
        let at_standoff = standoff.check(&with(&|grasp| grasp.standoff().to_vec()), config.plan_margin);
        let mut at_grasp = || grasp.check(&with(&|grasp| grasp.grasp().to_vec()), config.table_clearance / 2.0);
        let mut waypoints = (0..chosen[0].carried.len()).rev();
        let mut carried = || waypoints.find_map(|i| carry.check(&with(&|grasp| grasp.carried[i].clone()), config.carry_margin));
        let hit = at_standoff
            .map(|pair| ("before the grasp", pair))
            .or_else(|| at_grasp().map(|pair| ("at the grasp", pair)))
            .or_else(|| carried().map(|pair| ("on the way to the goal", pair)));
        if let Some((when, pair)) = hit {
            if is_hand(pair.first, last_link) && is_hand(pair.second, last_link) {
                hands_meet.insert(poses);
            }
            blocked.get_or_insert_with(|| format!("{when} {pair}"));
            continue;
        }
        let leaves_room = reserve.grasps.iter().all(|grasps| {
            grasps.iter().take(RESERVED_CHOICES).any(|later| leaves_room_for(simulation, config, &chosen, later, &mut room))
        });
        let kind = if leaves_room { &mut choices.roomy } else { &mut choices.crowded };
        if kind.len() < PLANNED_COMBINATIONS {
            kind.push(chosen.into_iter().cloned().collect());
        }
        if choices.roomy.len() >= PLANNED_COMBINATIONS {
            break;
        }
    }
    if choices.roomy.is_empty() && choices.crowded.is_empty() {
        let why = blocked.unwrap_or_else(|| "an arm has none that is free of the table and the object".to_owned());
        return Err(Failure::new(FailureStage::NoPlan, format!("no free combination of gripper poses; the best: {why}")));
    }
    Ok(choices)
}

/// The worlds in which a later arm comes to its stand-off and to its grasp, arms that hold the object at its new place.
fn later_worlds(
    simulation: &Simulation<'_>,
    openings: &[f64],
    touching: &[(usize, usize)],
    reserve: &Reserve,
) -> [CollisionWorld; 2] {
    let parts = 0..reserve.world_from_parts.len();
    let holding: Vec<(usize, usize)> = touching.iter().flat_map(|(arm, _)| parts.clone().map(|part| (*arm, part))).collect();
    let grasping: Vec<(usize, usize)> = holding.iter().copied().chain(pairs(&reserve.grasps)).collect();
    [&holding, &grasping]
        .map(|holders| collision_world_at(simulation.scene, &reserve.world_from_parts, openings, &Obstacles::Parts(holders)))
}

/// Whether `later` is free while the arms of `chosen` hold the object where their motion ends.
fn leaves_room_for(
    simulation: &Simulation<'_>,
    config: &GraspConfig,
    chosen: &[&Grasp],
    later: &Grasp,
    [standoff, grasp]: &mut [CollisionChecker<'_>; 2],
) -> bool {
    let first = 7 * usize::from(later.arm.0);
    let mut q = joint_positions_with(simulation, chosen, &|grasp| grasp.carried.last().unwrap_or(&grasp.approach[0]).clone());
    let mut free = |checker: &mut CollisionChecker<'_>, own: &[f64], margin: f64| {
        q[first..first + 7].copy_from_slice(own);
        checker.check(&q, margin).is_none()
    };
    free(standoff, later.standoff(), config.plan_margin) && free(grasp, later.grasp(), config.table_clearance / 2.0)
}

fn is_hand(collider: Collider, last_link: impl Fn(usize) -> usize) -> bool {
    matches!(collider, Collider::Link { arm, link } if link == last_link(arm))
}

fn openings(simulation: &Simulation<'_>) -> Vec<f64> {
    (0..simulation.scene.robots.len()).map(|arm| simulation.opening(arm)).collect()
}

/// The (arm, part) pairs of these grasps.
fn pairs(grasps: &[Vec<Grasp>]) -> impl Iterator<Item = (usize, usize)> {
    grasps.iter().filter_map(|grasps| grasps.first()).map(|grasp| (usize::from(grasp.arm.0), usize::from(grasp.part.0)))
}

/// Indices of one candidate for each arm, in the order of their total cost, over each arm's `shortlist` cheapest.
fn cheapest_combinations(candidates: &[Vec<Grasp>], shortlist: usize) -> Vec<Vec<usize>> {
    let mut combinations: Vec<(f64, Vec<usize>)> = vec![(0.0, Vec::new())];
    for grasps in candidates {
        let mut longer = Vec::new();
        for (cost, chosen) in &combinations {
            for (next, grasp) in grasps.iter().enumerate().take(shortlist) {
                longer.push((cost + grasp.cost, chosen.iter().copied().chain([next]).collect()));
            }
        }
        longer.sort_by(|a, b| a.0.total_cmp(&b.0));
        // With many arms only the cheapest partial choices are extended further.
        longer.truncate(shortlist * shortlist);
        combinations = longer;
    }
    combinations.into_iter().map(|(_, chosen)| chosen).collect()
}

/// Joint positions of all arms (flat), those of the grasping arms taken by `phase`, the others as they are now.
pub(crate) fn joint_positions_with(
    simulation: &Simulation<'_>,
    grasps: &[&Grasp],
    phase: &dyn Fn(&Grasp) -> Vec<f64>,
) -> Vec<f64> {
    let arms = 0..simulation.scene.robots.len();
    arms.flat_map(|arm| match grasps.iter().find(|grasp| usize::from(grasp.arm.0) == arm) {
        Some(grasp) => phase(grasp),
        None => simulation.joint_positions(arm).as_slice().to_vec(),
    })
    .collect()
}
