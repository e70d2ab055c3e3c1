//! Franka Emika Panda with the Franka hand; numbers from the published kinematics and identified inertias
//! (Menagerie `franka_emika_panda`, dm_robotics damping, franka_rust limits), solids fitted by us to the link extents.

use super::{
    ArmJoint, Finger, Gripper, Link, RobotModel,
    build::{GREY, WHITE, brick, link, segment},
};
use crate::geometry::{Pose, pose, translation};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_4;

/// The Panda and its hand. The tool frame lies between the pads, 0.1034 m from the hand, rotated with the hand.
pub fn panda() -> RobotModel {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (minus, plus) = ([half, -half, 0.0, 0.0], [half, half, 0.0, 0.0]);
    let placements = [
        pose([0.0, 0.0, 0.333], [1.0, 0.0, 0.0, 0.0]),
        pose([0.0, 0.0, 0.0], minus),
        pose([0.0, -0.316, 0.0], plus),
        pose([0.0825, 0.0, 0.0], plus),
        pose([-0.0825, 0.384, 0.0], minus),
        pose([0.0, 0.0, 0.0], plus),
        pose([0.088, 0.0, 0.0], plus),
    ];
    let ranges = [
        [-2.8973, 2.8973],
        [-1.7628, 1.7628],
        [-2.8973, 2.8973],
        [-3.0718, -0.0698],
        [-2.8973, 2.8973],
        [-0.0175, 3.7525],
        [-2.8973, 2.8973],
    ];
    let accelerations = [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0];
    // The sixth identified damping is negative in the source; zero there.
    let dampings = [0.0665, 0.1987, 0.0399, 0.2257, 0.1023, 0.0, 0.0638];
    let joint = |(index, link): (usize, Link)| ArmJoint {
        parent_from_joint: placements[index],
        range: ranges[index],
        max_velocity: if index < 4 { 2.175 } else { 2.61 },
        max_acceleration: accelerations[index],
        max_torque: if index < 4 { 87.0 } else { 12.0 },
        damping: dampings[index],
        armature: 0.1,
        link,
    };
    RobotModel {
        name: "panda",
        base: link(
            "link0",
            0.629769,
            [-0.041018, -0.00014, 0.049974],
            [0.00315, 0.00388, 0.004285, 8.2904e-7, 0.00015, 8.2299e-6],
            vec![segment([-0.09, 0.0, 0.06], [0.0, 0.0, 0.06], 0.065, WHITE)],
        ),
        joints: links().into_iter().enumerate().map(joint).collect(),
        last_from_flange: translation(0.0, 0.0, 0.107),
        gripper: hand(),
        home: vec![0.0, -FRAC_PI_4, 0.0, -3.0 * FRAC_PI_4, 0.0, 2.0 * FRAC_PI_4, FRAC_PI_4],
    }
}

fn links() -> [Link; 7] {
    let r = 0.055;
    [
        link(
            "link1",
            4.970684,
            [0.003875, 0.002081, -0.04762],
            [0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169],
            vec![segment([0.0, 0.0, -0.14], [0.0, 0.0, 0.0], r, WHITE), segment([0.0, 0.0, 0.0], [0.0, -0.075, 0.0], r, WHITE)],
        ),
        link(
            "link2",
            0.646926,
            [-0.003141, -0.02872, 0.003495],
            [0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704],
            vec![segment([0.0, -0.14, 0.0], [0.0, 0.0, 0.0], r, WHITE), segment([0.0, 0.0, 0.0], [0.0, 0.0, 0.075], r, WHITE)],
        ),
        link(
            "link3",
            3.228604,
            [0.027518, 0.039252, -0.066502],
            [0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805],
            vec![segment([0.0, 0.0, -0.065], [0.0, 0.0, 0.0], r, WHITE), segment([0.0, 0.0, 0.0], [0.083, 0.056, 0.0], r, WHITE)],
        ),
        link(
            "link4",
            3.587895,
            [-0.05317, 0.104419, 0.027454],
            [0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641],
            vec![segment([0.0, 0.0, 0.0], [0.0, 0.0, 0.056], r, WHITE), segment([0.0, 0.0, 0.0], [-0.083, 0.069, 0.0], r, WHITE)],
        ),
        link(
            "link5",
            1.225946,
            [-0.011953, 0.041065, -0.038437],
            [0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229],
            vec![
                segment([0.0, 0.0, -0.21], [0.0, 0.0, -0.11], r, WHITE),
                segment([0.0, 0.055, -0.12], [0.0, 0.075, -0.01], 0.035, WHITE),
            ],
        ),
        link(
            "link6",
            1.666555,
            [0.060149, -0.014117, -0.010517],
            [0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341],
            vec![segment([0.0, 0.0, 0.0], [0.085, 0.0, 0.0], 0.047, WHITE)],
        ),
        link(
            "link7",
            0.735522,
            [0.010517, -0.004252, 0.061597],
            [0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741],
            vec![segment([0.0, 0.0, 0.06], [0.0, 0.0, 0.075], 0.044, GREY)],
        ),
    ]
}

fn hand() -> Gripper {
    let hand = link(
        "hand",
        0.73,
        [-0.01, 0.0, 0.03],
        [0.001, 0.0025, 0.0017, 0.0, 0.0, 0.0],
        vec![segment([0.0, -0.06, 0.03], [0.0, 0.06, 0.03], 0.04, GREY)],
    );
    let finger = |name, turn: f64| Finger {
        hand_from_finger: Pose::from_parts(
            Translation3::new(0.0, 0.0, 0.0584),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn),
        ),
        link: link(
            name,
            0.015,
            [0.0, 0.02, 0.025],
            [2.375e-6, 2.375e-6, 7.5e-7, 0.0, 0.0, 0.0],
            vec![
                // The stem between the hand and the pad, set back from the pad's face.
                brick([0.0, 0.0165, 0.02], [0.009, 0.0085, 0.017], WHITE),
            ],
        ),
        pad: brick([0.0, 0.00758, 0.04525], [0.00875, 0.00758, 0.00825], GREY),
    };
    Gripper {
        last_from_hand: Pose::from_parts(
            Translation3::new(0.0, 0.0, 0.107),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -FRAC_PI_4),
        ),
        hand,
        fingers: [finger("left_finger", 0.0), finger("right_finger", std::f64::consts::PI)],
        travel: 0.04,
        closed_gap: 0.0,
        max_force: 35.0,
        hand_from_tool: translation(0.0, 0.0, 0.1034),
    }
}
