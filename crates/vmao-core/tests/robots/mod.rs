//! Kinematic tables of the two robots, for tests only (joint frames and limits of the published models).
#![allow(dead_code, reason = "each test file uses some of them")]

pub(crate) mod problems;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use vmao_core::{
    collision::ArmCollisionModel,
    geometry::{Pose, pose, translation},
    kinematics::{ChainJoint, SerialChain},
};

type Row = ([f64; 3], [f64; 4], [f64; 2]);

fn chain(rows: &[Row]) -> SerialChain {
    let joint = |&(position, quaternion, [lower, upper]): &Row| ChainJoint {
        parent_from_joint: pose(position, quaternion),
        lower,
        upper,
    };
    SerialChain { joints: rows.iter().map(joint).collect(), last_from_tool: translation(0.0, 0.0, 0.0) }
}

/// Franka Panda; the tool is the frame of its hand.
pub(crate) fn panda() -> SerialChain {
    let mut panda = chain(&[
        ([0.0, 0.0, 0.333], [1.0, 0.0, 0.0, 0.0], [-2.8973, 2.8973]),
        ([0.0, 0.0, 0.0], [1.0, -1.0, 0.0, 0.0], [-1.7628, 1.7628]),
        ([0.0, -0.316, 0.0], [1.0, 1.0, 0.0, 0.0], [-2.8973, 2.8973]),
        ([0.0825, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [-3.0718, -0.0698]),
        ([-0.0825, 0.384, 0.0], [1.0, -1.0, 0.0, 0.0], [-2.8973, 2.8973]),
        ([0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [-0.0175, 3.7525]),
        ([0.088, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [-2.8973, 2.8973]),
    ]);
    panda.last_from_tool = pose([0.0, 0.0, 0.107], [(FRAC_PI_4 / 2.0).cos(), 0.0, 0.0, -(FRAC_PI_4 / 2.0).sin()]);
    panda
}

/// Rethink Sawyer; the tool is the frame of `right_hand`.
pub(crate) fn sawyer() -> SerialChain {
    let mut sawyer = chain(&[
        ([0.0, 0.0, 0.08], [1.0, 0.0, 0.0, 0.0], [-3.0503, 3.0503]),
        ([0.081, 0.05, 0.237], [0.5, -0.5, 0.5, 0.5], [-3.8095, 2.2736]),
        ([0.0, -0.14, 0.1425], [1.0, 1.0, 0.0, 0.0], [-3.0426, 3.0426]),
        ([0.0, -0.042, 0.26], [1.0, -1.0, 0.0, 0.0], [-3.0439, 3.0439]),
        ([0.0, -0.125, -0.1265], [1.0, 1.0, 0.0, 0.0], [-2.9761, 2.9761]),
        ([0.0, 0.031, 0.275], [1.0, -1.0, 0.0, 0.0], [-2.9761, 2.9761]),
        ([0.0, -0.11, 0.1053], [0.0616248, 0.06163, -0.704416, 0.704416], [-4.7124, 4.7124]),
    ]);
    sawyer.last_from_tool = pose([0.0, 0.0, 0.0245], [1.0, 0.0, 0.0, 1.0]);
    sawyer
}

/// Menagerie's home pose of the Panda.
pub(crate) const PANDA_HOME: [f64; 7] = [0.0, 0.0, 0.0, -FRAC_PI_2, 0.0, FRAC_PI_2, -FRAC_PI_4];
/// Sawyer's neutral pose.
pub(crate) const SAWYER_NEUTRAL: [f64; 7] = [0.0, -1.18, 0.0, 2.18, 0.0, 0.57, 3.3161];

/// The Panda with its gripper open.
pub(crate) fn panda_model(world_from_base: Pose) -> ArmCollisionModel {
    let robot = vmao_core::robots::panda();
    robot.collision_model(world_from_base, robot.gripper.max_opening())
}
