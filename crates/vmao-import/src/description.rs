//! What URDF and MJCF have in common: links, joints and geometries as the file says, before anything is repaired.

use crate::repairs::Repairs;
use nalgebra::{Unit, Vector3};
use vmao_core::geometry::Pose;

/// The most links of one object.
pub const MAX_LINKS: usize = 256;
/// The most geometries of one object.
pub const MAX_GEOMETRIES: usize = 4096;

/// A kinematic structure as one file describes it; nothing says yet that it is a tree.
#[derive(Debug, Clone)]
pub struct Description {
    /// The object's name.
    pub name: String,
    /// The links.
    pub links: Vec<Link>,
    /// The joints.
    pub joints: Vec<Joint>,
    /// What was put right while reading.
    pub repairs: Repairs,
}

/// A rigid link.
#[derive(Debug, Clone, Default)]
pub struct Link {
    /// Its name.
    pub name: String,
    /// What is looked at.
    pub visuals: Vec<Geometry>,
    /// What collides.
    pub collisions: Vec<Geometry>,
    /// Its mass, if the file says it (kg).
    pub mass: Option<f64>,
}

/// A shape on a link.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Where it is.
    pub link_from_geometry: Pose,
    /// What it is.
    pub form: Form,
    /// Its red, green, blue and opacity, if the file that describes the link says it.
    pub color: Option<[f32; 4]>,
    /// An image wrapped around it, if that file names one.
    pub texture: Option<String>,
}

/// What a geometry is; lengths in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// A mesh in a file of its own.
    Mesh {
        /// Its path as the description names it, relative to the description's folder; not checked.
        file: String,
        /// Factors along the file's axes.
        scale: [f64; 3],
    },
    /// A box.
    Box {
        /// Half the edge lengths.
        half_extents: [f64; 3],
    },
    /// An ellipsoid; a ball if all radii are equal.
    Ellipsoid {
        /// Along x, y, z.
        radii: [f64; 3],
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Half the length.
        half_length: f64,
    },
    /// A cylinder along z with half-balls on both ends.
    Capsule {
        /// Radius.
        radius: f64,
        /// Half the length of the straight part.
        half_length: f64,
    },
}

/// What a joint lets its child do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Turn about an axis.
    Turn,
    /// Slide along an axis.
    Slide,
    /// Turn any way about a point.
    Ball,
    /// Nothing.
    Fixed,
    /// Anything.
    Free,
}

/// A joint between two links.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// What motion it allows.
    pub motion: Motion,
    /// Index of the link that the motion is relative to.
    pub parent: usize,
    /// Index of the link that moves.
    pub child: usize,
    /// Where the child is with the joint at zero.
    pub parent_from_child: Pose,
    /// A point on the axis, in the child's frame (m).
    pub anchor: Vector3<f64>,
    /// The axis, in the child's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Lowest and highest position, as the file says them (rad or m); of a ball, zero and the largest angle.
    pub limits: Option<[f64; 2]>,
    /// Whether the file calls the joint unlimited, as against saying nothing.
    pub endless: bool,
    /// Viscous damping, if the file says it (N·m·s/rad or N·s/m).
    pub damping: Option<f64>,
    /// Dry friction, if the file says it (N·m or N).
    pub friction: Option<f64>,
}
