//! The Panda's description against the published tables of its maker and of the identified inertias.

use nalgebra::Vector3;
use vmao_core::robots::{RobotModel, panda};

#[test]
fn joint_limits_are_the_published_ones() {
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
fn masses_are_the_identified_ones() {
    let robot = panda();
    let masses: Vec<f64> = robot.joints.iter().map(|joint| joint.link.inertial.mass).collect();
    assert_eq!(masses, [4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522]);
    assert_eq!((robot.base.inertial.mass, robot.gripper.hand.inertial.mass), (0.629769, 0.73));
    assert!(robot.gripper.fingers.iter().all(|finger| finger.link.inertial.mass == 0.015));
}

#[test]
fn every_inertia_is_that_of_a_real_body() {
    let robot = panda();
    let links = robot.joints.iter().map(|joint| &joint.link).chain([&robot.base, &robot.gripper.hand]);
    for link in links.chain(robot.gripper.fingers.iter().map(|finger| &finger.link)) {
        let moments = link.inertial.inertia.symmetric_eigenvalues();
        assert_eq!(link.inertial.inertia, link.inertial.inertia.transpose(), "{} is not symmetric", link.name);
        assert!(moments.min() > 0.0, "{}: {moments}", link.name);
        let excess = moments.sum() - 2.0 * moments.max();
        // The identified link 1 breaks the triangle inequality by less than the digits it is printed with.
        assert!(excess >= -1e-2 * moments.max(), "{} breaks the triangle inequality: {moments}", link.name);
    }
}

#[test]
fn the_hand_at_home_points_down_where_the_maker_says() {
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
fn the_pads_of_an_opened_gripper_are_as_far_apart_as_the_opening() {
    let gripper = panda().gripper;
    for opening in [0.0, 0.03, gripper.max_opening()] {
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
        assert!(face(0).z.abs() < 1e-3 && face(1).z.abs() < 1e-3, "the tool frame lies at the pads' middle");
    }
}
