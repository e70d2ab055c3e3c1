//! The robots' descriptions against the published tables of their makers and of the identified inertias.

use nalgebra::{Point3, Vector3};
use vmao_core::robots::{RobotModel, SLOTS, panda, sawyer};

fn all() -> Vec<RobotModel> {
    [panda()].into_iter().chain(SLOTS.map(sawyer)).collect()
}

#[test]
fn the_pandas_joint_limits_are_the_published_ones() {
    let ranges = [
        (-2.8973, 2.8973),
        (-1.7628, 1.7628),
        (-2.8973, 2.8973),
        (-3.0718, -0.0698),
        (-2.8973, 2.8973),
        (-0.0175, 3.7525),
        (-2.8973, 2.8973),
    ];
    let robot = panda();
    let found: Vec<(f64, f64)> = robot.joints.iter().map(|joint| (joint.range[0], joint.range[1])).collect();
    assert_eq!(found, ranges);
    let limits = |limit: fn(&vmao_core::robots::ArmJoint) -> f64| robot.joints.iter().map(limit).collect::<Vec<f64>>();
    assert_eq!(limits(|joint| joint.max_torque), [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]);
    assert_eq!(limits(|joint| joint.max_velocity), [2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]);
    assert_eq!(limits(|joint| joint.max_acceleration), [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]);
    assert_eq!((robot.gripper.travel, robot.gripper.max_opening()), (0.04, 0.08));
    // The hand's continuous force is 70 N: 35 N a finger, below the 100 N of the newer description's limit.
    assert!(robot.gripper.max_force <= 35.0);
}

#[test]
fn the_pandas_masses_are_the_identified_ones() {
    let robot = panda();
    let masses: Vec<f64> = robot.joints.iter().map(|joint| joint.link.inertial.mass).collect();
    assert_eq!(masses, [4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522]);
    assert_eq!((robot.base.inertial.mass, robot.gripper.hand.inertial.mass), (0.629769, 0.73));
    assert!(robot.gripper.fingers.iter().all(|finger| finger.link.inertial.mass == 0.015));
}

#[test]
fn every_inertia_is_that_of_a_real_body() {
    for robot in all() {
        let links = robot.joints.iter().map(|joint| &joint.link).chain([&robot.base, &robot.gripper.hand]);
        for link in links.chain(robot.gripper.fingers.iter().map(|finger| &finger.link)) {
            let moments = link.inertial.inertia.symmetric_eigenvalues();
            assert_eq!(link.inertial.inertia, link.inertial.inertia.transpose(), "{} is not symmetric", link.name);
            assert!(moments.min() > 0.0, "{}: {moments}", link.name);
            let excess = moments.sum() - 2.0 * moments.max();
            // The Panda's identified link 1 breaks the triangle inequality by less than the digits it is printed with.
            assert!(excess >= -1e-2 * moments.max(), "{} breaks the triangle inequality: {moments}", link.name);
        }
    }
}

#[test]
fn the_pandas_hand_at_home_points_down_where_the_maker_says() {
    let robot = panda();
    let tool = robot.tool_chain().tool_pose(&robot.home);
    let hand = tool * robot.gripper.hand_from_tool.inverse();
    assert!((hand.translation.vector - Vector3::new(0.3069, 0.0, 0.5903)).amax() < 1e-4, "{hand}");
    assert!((hand.rotation * Vector3::z() + Vector3::z()).norm() < 1e-9, "the hand points down");
    assert!((hand.rotation * Vector3::x() - Vector3::x()).norm() < 1e-9, "the hand's x is the world's");
    assert!(((hand.translation.vector - tool.translation.vector).norm() - 0.1034).abs() < 1e-12);
    let flange = robot.flange_chain().tool_pose(&robot.home);
    assert!((flange.translation.vector - hand.translation.vector).norm() < 1e-12, "hand and flange share their origin");
    assert!(robot.tool_chain().within_limits(&robot.home));
}

#[test]
fn robots_are_found_by_the_names_that_are_listed() {
    for name in RobotModel::NAMES {
        assert_eq!(RobotModel::named(name).map(|robot| robot.name), Some(name));
    }
    assert!(RobotModel::named("nobody").is_none());
}

#[test]
fn the_sawyers_limits_are_the_published_ones() {
    let robot = sawyer(2);
    let ranges: Vec<[f64; 2]> = robot.joints.iter().map(|joint| joint.range).collect();
    assert_eq!(ranges[1], [-3.8095, 2.2736]);
    assert_eq!(ranges[6], [-4.7124, 4.7124]);
    let symmetric = [3.0503, 3.0426, 3.0439, 2.9761, 2.9761];
    for (index, bound) in [0, 2, 3, 4, 5].into_iter().zip(symmetric) {
        assert_eq!(ranges[index], [-bound, bound]);
    }
    let limits = |limit: fn(&vmao_core::robots::ArmJoint) -> f64| robot.joints.iter().map(limit).collect::<Vec<f64>>();
    assert_eq!(limits(|joint| joint.max_torque), [80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0]);
    assert_eq!(limits(|joint| joint.max_velocity), [1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545]);
    let total: f64 = robot.joints.iter().map(|joint| joint.link.inertial.mass).sum::<f64>() + robot.base.inertial.mass;
    // Base, shoulder, head and links 1 to 6 of the published table.
    let table = 2.0687 + 5.3213 + 1.5795 + 4.505 + 1.745 + 2.5097 + 1.1136 + 1.5625 + 0.3292;
    assert!((total - table).abs() < 1e-9, "{total} kg");
}

#[test]
fn the_sawyers_hand_in_neutral_points_down_where_the_maker_says() {
    let robot = sawyer(2);
    let neutral = [0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161];
    let flange = robot.flange_chain().tool_pose(&neutral);
    assert!((flange.translation.vector - Vector3::new(0.4496, 0.1603, 0.2158)).amax() < 2e-4, "{flange}");
    assert!((flange.rotation * Vector3::z() + Vector3::z()).norm() < 2e-3, "the hand points down: {flange}");
    let tool = robot.tool_chain().tool_pose(&neutral);
    assert!(((flange.translation.vector - tool.translation.vector).norm() - 0.109).abs() < 1e-12);
    assert!(flange.rotation.angle_to(&tool.rotation) < 1e-9, "the tool lies along the flange's axes");
    assert!(robot.tool_chain().within_limits(&neutral) && robot.tool_chain().within_limits(&robot.home));
    let home = robot.tool_chain().tool_pose(&robot.home);
    assert!((home.rotation * Vector3::z() + Vector3::z()).norm() < 2e-3, "the tool points down at home: {home}");
}

#[test]
fn the_rethink_gripper_opens_as_its_slot_says() {
    // Published: with slot 2 from 14 to 56 mm; with slot 1 the pads meet, and it opens to about 37 mm.
    for (slot, closed, opened) in [(1, 0.0, 0.0368), (2, 0.0141, 0.0558), (3, 0.0331, 0.0748), (4, 0.0521, 0.0938)] {
        let gripper = sawyer(slot).gripper;
        assert!((gripper.closed_gap - closed).abs() < 1e-4, "slot {slot}: {}", gripper.closed_gap);
        assert!((gripper.max_opening() - opened).abs() < 1e-4, "slot {slot}: {}", gripper.max_opening());
    }
    assert_eq!(sawyer(0), sawyer(1), "an unknown slot is the nearest");
    assert_eq!(sawyer(9), sawyer(4));
}

#[test]
fn two_joined_bodies_weigh_and_turn_like_their_points() {
    // The finger is a box and a tip; as a body its inertia is the sum over both about the common centre.
    let finger = &sawyer(2).gripper.fingers[0].link.inertial;
    assert!((finger.mass - 0.03).abs() < 1e-12);
    let (near, far) = (Vector3::new(0.0, 0.01725, 0.04), Vector3::new(0.0, 0.01275, 0.06));
    let center = (near * 0.02 + far * 0.01) / 0.03;
    assert!((finger.center - Point3::from(center)).norm() < 1e-12);
    let own = 0.02 / 3.0 * (0.00675f64.powi(2) + 0.0375f64.powi(2)) + 0.01 / 3.0 * (0.004f64.powi(2) + 0.0185f64.powi(2));
    let apart = 0.02 * (near - center).norm_squared() + 0.01 * (far - center).norm_squared();
    assert!((finger.inertia[(0, 0)] - own - apart).abs() < 1e-12);
}

#[test]
fn the_pads_of_an_opened_gripper_are_as_far_apart_as_the_opening() {
    for gripper in all().into_iter().map(|robot| robot.gripper) {
        for opening in [gripper.closed_gap, 0.5 * (gripper.closed_gap + gripper.max_opening()), gripper.max_opening()] {
            let slid = (opening - gripper.closed_gap) / 2.0;
            let face = |finger: usize| {
                let finger = &gripper.fingers[finger];
                let vmao_core::shape::Shape::Box { half_extents } = finger.pad.shape else { panic!("the pad is a box") };
                let inner = finger.pad.carrier_from_solid.translation.vector - Vector3::y() * half_extents[1];
                let in_hand = finger.hand_from_finger * nalgebra::Point3::from(inner + Vector3::y() * slid);
                gripper.hand_from_tool.inverse_transform_point(&in_hand)
            };
            // Finger 1 lies towards +y of the tool frame, finger 2 towards −y; the tool's origin is between the pads.
            assert!((face(0).y - face(1).y - opening).abs() < 1e-9, "{} {}", face(0), face(1));
            assert!(face(0).y >= face(1).y && (face(0).y + face(1).y).abs() < 1e-9);
            let vmao_core::shape::Shape::Box { half_extents } = gripper.fingers[0].pad.shape else { panic!("the pad is a box") };
            assert!(
                face(0).z.abs() < half_extents[2] && (face(0).z - face(1).z).abs() < 1e-12,
                "the tool frame lies between the pads"
            );
        }
    }
}
