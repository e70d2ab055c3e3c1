//! Primitive solids and convex hulls that robots, objects and obstacles are made of.

use crate::{convex_hull::ConvexHull, geometry::Pose};
use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A solid about its own frame: primitives are centred on it, hulls lie anywhere. Sizes in metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// A convex polyhedron.
    Convex(ConvexHull),
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
        match *self {
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Capsule { radius, half_length } => PI * radius * radius * (2.0 * half_length + 4.0 / 3.0 * radius),
            Self::Cylinder { radius, half_length } => 2.0 * PI * radius * radius * half_length,
            Self::Box { half_extents: [x, y, z] } => 8.0 * x * y * z,
            Self::Convex(ref hull) => hull.volume(),
        }
    }

    /// Its centre of mass at even density, own frame (m).
    pub fn centroid(&self) -> Point3<f64> {
        match self {
            Self::Convex(hull) => hull.centroid(),
            Self::Sphere { .. } | Self::Capsule { .. } | Self::Cylinder { .. } | Self::Box { .. } => Point3::origin(),
        }
    }

    /// Its inertia about the centroid with `mass` (kg) spread evenly, own axes (kg·m²).
    pub fn inertia(&self, mass: f64) -> Matrix3<f64> {
        let about_axes = |across: f64, along: f64| Matrix3::from_diagonal(&Vector3::new(across, across, along));
        match *self {
            Self::Sphere { radius } => Matrix3::identity() * (0.4 * mass * radius * radius),
            Self::Cylinder { radius, half_length } => {
                let square = radius * radius;
                about_axes(mass * (square / 4.0 + half_length * half_length / 3.0), mass * square / 2.0)
            }
            Self::Capsule { radius, half_length } => {
                // Two half balls, each with its centre of mass 3/8 of the radius beyond its flat side, and a cylinder.
                let square = radius * radius;
                let balls = mass * (4.0 / 3.0 * PI * radius * square) / self.volume();
                let rod = Self::Cylinder { radius, half_length }.inertia(mass - balls);
                let across = 0.4 * square + half_length * half_length + 0.75 * half_length * radius;
                rod + about_axes(balls * across, balls * 0.4 * square)
            }
            Self::Box { half_extents } => {
                let [x, y, z] = half_extents.map(|half| half * half);
                Matrix3::from_diagonal(&Vector3::new(y + z, z + x, x + y)) * (mass / 3.0)
            }
            Self::Convex(ref hull) => hull.inertia(mass),
        }
    }

    /// A point of the solid that is furthest along `direction` of its own frame (m); any if that is zero.
    pub fn support(&self, direction: &Vector3<f64>) -> Point3<f64> {
        let along = |half: f64, coordinate: f64| if coordinate < 0.0 { -half } else { half };
        let ball = |radius: f64| direction.try_normalize(0.0).map_or_else(Vector3::zeros, |unit| unit * radius);
        match *self {
            Self::Sphere { radius } => Point3::from(ball(radius)),
            Self::Capsule { radius, half_length } => Point3::from(ball(radius) + Vector3::z() * along(half_length, direction.z)),
            Self::Cylinder { radius, half_length } => {
                let flat = direction.xy().try_normalize(0.0).unwrap_or_default() * radius;
                Point3::new(flat.x, flat.y, along(half_length, direction.z))
            }
            Self::Box { half_extents: [x, y, z] } => {
                Point3::new(along(x, direction.x), along(y, direction.y), along(z, direction.z))
            }
            Self::Convex(ref hull) => hull.support(direction),
        }
    }

    /// How far the solid reaches from its frame's origin along a unit `direction` of its own frame (m).
    pub fn extent_along(&self, direction: &Vector3<f64>) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Capsule { radius, half_length } => radius + half_length * direction.z.abs(),
            Self::Cylinder { radius, half_length } => radius * direction.xy().norm() + half_length * direction.z.abs(),
            Self::Box { half_extents: [x, y, z] } => x * direction.x.abs() + y * direction.y.abs() + z * direction.z.abs(),
            Self::Convex(ref hull) => hull.support(direction).coords.dot(direction),
        }
    }
}

impl Solid {
    /// Height of its lowest point with its carrier at `world_from_carrier` (m).
    pub fn lowest_point(&self, world_from_carrier: &Pose) -> f64 {
        let world_from_solid = world_from_carrier * self.carrier_from_solid;
        let down = world_from_solid.inverse_transform_vector(&-Vector3::z());
        world_from_solid.translation.z - self.shape.extent_along(&down)
    }
}
