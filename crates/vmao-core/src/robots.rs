//! Robot arms with a parallel gripper: kinematics, inertia, limits and collision solids, as data.
//!
//! The simulator's model, the planner's collision model and the kinematic chain are all made from this one description.

mod build;
mod collision_model;
mod panda;
mod sawyer;

pub use panda::panda;
pub use sawyer::{DEFAULT_SLOT, SLOTS, sawyer};

use crate::{
    geometry::Pose,
    kinematics::{ChainJoint, SerialChain},
    shape::{Shape, Solid},
};
use nalgebra::{Matrix3, Point3};

/// Mass properties of a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Inertial {
    /// kg.
    pub mass: f64,
    /// Centre of mass, link frame (m).
    pub center: Point3<f64>,
    /// About the centre of mass, link axes (kg·m²).
    pub inertia: Matrix3<f64>,
}

/// A rigid link.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Its name in the robot.
    pub name: &'static str,
    /// Its mass properties.
    pub inertial: Inertial,
    /// Its collision solids, link frame.
    pub solids: Vec<Solid>,
}

/// A revolute joint about local z, with its link.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmJoint {
    /// From the previous link to this one at zero.
    pub parent_from_joint: Pose,
    /// Lowest and highest position (rad).
    pub range: [f64; 2],
    /// Highest speed (rad/s).
    pub max_velocity: f64,
    /// Highest acceleration (rad/s²).
    pub max_acceleration: f64,
    /// Highest torque (N·m).
    pub max_torque: f64,
    /// Viscous damping (N·m·s/rad).
    pub damping: f64,
    /// Reflected rotor inertia (kg·m²).
    pub armature: f64,
    /// The link it carries.
    pub link: Link,
}

/// One of the two fingers; it slides along +y of its own frame to open.
#[derive(Debug, Clone, PartialEq)]
pub struct Finger {
    /// From the hand to the finger when closed.
    pub hand_from_finger: Pose,
    /// The finger's body.
    pub link: Link,
    /// The solid that may touch what is held, finger frame.
    pub pad: Solid,
}

/// A parallel gripper. The two fingers are coupled: one scalar opening.
#[derive(Debug, Clone, PartialEq)]
pub struct Gripper {
    /// From the last link to the hand.
    pub last_from_hand: Pose,
    /// The hand's body.
    pub hand: Link,
    /// Finger 1 (the one that lies towards +y of the tool frame) and finger 2.
    pub fingers: [Finger; 2],
    /// Travel of each finger (m).
    pub travel: f64,
    /// Gap between the pads when closed (m).
    pub closed_gap: f64,
    /// Force with which each finger is driven at most (N).
    pub max_force: f64,
    /// From the hand to the tool frame between the pads: z approaches, y closes.
    pub hand_from_tool: Pose,
}

/// The thinnest thing that is held (m): nearer contacts lie on one side of it.
const THINNEST: f64 = 0.006;
/// Room that the open pads leave beside the widest thing that is held (m).
const OPEN_ROOM: f64 = 0.004;

impl Gripper {
    /// The widest thing that fits between the pads (m).
    pub fn max_opening(&self) -> f64 {
        self.closed_gap + 2.0 * self.travel
    }

    /// The least and the largest distance between the contacts of two fingers that it can hold (m).
    pub fn span(&self) -> [f64; 2] {
        [self.closed_gap.max(THINNEST), self.max_opening() - OPEN_ROOM]
    }

    /// Shorter edge of the narrower pad's face (m); zero for pads that touch in a line or point.
    pub fn pad_width(&self) -> f64 {
        let width = |finger: &Finger| match finger.pad.shape {
            Shape::Box { half_extents: [x, _, z] } => 2.0 * x.min(z),
            Shape::Sphere { .. } | Shape::Capsule { .. } | Shape::Cylinder { .. } | Shape::Convex(_) => 0.0,
        };
        self.fingers.iter().map(width).fold(f64::INFINITY, f64::min)
    }

    /// How far each finger slides from closed to bring the pads `opening` apart (m; cut to its travel).
    pub fn finger_travel(&self, opening: f64) -> f64 {
        ((opening - self.closed_gap) / 2.0).clamp(0.0, self.travel)
    }
}

/// An arm with its gripper.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotModel {
    /// Its name on the command line.
    pub name: &'static str,
    /// The fixed base.
    pub base: Link,
    /// The joints, base to flange.
    pub joints: Vec<ArmJoint>,
    /// From the last link to the flange.
    pub last_from_flange: Pose,
    /// The gripper.
    pub gripper: Gripper,
    /// A comfortable configuration with the tool pointing down, away from the table (rad).
    pub home: Vec<f64>,
}

impl RobotModel {
    /// The robot with this name, if there is one; [`RobotModel::NAMES`] lists them.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "panda" => Some(panda()),
            "sawyer" => Some(sawyer(DEFAULT_SLOT)),
            _ => None,
        }
    }

    /// All names that [`RobotModel::named`] knows.
    pub const NAMES: [&'static str; 2] = ["panda", "sawyer"];

    /// The chain from the base to the tool frame between the pads.
    pub fn tool_chain(&self) -> SerialChain {
        self.chain(self.gripper.last_from_hand * self.gripper.hand_from_tool)
    }

    /// The chain from the base to the flange.
    pub fn flange_chain(&self) -> SerialChain {
        self.chain(self.last_from_flange)
    }

    fn chain(&self, last_from_tool: Pose) -> SerialChain {
        let joint = |joint: &ArmJoint| ChainJoint {
            parent_from_joint: joint.parent_from_joint,
            lower: joint.range[0],
            upper: joint.range[1],
        };
        SerialChain { joints: self.joints.iter().map(joint).collect(), last_from_tool }
    }
}
