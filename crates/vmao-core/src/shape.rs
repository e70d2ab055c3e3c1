//! Primitive solids that robots, objects and obstacles are made of.

use crate::geometry::Pose;
use serde::{Deserialize, Serialize};

/// A primitive solid, centred on its own frame; sizes in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Radius (m).
        radius: f64,
    },
    /// A cylinder along z with half-balls on both ends.
    Capsule {
        /// Radius (m).
        radius: f64,
        /// Half the length of the straight part (m).
        half_length: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius (m).
        radius: f64,
        /// Half the length (m).
        half_length: f64,
    },
    /// A box.
    Box {
        /// Half the edge lengths along x, y, z (m).
        half_extents: [f64; 3],
    },
}

/// A coloured solid fixed in some frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solid {
    /// What it is.
    pub shape: Shape,
    /// Where it is, in the frame of the link or part that carries it.
    pub carrier_from_solid: Pose,
    /// Red, green, blue in [0, 1].
    pub color: [f32; 3],
}

impl Shape {
    /// Its volume (m³).
    pub fn volume(&self) -> f64 {
        use std::f64::consts::PI;
        match *self {
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Capsule { radius, half_length } => PI * radius * radius * (2.0 * half_length + 4.0 / 3.0 * radius),
            Self::Cylinder { radius, half_length } => 2.0 * PI * radius * radius * half_length,
            Self::Box { half_extents: [x, y, z] } => 8.0 * x * y * z,
        }
    }
}

impl Shape {
    /// How far the solid reaches from its centre along a unit `direction` of its own frame (m).
    pub fn extent_along(&self, direction: &nalgebra::Vector3<f64>) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Capsule { radius, half_length } => radius + half_length * direction.z.abs(),
            Self::Cylinder { radius, half_length } => radius * direction.xy().norm() + half_length * direction.z.abs(),
            Self::Box { half_extents: [x, y, z] } => x * direction.x.abs() + y * direction.y.abs() + z * direction.z.abs(),
        }
    }
}

impl Solid {
    /// Height of its lowest point with its carrier at `world_from_carrier` (m).
    pub fn lowest_point(&self, world_from_carrier: &Pose) -> f64 {
        let world_from_solid = world_from_carrier * self.carrier_from_solid;
        let up = world_from_solid.inverse_transform_vector(&nalgebra::Vector3::z());
        world_from_solid.translation.z - self.shape.extent_along(&up)
    }
}
