//! Rethink Sawyer with the Rethink electric parallel gripper (narrow fingers, half-round tips).
//!
//! Kinematics, inertias and collision capsules are the published ones (Menagerie `rethink_robotics_sawyer`), torque and
//! velocity limits those of the maker's URDF, the gripper's numbers those of its xacro. Accelerations are ours (D11).

use super::{
    ArmJoint, Finger, Gripper, Inertial, Link, RobotModel,
    build::{GREY, block, brick, drum, joined, principal, segment},
};
use crate::{
    geometry::{Pose, pose, translation},
    shape::Solid,
};
use nalgebra::{Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

/// Where the fingers can be screwed to their carriages: the further out, the wider they open.
pub const SLOTS: std::ops::RangeInclusive<u8> = 1..=4;
/// The slot that Sawyer's own description uses.
pub const DEFAULT_SLOT: u8 = 2;

const RED: [f32; 3] = [0.62, 0.12, 0.14];
const BLACK: [f32; 3] = [0.15, 0.15, 0.16];

/// The Sawyer; `slot` (one of [`SLOTS`]; others count as the nearest) says where the gripper's fingers are mounted.
///
/// The tool frame lies between the pads, 0.109 m from the flange, along the axes of the flange `right_hand`.
pub fn sawyer(slot: u8) -> RobotModel {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let (minus, plus) = ([half, -half, 0.0, 0.0], [half, half, 0.0, 0.0]);
    let placements = [
        pose([0.0, 0.0, 0.08], [1.0, 0.0, 0.0, 0.0]),
        pose([0.081, 0.05, 0.237], [0.5, -0.5, 0.5, 0.5]),
        pose([0.0, -0.14, 0.1425], plus),
        pose([0.0, -0.042, 0.26], minus),
        pose([0.0, -0.125, -0.1265], plus),
        pose([0.0, 0.031, 0.275], minus),
        pose([0.0, -0.11, 0.1053], [0.0616248, 0.06163, -0.704416, 0.704416]),
    ];
    let ranges = [
        [-3.0503, 3.0503],
        [-3.8095, 2.2736],
        [-3.0426, 3.0426],
        [-3.0439, 3.0439],
        [-2.9761, 2.9761],
        [-2.9761, 2.9761],
        [-4.7124, 4.7124],
    ];
    let velocities = [1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545];
    let accelerations = [3.5, 2.5, 5.0, 5.0, 5.0, 5.0, 5.0];
    let torques = [80.0, 80.0, 40.0, 40.0, 9.0, 9.0, 9.0];
    let joint = |(index, link): (usize, Link)| ArmJoint {
        parent_from_joint: placements[index],
        range: ranges[index],
        max_velocity: velocities[index],
        max_acceleration: accelerations[index],
        max_torque: torques[index],
        damping: 0.1,
        armature: 1.0,
        link,
    };
    let last_from_flange = pose([0.0, 0.0, 0.0245], [half, 0.0, 0.0, half]);
    let inertia =
        Matrix3::new(0.0067599, -4.2024e-5, -6.1904e-7, -4.2024e-5, 0.0067877, 1.5888e-5, -6.1904e-7, 1.5888e-5, 0.0074031);
    RobotModel {
        name: "sawyer",
        base: Link {
            name: "base",
            inertial: Inertial { mass: 2.0687, center: Point3::new(-0.0006241, -2.8025e-5, 0.065404), inertia },
            solids: vec![drum([0.0, 0.0, 0.0], [0.0, 0.0, 0.24], 0.08, BLACK)],
        },
        joints: links().into_iter().enumerate().map(joint).collect(),
        last_from_flange,
        gripper: gripper(&last_from_flange, slot.clamp(*SLOTS.start(), *SLOTS.end())),
        // Like the published neutral pose, but higher and further back, so that nobody's view or way is blocked.
        home: vec![0.0, -1.83, 0.0, 1.86, 0.0, 1.5408, 1.7453],
    }
}

fn links() -> [Link; 7] {
    let body = |name, inertial, solids: Vec<Solid>| Link { name, inertial, solids };
    let shoulder = principal(
        5.3213,
        [0.0243645, 0.0109688, 0.143631],
        [0.894821, 0.0089945, -0.17028, 0.412576],
        [0.0651599, 0.0510954, 0.0186221],
    );
    // The head's pan joint is kept still: head and shoulder are one body.
    let shoulder_from_head = translation(0.0, 0.0, 0.2965);
    let head = principal(
        1.5795,
        [0.00532226, -2.65473e-5, 0.1021],
        [0.999993, 7.08e-5, -0.00359812, -0.000626],
        [0.0118334, 0.00827097, 0.00496582],
    );
    let on_shoulder = |solid: Solid| Solid { carrier_from_solid: shoulder_from_head * solid.carrier_from_solid, ..solid };
    [
        body(
            "right_l0",
            joined(&shoulder, &shoulder_from_head, &head),
            vec![
                segment([0.0, 0.0, -0.005], [0.0, 0.0, 0.25], 0.07, RED),
                on_shoulder(segment([-0.005, 0.0, 0.02], [-0.005, 0.0, 0.205], 0.04, BLACK)),
                on_shoulder(brick([0.025, 0.0, 0.1], [0.01, 0.13, 0.08], BLACK)),
            ],
        ),
        body(
            "right_l1",
            principal(
                4.505,
                [-0.0030849, -0.026811, 0.092521],
                [0.424888, 0.891987, 0.132364, -0.0794294],
                [0.0224339, 0.0221624, 0.00970971],
            ),
            vec![segment([0.0, 0.0, -0.06], [0.0, 0.0, 0.13], 0.068, RED)],
        ),
        body(
            "right_l2",
            principal(
                1.745,
                [-0.00016044, -0.014967, 0.13582],
                [0.707831, -0.0524761, 0.0516006, 0.702537],
                [0.0257928, 0.025506, 0.00292516],
            ),
            vec![segment([0.0, 0.0, -0.15], [0.0, 0.0, 0.26], 0.055, RED)],
        ),
        body(
            "right_l3",
            principal(
                2.5097,
                [-0.0048135, -0.0281, -0.084154],
                [0.902999, 0.385391, -0.0880901, 0.168247],
                [0.0102404, 0.0096997, 0.00369622],
            ),
            vec![segment([0.0, 0.0, -0.115], [0.0, 0.0, 0.03], 0.055, RED)],
        ),
        body(
            "right_l4",
            principal(
                1.1136,
                [-0.00188917, 0.00689948, 0.134095],
                [0.803247, 0.031244, -0.0298409, 0.594077],
                [0.0136555, 0.0135498, 0.00127385],
            ),
            vec![segment([0.0, 0.0, -0.13], [0.0, 0.0, 0.27], 0.045, RED)],
        ),
        body(
            "right_l5",
            principal(
                1.5625,
                [0.0061133, -0.023697, 0.076416],
                [0.404076, 0.9135, 0.0473125, 0.00158335],
                [0.00474131, 0.00422857, 0.00190672],
            ),
            vec![
                segment([0.0, 0.0, -0.02], [0.0, 0.0, 0.1], 0.045, RED),
                segment([0.0, 0.0, 0.105], [0.0, -0.082, 0.105], 0.045, RED),
            ],
        ),
        body(
            "right_l6",
            principal(
                0.3292,
                [-8.0726e-6, 0.0085838, -0.0049566],
                [0.479044, 0.515636, -0.513069, 0.491321],
                [0.000360268, 0.000311078, 0.000214984],
            ),
            vec![drum([0.0, 0.0, -0.02], [0.0, 0.0, 0.02], 0.045, BLACK)],
        ),
    ]
}

/// Travel of a finger's carriage (m).
const TRAVEL: f64 = 0.020833;
/// From the gripper's middle to the pads' face with the fingers in slot 1 and the carriages closed (m): they would overlap.
const SLOT_1_FACE: f64 = -0.011 + PAD_FACE;
/// Between neighbouring slots (m).
const SLOT_PITCH: f64 = 0.0095;
/// The pad's face in the finger's frame (m).
const PAD_FACE: f64 = 0.01255 - 0.004;

fn gripper(last_from_flange: &Pose, slot: u8) -> Gripper {
    // With slot 1 the pads meet before the carriages do, and the rest of the travel is lost.
    let face = SLOT_1_FACE + f64::from(slot - 1) * SLOT_PITCH;
    let lost = (-face).max(0.0);
    let closed_face = face.max(0.0);
    let (base_mass, radius, length) = (0.3, 0.029, 0.1);
    let across = base_mass * (3.0 * radius * radius + length * length) / 12.0;
    let hand = Link {
        name: "gripper",
        inertial: Inertial {
            mass: base_mass,
            center: Point3::origin(),
            inertia: Matrix3::from_diagonal(&Vector3::new(across, base_mass * radius * radius / 2.0, across)),
        },
        solids: vec![drum([0.0, -length / 2.0, 0.0], [0.0, length / 2.0, 0.0], radius, GREY)],
    };
    let finger = |name, side: f64, turn: f64| Finger {
        hand_from_finger: Pose::from_parts(
            Translation3::new(0.0, side * (closed_face - PAD_FACE), 0.02),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn),
        ),
        link: Link {
            name,
            inertial: joined(
                &block(0.02, [0.0, 0.01725, 0.04], [0.005, 0.00675, 0.0375]),
                &Pose::identity(),
                &block(0.01, [0.0, 0.01275, 0.06], [0.004, 0.004, 0.0185]),
            ),
            solids: vec![
                brick([0.0, 0.01725, 0.04], [0.005, 0.00675, 0.0375], BLACK),
                // The tip behind the pad, set back from the pad's face.
                brick([0.0, 0.01325, 0.06], [0.004, 0.004, 0.0185], BLACK),
            ],
        },
        pad: brick([0.0, 0.01255, 0.058], [0.0035, 0.004, 0.0165], GREY),
    };
    Gripper {
        last_from_hand: last_from_flange * translation(0.0, 0.0, 0.025),
        hand,
        fingers: [finger("left_finger", 1.0, 0.0), finger("right_finger", -1.0, std::f64::consts::PI)],
        travel: TRAVEL - lost,
        closed_gap: 2.0 * closed_face,
        max_force: 20.0,
        // The grip site of the published models: 0.109 m from the flange, 10 mm above the pads' end.
        hand_from_tool: translation(0.0, 0.0, 0.084),
    }
}
