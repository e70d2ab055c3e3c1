//! Object-centric control against plain forward kinematics: homogeneous matrices, Rodrigues' formula, products of
//! exponentials from part 0. It shares no code and no formulation with the quaternion motions under test.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, Rotation3, Unit, UnitQuaternion, Vector3};
use proptest::prelude::{ProptestConfig, Strategy, any, prop_oneof, proptest};
use std::f64::consts::{PI, TAU};
use vmao_core::{
    contact::PartId,
    geometry::{Pose, pose},
    object::{ArticulatedObject, Joint, JointKind, ObjectGoal, ObjectState, Part, by_joint},
    object_centric::{
        ObjectTrajectory, WorldJoint, goal_part_poses, gripper_goal, joint_deltas, joint_errors, joint_positions, part_poses,
        world_joints,
    },
    object_graph::ObjectGraph,
    random::Stream,
};

const TOLERANCE: f64 = 1e-9;

/// A tree of joints given in the world at zero, and the parts' frames there (anywhere: they need not coincide).
struct Mechanism {
    parts_at_zero: Vec<Matrix4<f64>>,
    joints: Vec<MechanismJoint>,
}

/// Kind, parent, child, anchor and axis, in the world at zero.
type MechanismJoint = (JointKind, usize, usize, Vector3<f64>, Vector3<f64>);

#[derive(Debug, Clone, Copy)]
enum Topology {
    Chain,
    Star,
    Random,
}

impl Mechanism {
    fn random(stream: &mut Stream, count: usize, topology: Topology) -> Self {
        let parts_at_zero = (0..count).map(|_| random_pose(stream).to_homogeneous()).collect();
        let mut joints = Vec::new();
        for part in 1..count {
            let before = match topology {
                Topology::Chain => part - 1,
                Topology::Star => 0,
                Topology::Random => stream.index(part),
            };
            let kinds = [JointKind::Revolute, JointKind::Revolute, JointKind::Ball, JointKind::Prismatic, JointKind::Fixed];
            let kind = kinds[stream.index(kinds.len())];
            let (parent, child) = if stream.unit() < 0.5 { (before, part) } else { (part, before) };
            joints.push((kind, parent, child, random_vector(stream, 10.0), random_vector(stream, 1.0).normalize()));
        }
        // Joints in no particular order, so that nothing can rely on parents coming first.
        let order = stream.permutation(joints.len());
        Self { parts_at_zero, joints: order.into_iter().map(|joint| joints[joint]).collect() }
    }

    fn kinds(&self) -> impl Iterator<Item = JointKind> {
        self.joints.iter().map(|joint| joint.0)
    }

    /// From one position of all joints to another: differences, and for balls the logarithm of a product of half angles.
    fn deltas(&self, base: &Matrix4<f64>, from: &[f64], to: &[f64]) -> Vec<f64> {
        let (before, mut deltas) = (self.motions(base, from), Vec::new());
        let both = by_joint(self.kinds(), from).into_iter().zip(by_joint(self.kinds(), to));
        for (&(kind, parent, ..), (from, to)) in self.joints.iter().zip(both) {
            if kind == JointKind::Ball {
                let world_from_parent = before[parent].fixed_view::<3, 3>(0, 0).into_owned();
                let change = half_turn(to) * half_turn(from).conjugate();
                let angle = 2.0 * change.imag().norm().atan2(change.w);
                let axis = change.imag().try_normalize(0.0).unwrap_or_default();
                deltas.extend((world_from_parent * axis * angle).iter());
            } else {
                deltas.push(to[0] - from[0]);
            }
        }
        deltas
    }

    /// The motion of every part away from its place at zero, with part 0 moved by `base`.
    fn motions(&self, base: &Matrix4<f64>, positions: &[f64]) -> Vec<Matrix4<f64>> {
        let mut motions: Vec<Option<Matrix4<f64>>> = vec![None; self.parts_at_zero.len()];
        motions[0] = Some(*base);
        while motions.iter().any(Option::is_none) {
            for (&(kind, parent, child, anchor, axis), position) in self.joints.iter().zip(by_joint(self.kinds(), positions)) {
                let motion = exponential(kind, &anchor, &axis, position);
                match (motions[parent], motions[child]) {
                    (Some(known), None) => motions[child] = Some(known * motion),
                    (None, Some(known)) => motions[parent] = Some(known * motion.try_inverse().unwrap()),
                    _ => {}
                }
            }
        }
        motions.into_iter().flatten().collect()
    }

    fn parts(&self, base: &Matrix4<f64>, positions: &[f64]) -> Vec<Matrix4<f64>> {
        self.motions(base, positions).iter().zip(&self.parts_at_zero).map(|(motion, part)| motion * part).collect()
    }

    fn world_joints(&self, base: &Matrix4<f64>, positions: &[f64]) -> Vec<WorldJoint> {
        let motions = self.motions(base, positions);
        let place = |&(kind, parent, child, anchor, axis): &MechanismJoint| WorldJoint {
            kind,
            parent: PartId(parent as u16),
            child: PartId(child as u16),
            anchor: motions[parent].transform_point(&Point3::from(anchor)),
            axis: Unit::new_normalize(motions[parent].transform_vector(&axis)),
        };
        self.joints.iter().map(place).collect()
    }

    fn graph(&self) -> ObjectGraph {
        let edges: Vec<_> = self.joints.iter().map(|joint| (PartId(joint.1 as u16), PartId(joint.2 as u16))).collect();
        ObjectGraph::new(self.parts_at_zero.len(), &edges).unwrap()
    }
}

/// Cosine and sine of half the angle of a rotation vector, as a quaternion.
fn half_turn(vector: &[f64]) -> Quaternion<f64> {
    let vector = Vector3::from_column_slice(vector);
    let half = vector.norm() / 2.0;
    Quaternion::from_parts(half.cos(), vector.try_normalize(0.0).unwrap_or_default() * half.sin())
}

/// The rotation matrix of a rotation vector.
fn rodrigues(vector: &Vector3<f64>) -> Matrix3<f64> {
    let Some(axis) = vector.try_normalize(0.0) else { return Matrix3::identity() };
    let (k, angle) = (axis.cross_matrix(), vector.norm());
    Matrix3::identity() + k * angle.sin() + k * k * (1.0 - angle.cos())
}

fn exponential(kind: JointKind, anchor: &Vector3<f64>, axis: &Vector3<f64>, position: &[f64]) -> Matrix4<f64> {
    let mut matrix = Matrix4::identity();
    let rotation = match kind {
        JointKind::Revolute => rodrigues(&(axis * position[0])),
        JointKind::Ball => rodrigues(&Vector3::from_column_slice(position)),
        JointKind::Prismatic | JointKind::Fixed => Matrix3::identity(),
    };
    matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&(anchor - rotation * anchor));
    if kind == JointKind::Prismatic {
        matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&(axis * position[0]));
    }
    matrix
}

fn random_vector(stream: &mut Stream, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| stream.range(-size, size))
}

fn random_pose(stream: &mut Stream) -> Pose {
    pose(random_vector(stream, 5.0).into(), [stream.normal(), stream.normal(), stream.normal(), stream.normal()])
}

fn from_matrix(matrix: &Matrix4<f64>) -> Pose {
    let rotation = Rotation3::from_matrix_unchecked(matrix.fixed_view::<3, 3>(0, 0).into_owned());
    Pose::from_parts(matrix.fixed_view::<3, 1>(0, 3).into_owned().into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Positions of joints of these kinds, often at singular angles.
fn positions(stream: &mut Stream, kinds: impl Iterator<Item = JointKind>) -> Vec<f64> {
    let singular = [0.0, PI, -PI, TAU, PI / 2.0, 1e-9, PI - 1e-9];
    let mut positions = Vec::new();
    for kind in kinds {
        let angle = if stream.unit() < 0.4 { singular[stream.index(7)] } else { stream.range(-7.0, 7.0) };
        if kind == JointKind::Ball {
            positions.extend((random_vector(stream, 1.0).normalize() * angle).iter());
        } else {
            positions.push(angle);
        }
    }
    positions
}

#[track_caller]
fn check(poses: &[Pose], expected: &[Matrix4<f64>]) {
    assert_eq!(poses.len(), expected.len());
    for (part, (pose, expected)) in poses.iter().zip(expected).enumerate() {
        let error = (pose.to_homogeneous() - expected).abs().max();
        assert!(error < TOLERANCE, "part {part} is off by {error:e}");
    }
}

fn topology() -> impl Strategy<Value = Topology> {
    prop_oneof![
        proptest::strategy::Just(Topology::Chain),
        proptest::strategy::Just(Topology::Star),
        proptest::strategy::Just(Topology::Random)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_root_gives_the_forward_kinematics(seed in any::<u64>(), count in 1_usize..=12, topology in topology()) {
        let mut stream = Stream::new(seed, &[]);
        let mechanism = Mechanism::random(&mut stream, count, topology);
        let (before, after) = (random_pose(&mut stream).to_homogeneous(), random_pose(&mut stream).to_homogeneous());
        let (q0, q1) = (positions(&mut stream, mechanism.kinds()), positions(&mut stream, mechanism.kinds()));
        let start: Vec<Pose> = mechanism.parts(&before, &q0).iter().map(from_matrix).collect();
        let expected = mechanism.parts(&after, &q1);
        let joints = mechanism.world_joints(&before, &q0);
        let deltas = mechanism.deltas(&before, &q0, &q1);
        for root in 0..count {
            let goal = from_matrix(&expected[root]);
            let goals = goal_part_poses(&mechanism.graph(), &joints, &start, &deltas, PartId(root as u16), &goal);
            check(&goals, &expected);
        }
    }

    #[test]
    fn grippers_keep_their_offset_and_motions_compose_and_invert(
        seed in any::<u64>(), count in 2_usize..=12, topology in topology(), root in 0_usize..12,
    ) {
        let mut stream = Stream::new(seed, &[1]);
        let mechanism = Mechanism::random(&mut stream, count, topology);
        let (graph, root) = (mechanism.graph(), root % count);
        let before = random_pose(&mut stream).to_homogeneous();
        let [q0, q1, q2] = [0; 3].map(|_| positions(&mut stream, mechanism.kinds()));
        let parts: Vec<Pose> = mechanism.parts(&before, &q0).iter().map(from_matrix).collect();
        let start_joints = mechanism.world_joints(&before, &q0);
        let (middle_root, end_root) = (random_pose(&mut stream), random_pose(&mut stream));
        let id = PartId(root as u16);
        let middle = goal_part_poses(&graph, &start_joints, &parts, &mechanism.deltas(&before, &q0, &q1), id, &middle_root);
        // Where part 0's frame at zero went.
        let base = middle[0].to_homogeneous() * mechanism.parts_at_zero[0].try_inverse().unwrap();

        let grippers: Vec<Pose> = parts.iter().map(|part| part * random_pose(&mut stream)).collect();
        for part in 0..count {
            let moved = gripper_goal(&parts[part], &middle[part], &grippers[part]);
            let offset = parts[part].to_homogeneous().try_inverse().unwrap() * grippers[part].to_homogeneous();
            check(&[moved], &[middle[part].to_homogeneous() * offset]);
        }

        // The joints after the first motion: anchors and axes ride on their parents.
        let carried: Vec<WorldJoint> = start_joints.iter().map(|joint| {
            let parent = usize::from(joint.parent.0);
            let motion = middle[parent] * parts[parent].inverse();
            WorldJoint { anchor: motion * joint.anchor, axis: motion.rotation * joint.axis, ..*joint }
        }).collect();
        let end = goal_part_poses(&graph, &carried, &middle, &mechanism.deltas(&base, &q1, &q2), id, &end_root);
        let at_once = goal_part_poses(&graph, &start_joints, &parts, &mechanism.deltas(&before, &q0, &q2), id, &end_root);
        check(&end, &at_once.iter().map(Pose::to_homogeneous).collect::<Vec<_>>());
        let back = goal_part_poses(&graph, &carried, &middle, &mechanism.deltas(&base, &q1, &q0), id, &parts[root]);
        check(&back, &parts.iter().map(Pose::to_homogeneous).collect::<Vec<_>>());
    }

    #[test]
    fn an_objects_kinematics_measure_and_trajectory_agree(seed in any::<u64>(), count in 1_usize..=12, root in 0_usize..12) {
        let mut stream = Stream::new(seed, &[2]);
        let object = random_object(&mut stream, count);
        let (graph, root) = (ObjectGraph::of(&object).unwrap(), PartId((root % count) as u16));
        let draw = |stream: &mut Stream| -> Vec<f64> {
            // Within half a turn, beyond which no measurement can tell angles apart.
            let draw_joint = |joint: &Joint| match joint.kind {
                JointKind::Fixed => vec![0.0],
                JointKind::Ball => {
                    let angle = [0.0, 1e-9, PI - 1e-6, stream.range(0.0, 3.1)][stream.index(4)];
                    (random_vector(stream, 1.0).normalize() * angle).iter().copied().collect()
                }
                JointKind::Revolute | JointKind::Prismatic => vec![stream.range(-3.0, 3.0)],
            };
            object.joints.iter().flat_map(draw_joint).collect()
        };
        let (q0, q1) = (draw(&mut stream), draw(&mut stream));
        let base = random_pose(&mut stream);
        let start = part_poses(&object, &graph, PartId(0), &base, &q0);
        check(&part_poses(&object, &graph, root, &start[usize::from(root.0)], &q0),
              &start.iter().map(Pose::to_homogeneous).collect::<Vec<_>>());
        for (measured, joint) in joint_positions(&object, &start).iter().zip(&q0) {
            assert!((measured - joint).abs() < TOLERANCE, "{measured} {joint}");
        }
        let deltas = joint_deltas(&object, &start, &q0, &q1);
        let goals = goal_part_poses(&graph, &world_joints(&object, &start), &start, &deltas, root, &start[usize::from(root.0)]);
        check(&goals, &part_poses(&object, &graph, root, &start[usize::from(root.0)], &q1).iter().map(Pose::to_homogeneous).collect::<Vec<_>>());
        let moved = joint_errors(&object, &q1, &joint_positions(&object, &goals));
        assert!(moved.iter().all(|&error| error < 1e-7), "{moved:?}");

        let goal_root = random_pose(&mut stream);
        let state = ObjectState { world_from_parts: start.clone(), joint_positions: q0.clone() };
        let goal = ObjectGoal { root, world_from_root: goal_root, joint_positions: q1.clone() };
        let trajectory = ObjectTrajectory::new(&object, &graph, state, goal, 2.0);
        let matrices = |poses: Vec<Pose>| poses.iter().map(Pose::to_homogeneous).collect::<Vec<_>>();
        check(&trajectory.part_poses_at(-1.0), &matrices(start));
        check(&trajectory.part_poses_at(2.0), &matrices(part_poses(&object, &graph, root, &goal_root, &q1)));
        // In between the parts are where forward kinematics puts them: the joints never come apart.
        let time = stream.range(0.0, 2.0);
        let between = trajectory.part_poses_at(time);
        let root_pose = between[usize::from(root.0)];
        check(&between, &matrices(part_poses(&object, &graph, root, &root_pose, &trajectory.joint_positions_at(time))));

        // The same goal from any other root, and back.
        let goal = ObjectGoal { root, world_from_root: goal_root, joint_positions: q1.clone() };
        let at = |goal: &ObjectGoal| part_poses(&object, &graph, goal.root, &goal.world_from_root, &goal.joint_positions);
        for other in (0..count).map(|part| PartId(part as u16)) {
            let told = goal.with_root(&object, &graph, other);
            assert_eq!((told.root, &told.joint_positions), (other, &goal.joint_positions));
            check(&at(&told), &matrices(at(&goal)));
            check(&[told.with_root(&object, &graph, root).world_from_root], &matrices(vec![goal_root]));
        }
        assert_eq!(goal.with_root(&object, &graph, root), goal);
    }
}

fn random_object(stream: &mut Stream, count: usize) -> ArticulatedObject {
    let mechanism = Mechanism::random(stream, count, Topology::Random);
    let part = |index| Part { name: format!("part-{index}"), solids: Vec::new(), mass: 0.1 };
    let joint = |(index, &(kind, parent, child, anchor, axis)): (usize, &MechanismJoint)| Joint {
        name: format!("joint-{index}"),
        kind,
        parent: PartId(parent as u16),
        child: PartId(child as u16),
        anchor: Point3::from(anchor),
        axis: Unit::new_normalize(axis),
        limits: None,
        damping: 0.0,
        friction: 0.0,
    };
    let joints = mechanism.joints.iter().enumerate().map(joint).collect();
    ArticulatedObject { name: "random".into(), parts: (0..count).map(part).collect(), joints }
}

/// Parts at x = 0 and x = 2 (m), joined half way between them, about z if the joint has an axis.
fn two_parts(kind: JointKind) -> (WorldJoint, ObjectGraph, [Pose; 2]) {
    let (parent, child) = (PartId(0), PartId(1));
    let joint = WorldJoint { kind, parent, child, anchor: Point3::new(1.0, 0.0, 0.0), axis: Vector3::z_axis() };
    let at = |x| pose([x, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]);
    (joint, ObjectGraph::new(2, &[(parent, child)]).unwrap(), [at(0.0), at(2.0)])
}

#[test]
fn a_hinge_opened_by_a_right_angle_has_its_textbook_poses() {
    // b is hinged to a at (1, 0, 0) about z; a quarter turn takes b's origin from (2, 0, 0) to (1, 1, 0).
    let (joint, graph, start) = two_parts(JointKind::Revolute);
    let goals = goal_part_poses(&graph, &[joint], &start, &[PI / 2.0], PartId(0), &start[0]);
    assert!((goals[1].translation.vector - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-15);
    // With b the root and standing still, a turns the other way: its origin goes to (1, 1, 0) as well.
    let goals = goal_part_poses(&graph, &[joint], &start, &[PI / 2.0], PartId(1), &start[1]);
    assert!((goals[0].translation.vector - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-15);
    assert!((goals[0].rotation.angle() - PI / 2.0).abs() < 1e-15 && goals[0].rotation.axis().unwrap().z < 0.0);
}

#[test]
fn a_ball_joint_turned_about_its_anchor_has_its_textbook_poses() {
    let (joint, graph, start) = two_parts(JointKind::Ball);
    // A quarter turn about -y takes the child's arm from +x to +z; the axis of the joint plays no part.
    let quarter = [0.0, -PI / 2.0, 0.0];
    let goals = goal_part_poses(&graph, &[joint], &start, &quarter, PartId(0), &start[0]);
    assert!((goals[1].translation.vector - Vector3::new(1.0, 0.0, 1.0)).norm() < 1e-15);
    // With the child as the standing root, the parent's arm goes from -x to ... the inverse turn of it: +z, from below.
    let goals = goal_part_poses(&graph, &[joint], &start, &quarter, PartId(1), &start[1]);
    assert!((goals[0].translation.vector - Vector3::new(1.0, 0.0, 1.0)).norm() < 1e-15, "{}", goals[0]);
    // Half a turn either way is the same turn, and no turn is none.
    for (vector, expected) in [([PI, 0.0, 0.0], 2.0), ([-PI, 0.0, 0.0], 2.0), ([0.0; 3], 2.0), ([0.0, PI, 0.0], 0.0)] {
        let goals = goal_part_poses(&graph, &[joint], &start, &vector, PartId(0), &start[0]);
        assert!((goals[1].translation.vector - Vector3::new(expected, 0.0, 0.0)).norm() < 1e-15);
    }
}

#[test]
#[should_panic(expected = "coordinates too many")]
fn a_position_with_too_many_coordinates_is_refused() {
    by_joint([JointKind::Ball, JointKind::Fixed].into_iter(), &[0.0; 5]);
}

#[test]
fn a_world_joint_lies_where_its_parent_carried_it() {
    let mut object = random_object(&mut Stream::new(5, &[]), 2);
    object.joints[0] = Joint {
        kind: JointKind::Revolute,
        parent: PartId(0),
        child: PartId(1),
        limits: Some([3.0, 6.0]),
        ..object.joints[0].clone()
    };
    let graph = ObjectGraph::of(&object).unwrap();
    let base = pose([0.1, -0.4, 0.3], [0.3, 0.5, -0.2, 0.7]);
    let parts = part_poses(&object, &graph, PartId(0), &base, &[4.5]);
    let joint = world_joints(&object, &parts)[0];
    assert!((joint.anchor - base * object.joints[0].anchor).norm() < 1e-12);
    // The anchor is common to both parts, and the measured angle lies on the limits' turn, not in (-π, π].
    assert!((joint.anchor - parts[1] * object.joints[0].anchor).norm() < 1e-12);
    assert!((joint_positions(&object, &parts)[0] - 4.5).abs() < 1e-12);
}
