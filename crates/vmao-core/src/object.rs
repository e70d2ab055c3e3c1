//! The articulated object: rigid parts as nodes, joints as edges of a tree.

use crate::{contact::PartId, geometry::Pose, shape::Solid};
use nalgebra::{Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};

/// How a joint lets its child move relative to its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// Turns about the axis; positions in rad.
    Revolute,
    /// Slides along the axis; positions in m.
    Prismatic,
    /// Does not move.
    Fixed,
}

/// One rigid part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Its name, unique in the object.
    pub name: String,
    /// Its shape, for physics and pictures, in the part frame.
    pub solids: Vec<Solid>,
    /// Its mass (kg), spread over its solids by volume.
    pub mass: f64,
}

/// A joint between two parts. Anchor and axis are given in the object frame at joint position zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Its name, unique in the object.
    pub name: String,
    /// What motion it allows.
    pub kind: JointKind,
    /// The part that the motion is relative to.
    pub parent: PartId,
    /// The part that moves for a positive position.
    pub child: PartId,
    /// A point on the axis, in the object frame at zero (m).
    pub anchor: Point3<f64>,
    /// The axis, in the object frame at zero.
    pub axis: Unit<Vector3<f64>>,
    /// Lowest and highest position (rad or m), if limited.
    pub limits: Option<[f64; 2]>,
    /// Viscous damping (N·m·s/rad or N·s/m).
    pub damping: f64,
    /// Dry friction (N·m or N).
    pub friction: f64,
}

/// An articulated object at rest in its own frame: all part frames coincide with it when every joint is at zero.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArticulatedObject {
    /// Its catalogue name.
    pub name: String,
    /// The parts, by [`PartId`].
    pub parts: Vec<Part>,
    /// The joints; a tree over the parts.
    pub joints: Vec<Joint>,
}

/// Where every part and joint is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectState {
    /// World pose of each part frame, by [`PartId`].
    pub world_from_parts: Vec<Pose>,
    /// Position of each joint (rad or m).
    pub joint_positions: Vec<f64>,
}

/// Where the object shall be: the dependency root's pose and every joint's position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectGoal {
    /// The dependency root that `world_from_root` speaks of.
    pub root: PartId,
    /// World pose of the root part.
    pub world_from_root: Pose,
    /// Position of each joint (rad or m).
    pub joint_positions: Vec<f64>,
}
