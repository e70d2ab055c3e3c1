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
    /// Turns any way about the anchor; positions are rotation vectors of three coordinates (rad).
    Ball,
    /// Does not move.
    Fixed,
}

impl JointKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Revolute, Self::Prismatic, Self::Ball, Self::Fixed];

    /// How many coordinates a position has; one, always zero, for a joint that does not move.
    pub fn coordinates(self) -> usize {
        match self {
            Self::Ball => 3,
            Self::Revolute | Self::Prismatic | Self::Fixed => 1,
        }
    }

    /// The name in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Ball => "ball",
            Self::Fixed => "fixed",
        }
    }
}

/// Flat `coordinates` of joints of these kinds, joint by joint. Panics if they are too few or too many.
pub fn by_joint(kinds: impl Iterator<Item = JointKind>, mut coordinates: &[f64]) -> Vec<&[f64]> {
    let positions = kinds
        .map(|kind| {
            let (position, rest) = coordinates.split_at(kind.coordinates());
            coordinates = rest;
            position
        })
        .collect();
    assert!(coordinates.is_empty(), "{} coordinates too many for these joints", coordinates.len());
    positions
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
    /// A point on the axis, or the centre of a ball joint, in the object frame at zero (m).
    pub anchor: Point3<f64>,
    /// The axis, in the object frame at zero; a ball joint and a fixed one have none and ignore it.
    pub axis: Unit<Vector3<f64>>,
    /// Lowest and highest position (rad or m), if limited; of a ball joint, zero and the largest angle from zero.
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

impl ArticulatedObject {
    /// Each joint with its share of flat `coordinates`. Panics if they are too few or too many.
    pub fn positions_by_joint<'a>(&'a self, coordinates: &'a [f64]) -> impl Iterator<Item = (&'a Joint, &'a [f64])> {
        self.joints.iter().zip(by_joint(self.joints.iter().map(|joint| joint.kind), coordinates))
    }
}

/// Where every part and joint is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectState {
    /// World pose of each part frame, by [`PartId`].
    pub world_from_parts: Vec<Pose>,
    /// Position of each joint (rad or m), flat: one coordinate a joint, three a ball joint.
    pub joint_positions: Vec<f64>,
}

/// Where the object shall be: the dependency root's pose and every joint's position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ObjectGoal {
    /// The dependency root that `world_from_root` speaks of.
    pub root: PartId,
    /// World pose of the root part.
    pub world_from_root: Pose,
    /// Position of each joint (rad or m), flat as in [`ObjectState`].
    pub joint_positions: Vec<f64>,
}
