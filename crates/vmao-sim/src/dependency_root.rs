//! The dependency root: which part's motion is given, so that all others follow from it by Eq. (2), and who is grasped first.

use crate::error::Error;
use crate::execution::MotionConfig;
use crate::scene::Scene;
use crate::trial::TrialConfig;
use nalgebra::{Point3, Vector3};
use vmao_core::contact::PartId;
use vmao_core::geometry::Pose;
use vmao_core::object::{ArticulatedObject, ObjectGoal, ObjectState, Part};
use vmao_core::object_centric::{ObjectTrajectory, part_poses};
use vmao_core::object_graph::ObjectGraph;
use vmao_core::order::GraspOrder;

/// Which part is the dependency root.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Root {
    /// This one, in every trial.
    Part(PartId),
    /// In each trial the one of least predicted effort.
    Auto,
}

impl Root {
    /// The root that `name` speaks of: `first`, `auto`, or a part's own name.
    pub(crate) fn named(object: &ArticulatedObject, name: &str) -> Result<Self, Error> {
        match name {
            "first" => return Ok(Self::Part(PartId(0))),
            "auto" => return Ok(Self::Auto),
            _ => {}
        }
        let found = object.parts.iter().position(|part| part.name == name);
        found.map(|part| Self::Part(PartId(part as u16))).ok_or_else(|| Error::UnknownRoot {
            name: name.to_owned(),
            object: object.name.clone(),
            parts: object.parts.iter().map(|part| part.name.clone()).collect(),
        })
    }
}

/// The parts in the order in which they are grasped: outward from the root, those of one step by number.
///
/// So the root is held first, and the parts that are held are always joined to each other.
pub(crate) fn grasp_sequence(graph: &ObjectGraph, root: PartId, order: GraspOrder) -> Vec<PartId> {
    let mut sequence: Vec<PartId> = std::iter::once(root).chain(graph.outward(root).iter().map(|step| step.to)).collect();
    for step in order.steps(sequence.len()) {
        sequence[step].sort();
    }
    sequence
}

/// Where the object shall go while these parts are `held`: those to their goal, joints to others as they are `now`.
pub(crate) fn step_goal(
    object: &ArticulatedObject,
    (goal, goal_parts): (&ObjectGoal, &[Pose]),
    held: &[PartId],
    now: &ObjectState,
) -> ObjectGoal {
    let both = object.positions_by_joint(&goal.joint_positions).zip(object.positions_by_joint(&now.joint_positions));
    let joint_positions = both
        .flat_map(
            |((joint, goal), (_, now))| if held.contains(&joint.parent) && held.contains(&joint.child) { goal } else { now },
        )
        .copied()
        .collect();
    // In parallel order parts are held by number, and the root is among them: all are.
    ObjectGoal { root: goal.root, world_from_root: goal_parts[usize::from(goal.root.0)], joint_positions }
}

/// What the motions of a trial would be like with some root, had every gripper taken its part where demonstrations do.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PredictedMotion {
    /// Length of the ways of all grippers, each from when it holds its part (m).
    pub hand_path: f64,
    /// Length of the longest of these ways (m).
    pub longest_hand_path: f64,
    /// Length of the ways of all places to hold, held already or not (m).
    pub swing: f64,
    /// Largest speed of a gripper (m/s).
    pub hand_speed: f64,
    /// Largest moment of the object's weight about the middle of the places held, while not all are (N·m).
    pub moment: f64,
}

const GRAVITY: f64 = 9.81; // m/s²
/// Steps into which a motion is cut to predict it.
const PREDICTED_STEPS: usize = 12;

/// The motions of a trial from `start` to `goal`, which names the root, in this order.
pub fn predict(
    scene: &Scene,
    motion: &MotionConfig,
    order: GraspOrder,
    start: &ObjectState,
    goal: &ObjectGoal,
) -> PredictedMotion {
    let (object, graph) = (&scene.object, &scene.graph);
    let goal_parts = part_poses(object, graph, goal.root, &goal.world_from_root, &goal.joint_positions);
    let sequence = grasp_sequence(graph, goal.root, order);
    let places =
        |parts: &[Pose]| -> Vec<_> { parts.iter().zip(&scene.hold_centers).map(|(part, center)| part * center).collect() };
    let (mut now, mut ways) = (start.clone(), vec![0.0; sequence.len()]);
    let mut predicted = PredictedMotion::default();
    for step in order.steps(sequence.len()) {
        let held = &sequence[..step.end];
        let to = step_goal(object, (goal, &goal_parts), held, &now);
        let parts = part_poses(object, graph, to.root, &to.world_from_root, &to.joint_positions);
        let duration = motion.duration(&now.world_from_parts, &parts);
        let trajectory = ObjectTrajectory::new(object, graph, now, to.clone(), duration);
        let mut before = places(&trajectory.part_poses_at(0.0));
        for i in 1..=PREDICTED_STEPS {
            let poses = trajectory.part_poses_at(duration * i as f64 / PREDICTED_STEPS as f64);
            let after = places(&poses);
            if held.len() < sequence.len() {
                predicted.moment = predicted.moment.max(weight_moment(scene, &poses, held, &after));
            }
            for (part, (before, after)) in before.iter().zip(&after).enumerate() {
                let length = (after - before).norm();
                predicted.swing += length;
                if held.contains(&PartId(part as u16)) {
                    ways[part] += length;
                    predicted.hand_speed = predicted.hand_speed.max(length * PREDICTED_STEPS as f64 / duration);
                }
            }
            before = after;
        }
        now = ObjectState { world_from_parts: parts, joint_positions: to.joint_positions };
    }
    predicted.hand_path = ways.iter().sum();
    predicted.longest_hand_path = ways.iter().copied().fold(0.0, f64::max);
    predicted
}

/// The moment of the object's weight about the middle of the places at which these parts are held (N·m).
fn weight_moment(scene: &Scene, world_from_parts: &[Pose], held: &[PartId], places: &[Point3<f64>]) -> f64 {
    let support = held.iter().map(|part| places[usize::from(part.0)].coords).sum::<Vector3<f64>>() / held.len() as f64;
    let lever = |((part, pose), center): ((&Part, &Pose), &Point3<f64>)| (pose * center - Point3::from(support)) * part.mass;
    let parts = scene.object.parts.iter().zip(world_from_parts).zip(&scene.mass_centers);
    GRAVITY * parts.map(lever).sum::<Vector3<f64>>().xy().norm()
}

/// Another root than the first must have ways that are shorter by this share.
const CLEARLY_SHORTER: f64 = 0.02;
/// The moment that grippers are trusted to hold, per force of a pad (m): between what mostly held and what slipped in
/// `docs/dependency-root.md`, 0.42 (a few slips) and 0.52 N·m (nearly all) at 17.5 N.
const MOMENT_PER_FORCE: f64 = 0.026;

/// The root of a trial: the scene's; for [`Root::Auto`] the shortest [`PredictedMotion::hand_path`] of all that can be held.
///
/// A root whose moment is more than the pads hold is taken only if all are, and then the one of least moment.
pub fn choose_root(scene: &Scene, config: &TrialConfig, order: GraspOrder, start: &ObjectState, goal: &ObjectGoal) -> PartId {
    if let Root::Part(part) = scene.root {
        return part;
    }
    let motion = |part: usize| {
        let root = PartId(part as u16);
        let goal = goal.with_root(&scene.object, &scene.graph, root);
        (root, predict(scene, &config.motion, order, start, &goal))
    };
    let motions: Vec<(PartId, PredictedMotion)> = (0..scene.object.parts.len()).map(motion).collect();
    let least = motions.iter().map(|(_, motion)| motion.moment).fold(f64::INFINITY, f64::min);
    let trusted = least.max(MOMENT_PER_FORCE * config.grasp.closing_force);
    let cost = |(root, motion): &(PartId, PredictedMotion)| {
        let shorter = if root.0 == 0 { 1.0 - CLEARLY_SHORTER } else { 1.0 };
        (motion.hand_path * shorter, *root)
    };
    let held = motions.iter().filter(|(_, motion)| motion.moment <= trusted).map(cost);
    held.reduce(|best, other| if other.0 < best.0 { other } else { best }).map_or(PartId(0), |(_, root)| root)
}
