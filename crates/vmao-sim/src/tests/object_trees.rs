//! Object kinematics against the simulator's, on random trees of up to twelve parts with joints of every kind.

use super::support::configuration;
use crate::convention::{Data, body_pose, free_joint_position};
use crate::scene::Scene;
use crate::simulation::Simulation;
use nalgebra::{Point3, Unit, Vector3};
use std::f64::consts::PI;
use vmao_core::catalogue::CatalogueItem;
use vmao_core::contact::PartId;
use vmao_core::geometry::{Pose, rotation_distance, rotation_exp};
use vmao_core::object::{ArticulatedObject, Joint, JointKind, Part};
use vmao_core::object_centric::{goal_part_poses, gripper_goal, joint_deltas, joint_positions, part_poses, world_joints};
use vmao_core::random::Stream;
use vmao_core::shape::{Shape, Solid};

fn vector(stream: &mut Stream, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| stream.range(-size, size))
}

fn random_pose(stream: &mut Stream) -> Pose {
    Pose::from_parts(vector(stream, 1.0).into(), rotation_exp(&vector(stream, 2.0)))
}

/// Balls on a random tree, joined either way round in no particular order.
pub(super) fn random_tree(stream: &mut Stream, count: u16) -> ArticulatedObject {
    let ball = Solid { shape: Shape::Sphere { radius: 0.01 }, carrier_from_solid: Pose::identity(), color: [0.5; 3] };
    let part = |index: u16| Part { name: format!("part-{index}"), solids: vec![ball.clone()], mass: 0.1 };
    let mut joints = Vec::new();
    for part in 1..count {
        let before = stream.index(usize::from(part)) as u16;
        let (parent, child) = if stream.unit() < 0.5 { (before, part) } else { (part, before) };
        joints.push(Joint {
            name: format!("joint-{part}"),
            kind: JointKind::ALL[stream.index(JointKind::ALL.len())],
            parent: PartId(parent),
            child: PartId(child),
            anchor: Point3::from(vector(stream, 0.5)),
            axis: Unit::new_normalize(vector(stream, 1.0)),
            limits: None,
            damping: 0.01,
            friction: 0.01,
        });
    }
    let order = stream.permutation(joints.len());
    let joints = order.into_iter().map(|index| joints[index].clone()).collect();
    ArticulatedObject { name: "tree".to_owned(), parts: (0..count).map(part).collect(), joints }
}

/// Positions of all joints, often singular ones: none, and half a turn.
fn random_positions(stream: &mut Stream, object: &ArticulatedObject) -> Vec<f64> {
    let mut positions = Vec::new();
    for joint in &object.joints {
        let angle = [0.0, 1e-9, PI - 1e-7, stream.range(-3.1, 3.1), stream.range(-3.1, 3.1)][stream.index(5)];
        match joint.kind {
            JointKind::Fixed => positions.push(0.0),
            JointKind::Ball => positions.extend((vector(stream, 1.0).normalize() * angle).iter()),
            JointKind::Revolute | JointKind::Prismatic => positions.push(angle),
        }
    }
    positions
}

/// Where the simulator puts all parts.
fn simulated(scene: &Scene, data: &mut Data, world_from_first: &Pose, positions: &[f64]) -> Vec<Pose> {
    let at = scene.object_qpos;
    data.qpos_mut()[at..at + 7].copy_from_slice(&free_joint_position(world_from_first));
    scene.set_object_joints(data.qpos_mut(), positions);
    data.forward();
    scene.part_bodies.iter().map(|&body| body_pose(data, body)).collect()
}

#[track_caller]
fn check_same(ours: &[Pose], theirs: &[Pose], what: &str) {
    assert_eq!(ours.len(), theirs.len());
    for (part, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
        let gap = (ours.translation.vector - theirs.translation.vector).norm();
        let turn = rotation_distance(&ours.rotation, &theirs.rotation);
        assert!(gap < 1e-8 && turn < 1e-7, "{what}: part {part} is {gap} m and {turn} rad off");
    }
}

fn scene_of(object: ArticulatedObject) -> Scene {
    Scene::without_arms(&configuration().0, CatalogueItem { object, demonstrations: Vec::new() }).unwrap()
}

#[test]
fn control_from_any_root_ends_where_the_simulator_puts_the_parts() {
    let mut stream = Stream::new(31, &[]);
    let mut kinds = [0; 4];
    for tree in 0..60 {
        let count = 1 + (tree % 12);
        let object = random_tree(&mut stream, count);
        for joint in &object.joints {
            kinds[JointKind::ALL.iter().position(|&kind| kind == joint.kind).unwrap()] += 1;
        }
        let scene = scene_of(object);
        let mut data = Data::new(scene.model.clone());
        let object = &scene.object;
        let [q0, q1] = [0; 2].map(|_| random_positions(&mut stream, object));
        let (first, second) = (random_pose(&mut stream), random_pose(&mut stream));
        let start = simulated(&scene, &mut data, &first, &q0);
        let end = simulated(&scene, &mut data, &second, &q1);
        let grippers: Vec<Pose> = start.iter().map(|part| part * random_pose(&mut stream)).collect();
        for root in 0..count {
            let what = format!("tree {tree} from root {root}");
            let (id, index) = (PartId(root), usize::from(root));
            check_same(&part_poses(object, &scene.graph, id, &start[index], &q0), &start, &what);
            let (joints, deltas) = (world_joints(object, &start), joint_deltas(object, &start, &q0, &q1));
            let goals = goal_part_poses(&scene.graph, &joints, &start, &deltas, id, &end[index]);
            check_same(&goals, &end, &what);
            // A gripper stays where it was on its part.
            for part in 0..start.len() {
                let moved = gripper_goal(&start[part], &goals[part], &grippers[part]);
                let offset = start[part].inverse() * grippers[part];
                check_same(&[end[part].inverse() * moved], &[offset], &what);
            }
        }
        let measured = joint_positions(object, &start);
        check_same(&part_poses(object, &scene.graph, PartId(0), &start[0], &measured), &start, "measured positions");
    }
    assert!(kinds.iter().all(|&count| count > 40), "too few joints of some kind: {kinds:?}");
}

#[test]
fn a_tree_set_into_a_simulation_is_read_back() {
    let mut stream = Stream::new(32, &[]);
    for _ in 0..20 {
        let scene = scene_of(random_tree(&mut stream, 12));
        let positions = random_positions(&mut stream, &scene.object);
        let simulation = Simulation::new(&scene, configuration().1.osc, &random_pose(&mut stream), &positions);
        let state = simulation.object_state();
        for (set, read) in positions.iter().zip(&state.joint_positions) {
            assert!((set - read).abs() < 1e-9, "{set} was read back as {read}");
        }
    }
}

#[test]
fn a_spinning_ball_joint_is_stopped_at_its_limit() {
    let mut stream = Stream::new(33, &[]);
    let mut object = random_tree(&mut stream, 2);
    let ball = Joint { kind: JointKind::Ball, anchor: Point3::new(0.1, 0.0, 0.0), ..object.joints[0].clone() };
    object.joints[0] = Joint { limits: Some([0.0, 0.8]), damping: 1e-4, friction: 1e-4, ..ball };
    let scene = scene_of(object);
    let mut simulation = Simulation::new(&scene, configuration().1.osc, &Pose::translation(0.0, 0.0, 2.0), &[0.0; 3]);
    let (_, dof) = scene.joint_addresses[0].unwrap();
    simulation.data.qvel_mut()[dof] = 6.0;
    let mut largest = 0.0_f64;
    for _ in 0..50 {
        simulation.wait(0.01);
        largest = largest.max(Vector3::from_column_slice(&simulation.object_state().joint_positions).norm());
    }
    assert!((0.75..0.85).contains(&largest), "the ball turned by {largest} rad, its limit is 0.8");
}
