//! Object-centric control (OCAO; supplement, appendix A, Eq. 1 and 2).
//!
//! From the motion of one part and the changes of all joints to the motion of every part and every gripper.
//! Axes and anchors are those before the motion, in the world frame.

use crate::{
    contact::PartId,
    geometry::{Pose, interpolate, minimum_jerk},
    object::{ArticulatedObject, Joint, JointKind, ObjectGoal, ObjectState},
    object_graph::{ObjectGraph, Step},
};
use nalgebra::{Point3, Translation3, Unit, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// A joint as it lies in the world in the current configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldJoint {
    /// What motion it allows.
    pub kind: JointKind,
    /// The part that the motion is relative to.
    pub parent: PartId,
    /// The part that moves for a positive change.
    pub child: PartId,
    /// A point on the axis, world frame (m).
    pub anchor: Point3<f64>,
    /// The axis, world frame.
    pub axis: Unit<Vector3<f64>>,
}

impl WorldJoint {
    /// The rigid motion that a change of the joint by `delta` (rad or m) gives the child while the parent stands still.
    pub fn motion(&self, delta: f64) -> Pose {
        joint_motion(self.kind, &self.anchor, &self.axis, delta)
    }
}

/// R(d, δ) about the axis through `anchor`, or a slide by δ along it; a fixed joint never moves.
fn joint_motion(kind: JointKind, anchor: &Point3<f64>, axis: &Unit<Vector3<f64>>, delta: f64) -> Pose {
    match kind {
        JointKind::Revolute => {
            let turn = UnitQuaternion::from_axis_angle(axis, delta);
            Pose::from_parts(Translation3::from(anchor.coords - turn * anchor.coords), turn)
        }
        JointKind::Prismatic => Pose::from_parts(Translation3::from(axis.into_inner() * delta), UnitQuaternion::identity()),
        JointKind::Fixed => Pose::identity(),
    }
}

/// The gripper's pose after its part moved, without slip between them (Eq. 1): M′ M⁻¹ G.
pub fn gripper_goal(world_from_part: &Pose, goal_world_from_part: &Pose, world_from_gripper: &Pose) -> Pose {
    goal_world_from_part * (world_from_part.inverse() * world_from_gripper)
}

/// World pose of every part after the root moved to `goal_world_from_root` and every joint by its delta (Eq. 2).
///
/// Outward from the root, Dⱼ = Dᵢ W(δ) and Mⱼ′ = Dⱼ Mⱼ, where Dᵢ = Mᵢ′ Mᵢ⁻¹ is the world-frame motion of part i and W
/// the joint's motion about its axis before the motion; W(−δ) where the edge is walked from child to parent.
///
/// # Shapes
/// `joints` and `joint_deltas` (rad or m) by joint, `world_from_parts` and the result by part. Panics on other lengths.
pub fn goal_part_poses(
    graph: &ObjectGraph,
    joints: &[WorldJoint],
    world_from_parts: &[Pose],
    joint_deltas: &[f64],
    root: PartId,
    goal_world_from_root: &Pose,
) -> Vec<Pose> {
    assert_eq!(world_from_parts.len(), graph.part_count(), "one pose for each part");
    outward_poses(&graph.outward(root), joints, world_from_parts, joint_deltas, root, goal_world_from_root)
}

fn outward_poses(
    steps: &[Step],
    joints: &[WorldJoint],
    world_from_parts: &[Pose],
    joint_deltas: &[f64],
    root: PartId,
    goal_world_from_root: &Pose,
) -> Vec<Pose> {
    assert_eq!(joints.len(), joint_deltas.len(), "one change for each joint");
    let root = usize::from(root.0);
    let mut motions = vec![Pose::identity(); world_from_parts.len()];
    motions[root] = goal_world_from_root * world_from_parts[root].inverse();
    for step in steps {
        let relative = joints[step.joint].motion(step.direction.sign() * joint_deltas[step.joint]);
        let mut motion = motions[usize::from(step.from.0)] * relative;
        motion.rotation.renormalize();
        motions[usize::from(step.to.0)] = motion;
    }
    let mut goals: Vec<Pose> = motions.iter().zip(world_from_parts).map(|(motion, pose)| motion * pose).collect();
    goals[root] = *goal_world_from_root;
    goals
}

/// The joints of an object as they lie in the world when its parts are at `world_from_parts`.
///
/// Part frames coincide with the object frame at zero, so an axis fixed in the object frame is fixed in the parent's.
pub fn world_joints(object: &ArticulatedObject, world_from_parts: &[Pose]) -> Vec<WorldJoint> {
    let place = |joint: &Joint| {
        let world_from_parent = &world_from_parts[usize::from(joint.parent.0)];
        WorldJoint {
            kind: joint.kind,
            parent: joint.parent,
            child: joint.child,
            anchor: world_from_parent * joint.anchor,
            axis: world_from_parent.rotation * joint.axis,
        }
    };
    object.joints.iter().map(place).collect()
}

/// World pose of every part with the root at `world_from_root` and the joints at `joint_positions` (rad or m).
pub fn part_poses(
    object: &ArticulatedObject,
    graph: &ObjectGraph,
    root: PartId,
    world_from_root: &Pose,
    joint_positions: &[f64],
) -> Vec<Pose> {
    assert_eq!(joint_positions.len(), object.joints.len(), "one position for each joint");
    let mut world_from_parts = vec![*world_from_root; object.parts.len()];
    for step in graph.outward(root) {
        let joint = &object.joints[step.joint];
        let position = step.direction.sign() * joint_positions[step.joint];
        world_from_parts[usize::from(step.to.0)] =
            world_from_parts[usize::from(step.from.0)] * joint_motion(joint.kind, &joint.anchor, &joint.axis, position);
    }
    world_from_parts
}

/// Position of every joint (rad or m), measured from part poses; zero for a fixed joint.
///
/// A revolute joint's angle is the twist about its axis, on the turn nearest to the middle of its limits (else to zero).
pub fn joint_positions(object: &ArticulatedObject, world_from_parts: &[Pose]) -> Vec<f64> {
    let measure = |joint: &Joint| {
        let parent_from_child =
            world_from_parts[usize::from(joint.parent.0)].inv_mul(&world_from_parts[usize::from(joint.child.0)]);
        match joint.kind {
            JointKind::Revolute => {
                let turn = parent_from_child.rotation.quaternion();
                let angle = 2.0 * turn.imag().dot(&joint.axis).atan2(turn.w);
                let middle = joint.limits.map_or(0.0, |[lower, upper]| (lower + upper) / 2.0);
                angle + TAU * ((middle - angle) / TAU).round()
            }
            JointKind::Prismatic => parent_from_child.translation.vector.dot(&joint.axis),
            JointKind::Fixed => 0.0,
        }
    };
    object.joints.iter().map(measure).collect()
}

/// The motion of an object from where it really is to its goal, minimum-jerk in time.
///
/// The root's pose and the joint positions are interpolated; Eq. (2) gives every part's pose from its measured start.
#[derive(Debug, Clone)]
pub struct ObjectTrajectory {
    start: ObjectState,
    goal: ObjectGoal,
    joints: Vec<WorldJoint>,
    steps: Vec<Step>,
    duration: f64,
}

impl ObjectTrajectory {
    /// The motion from `start` to `goal` within `duration` (s, positive).
    pub fn new(object: &ArticulatedObject, graph: &ObjectGraph, start: ObjectState, goal: ObjectGoal, duration: f64) -> Self {
        assert!(duration > 0.0, "a motion needs time, not {duration} s");
        assert_eq!(start.joint_positions.len(), goal.joint_positions.len(), "start and goal of the same joints");
        let joints = world_joints(object, &start.world_from_parts);
        let steps = graph.outward(goal.root);
        Self { start, goal, joints, steps, duration }
    }

    /// How long the motion lasts (s).
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Position of every joint (rad or m) at `time` (s), held before zero and after the duration.
    pub fn joint_positions_at(&self, time: f64) -> Vec<f64> {
        let fraction = minimum_jerk(time, self.duration);
        let ends = self.start.joint_positions.iter().zip(&self.goal.joint_positions);
        ends.map(|(start, goal)| start + fraction * (goal - start)).collect()
    }

    /// World pose of every part at `time` (s), held before zero and after the duration.
    pub fn part_poses_at(&self, time: f64) -> Vec<Pose> {
        let fraction = minimum_jerk(time, self.duration);
        let root_start = &self.start.world_from_parts[usize::from(self.goal.root.0)];
        let world_from_root = interpolate(root_start, &self.goal.world_from_root, fraction);
        let ends = self.start.joint_positions.iter().zip(&self.goal.joint_positions);
        let deltas: Vec<f64> = ends.map(|(start, goal)| fraction * (goal - start)).collect();
        outward_poses(&self.steps, &self.joints, &self.start.world_from_parts, &deltas, self.goal.root, &world_from_root)
    }
}
