//! The dependency root: which part's motion is given, so that all others follow from it by Eq. (2), and who is grasped first.

use crate::error::Error;
use crate::execution::MotionConfig;
use crate::scene::Scene;
use vmao_core::contact::PartId;
use vmao_core::geometry::Pose;
use vmao_core::object::{ArticulatedObject, ObjectGoal, ObjectState};
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
    /// Largest horizontal distance from the table's centre at which a part waits for its gripper (m).
    pub waiting_distance: f64,
}

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
        for part in &sequence[step.start..] {
            let place = places(&now.world_from_parts)[usize::from(part.0)];
            predicted.waiting_distance = predicted.waiting_distance.max(place.coords.xy().norm());
        }
        let held = &sequence[..step.end];
        let to = step_goal(object, (goal, &goal_parts), held, &now);
        let parts = part_poses(object, graph, to.root, &to.world_from_root, &to.joint_positions);
        let duration = motion.duration(&now.world_from_parts, &parts);
        let trajectory = ObjectTrajectory::new(object, graph, now, to.clone(), duration);
        let mut before = places(&trajectory.part_poses_at(0.0));
        for i in 1..=PREDICTED_STEPS {
            let after = places(&trajectory.part_poses_at(duration * i as f64 / PREDICTED_STEPS as f64));
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

/// Another root than the first must be better by this share.
const CLEARLY_BETTER: f64 = 0.02;

/// The root of a trial: the scene's, or of all parts the one of least [`PredictedMotion::hand_path`].
pub(crate) fn choose(scene: &Scene, motion: &MotionConfig, order: GraspOrder, start: &ObjectState, goal: &ObjectGoal) -> PartId {
    let root = match scene.root {
        Root::Part(part) => return part,
        Root::Auto => PartId(0),
    };
    let cost = |root: PartId| {
        let goal = goal.with_root(&scene.object, &scene.graph, root);
        predict(scene, motion, order, start, &goal).hand_path
    };
    let first = (cost(root) * (1.0 - CLEARLY_BETTER), root);
    let others = (1..scene.object.parts.len()).map(|part| PartId(part as u16)).map(|part| (cost(part), part));
    others.fold(first, |best, other| if other.0 < best.0 { other } else { best }).1
}
