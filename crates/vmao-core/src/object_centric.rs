//! Object-centric control (OCAO; supplement, appendix A, Eq. 1 and 2).
//!
//! From the motion of one part and the changes of all joints to the motion of every part and every gripper.
//! Axes and anchors are those before the motion, in the world frame. Positions and changes of joints are flat lists: one
//! coordinate a joint, three of a rotation vector a ball joint.

use crate::{
    contact::PartId,
    geometry::{Pose, interpolate, minimum_jerk, rotation_exp, rotation_log},
    object::{ArticulatedObject, Joint, JointKind, ObjectGoal, ObjectState, by_joint},
    object_graph::{Direction, ObjectGraph, Step},
};
use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};
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
    /// A point on the axis, or the centre of a ball joint, world frame (m).
    pub anchor: Point3<f64>,
    /// The axis, world frame; ignored by joints that have none.
    pub axis: Unit<Vector3<f64>>,
}

impl WorldJoint {
    /// The rigid motion that a change of the joint gives the child while the parent stands still.
    ///
    /// `delta` in rad or m; of a ball joint, the rotation vector of the child's turn in the world frame.
    pub fn motion(&self, delta: &[f64]) -> Pose {
        joint_motion(self.kind, &self.anchor, &self.axis, Direction::ParentToChild, delta)
    }
}

/// W(δ): R(d, δ) about the axis through `anchor`, a slide by δ along it, or a turn by exp(δ) about `anchor`; a fixed joint
/// never moves. W(−δ), its inverse, where the joint is walked from child to parent.
fn joint_motion(kind: JointKind, anchor: &Point3<f64>, axis: &Unit<Vector3<f64>>, direction: Direction, delta: &[f64]) -> Pose {
    let sign = direction.sign();
    let about = |turn: UnitQuaternion<f64>| Pose::from_parts((anchor.coords - turn * anchor.coords).into(), turn);
    match kind {
        JointKind::Revolute => about(UnitQuaternion::from_axis_angle(axis, sign * delta[0])),
        JointKind::Ball => about(rotation_exp(&(Vector3::from_column_slice(delta) * sign))),
        JointKind::Prismatic => Pose::from_parts((axis.into_inner() * (sign * delta[0])).into(), UnitQuaternion::identity()),
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
/// `joints` by joint, `joint_deltas` flat as for [`WorldJoint::motion`], `world_from_parts` and the result by part. Panics
/// on other lengths.
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
    let deltas = by_joint(joints.iter().map(|joint| joint.kind), joint_deltas);
    let root = usize::from(root.0);
    let mut motions = vec![Pose::identity(); world_from_parts.len()];
    motions[root] = goal_world_from_root * world_from_parts[root].inverse();
    for step in steps {
        let joint = &joints[step.joint];
        let relative = joint_motion(joint.kind, &joint.anchor, &joint.axis, step.direction, deltas[step.joint]);
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

/// World pose of every part with the root at `world_from_root` and the joints at `joint_positions` (rad or m, flat).
pub fn part_poses(
    object: &ArticulatedObject,
    graph: &ObjectGraph,
    root: PartId,
    world_from_root: &Pose,
    joint_positions: &[f64],
) -> Vec<Pose> {
    let positions = by_joint(object.joints.iter().map(|joint| joint.kind), joint_positions);
    let mut world_from_parts = vec![*world_from_root; object.parts.len()];
    for step in graph.outward(root) {
        let joint = &object.joints[step.joint];
        world_from_parts[usize::from(step.to.0)] = world_from_parts[usize::from(step.from.0)]
            * joint_motion(joint.kind, &joint.anchor, &joint.axis, step.direction, positions[step.joint]);
    }
    world_from_parts
}

/// Position of every joint (rad or m, flat), measured from part poses; zero for a fixed joint.
///
/// A revolute joint's angle is the twist about its axis, on the turn nearest to the middle of its limits (else to zero). A
/// ball joint's rotation vector is the shortest, of at most π.
pub fn joint_positions(object: &ArticulatedObject, world_from_parts: &[Pose]) -> Vec<f64> {
    let mut positions = Vec::with_capacity(object.joints.len());
    for joint in &object.joints {
        let parent_from_child =
            world_from_parts[usize::from(joint.parent.0)].inv_mul(&world_from_parts[usize::from(joint.child.0)]);
        match joint.kind {
            JointKind::Revolute => {
                let turn = parent_from_child.rotation.quaternion();
                let angle = 2.0 * turn.imag().dot(&joint.axis).atan2(turn.w);
                let middle = joint.limits.map_or(0.0, |[lower, upper]| (lower + upper) / 2.0);
                positions.push(angle + TAU * ((middle - angle) / TAU).round());
            }
            JointKind::Ball => positions.extend(rotation_log(&parent_from_child.rotation).iter()),
            JointKind::Prismatic => positions.push(parent_from_child.translation.vector.dot(&joint.axis)),
            JointKind::Fixed => positions.push(0.0),
        }
    }
    positions
}

/// The turn from one position of a ball joint to another, as a rotation vector in its parent's frame: log(exp b exp(−a)).
pub fn ball_change(from: &[f64], to: &[f64]) -> Vector3<f64> {
    let turn = |position: &[f64]| rotation_exp(&Vector3::from_column_slice(position));
    rotation_log(&(turn(to) * turn(from).inverse()))
}

/// The changes that take the joints from one position to another, flat as for [`WorldJoint::motion`].
///
/// `world_from_parts` are the parts' poses before the change: a ball joint's turn rides on its parent.
pub fn joint_deltas(object: &ArticulatedObject, world_from_parts: &[Pose], from: &[f64], to: &[f64]) -> Vec<f64> {
    let mut deltas = Vec::with_capacity(from.len());
    for ((joint, from), (_, to)) in object.positions_by_joint(from).zip(object.positions_by_joint(to)) {
        if joint.kind == JointKind::Ball {
            let world_from_parent = world_from_parts[usize::from(joint.parent.0)].rotation;
            deltas.extend((world_from_parent * ball_change(from, to)).iter());
        } else {
            deltas.push(to[0] - from[0]);
        }
    }
    deltas
}

/// How far each joint is from where it shall be (rad or m, none negative): one number a joint, also a ball joint.
pub fn joint_errors(object: &ArticulatedObject, wanted: &[f64], is: &[f64]) -> Vec<f64> {
    let both = object.positions_by_joint(wanted).zip(object.positions_by_joint(is));
    both.map(|((joint, wanted), (_, is))| match joint.kind {
        JointKind::Ball => ball_change(is, wanted).norm(),
        JointKind::Revolute | JointKind::Prismatic | JointKind::Fixed => (wanted[0] - is[0]).abs(),
    })
    .collect()
}

impl ObjectGoal {
    /// The same goal configuration spoken of with another dependency root: that part's pose at the goal, the same joints.
    pub fn with_root(&self, object: &ArticulatedObject, graph: &ObjectGraph, root: PartId) -> Self {
        let joint_positions = self.joint_positions.clone();
        if root == self.root {
            return Self { root, world_from_root: self.world_from_root, joint_positions };
        }
        let parts = part_poses(object, graph, self.root, &self.world_from_root, &joint_positions);
        Self { root, world_from_root: parts[usize::from(root.0)], joint_positions }
    }
}

/// The motion of an object from where it really is to its goal, minimum-jerk in time.
///
/// The root's pose and the joint positions are interpolated; Eq. (2) gives every part's pose from its measured start.
#[derive(Debug, Clone)]
pub struct ObjectTrajectory {
    start: ObjectState,
    goal: ObjectGoal,
    joints: Vec<WorldJoint>,
    /// Of the whole motion.
    deltas: Vec<f64>,
    steps: Vec<Step>,
    duration: f64,
}

impl ObjectTrajectory {
    /// The motion from `start` to `goal` within `duration` (s, positive).
    pub fn new(object: &ArticulatedObject, graph: &ObjectGraph, start: ObjectState, goal: ObjectGoal, duration: f64) -> Self {
        assert!(duration > 0.0, "a motion needs time, not {duration} s");
        let joints = world_joints(object, &start.world_from_parts);
        let deltas = joint_deltas(object, &start.world_from_parts, &start.joint_positions, &goal.joint_positions);
        let steps = graph.outward(goal.root);
        Self { start, goal, joints, deltas, steps, duration }
    }

    /// How long the motion lasts (s).
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Position of every joint (rad or m, flat) at `time` (s), held before zero and after the duration.
    pub fn joint_positions_at(&self, time: f64) -> Vec<f64> {
        let fraction = minimum_jerk(time, self.duration);
        let kinds = || self.joints.iter().map(|joint| joint.kind);
        let ends = by_joint(kinds(), &self.start.joint_positions).into_iter().zip(by_joint(kinds(), &self.goal.joint_positions));
        let mut positions = Vec::with_capacity(self.deltas.len());
        for (kind, (start, goal)) in kinds().zip(ends) {
            if kind == JointKind::Ball {
                let part_way = rotation_exp(&(ball_change(start, goal) * fraction));
                let position = rotation_log(&(part_way * rotation_exp(&Vector3::from_column_slice(start))));
                positions.extend(position.iter());
            } else {
                positions.push(start[0] + fraction * (goal[0] - start[0]));
            }
        }
        positions
    }

    /// World pose of every part at `time` (s), held before zero and after the duration.
    pub fn part_poses_at(&self, time: f64) -> Vec<Pose> {
        let fraction = minimum_jerk(time, self.duration);
        let root_start = &self.start.world_from_parts[usize::from(self.goal.root.0)];
        let world_from_root = interpolate(root_start, &self.goal.world_from_root, fraction);
        let deltas: Vec<f64> = self.deltas.iter().map(|delta| fraction * delta).collect();
        outward_poses(&self.steps, &self.joints, &self.start.world_from_parts, &deltas, self.goal.root, &world_from_root)
    }
}
