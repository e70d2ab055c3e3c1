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
