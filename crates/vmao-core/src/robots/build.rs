//! Short hands for the robots' tables: links, capsules and boxes.

use super::{Inertial, Link};
use crate::{
    geometry::{Pose, pose, translation},
    shape::{Shape, Solid},
};
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

pub(super) const WHITE: [f32; 3] = [0.92, 0.93, 0.94];
pub(super) const GREY: [f32; 3] = [0.35, 0.37, 0.40];

/// A link from xx yy zz xy xz yz about its centre of mass.
pub(super) fn link(name: &'static str, mass: f64, center: [f64; 3], moments: [f64; 6], solids: Vec<Solid>) -> Link {
    let [xx, yy, zz, xy, xz, yz] = moments;
    let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    Link { name, inertial: Inertial { mass, center: Point3::from(center), inertia }, solids }
}

/// Mass properties from principal moments about the centre of mass, along axes turned by a w x y z quaternion.
pub(super) fn principal(mass: f64, center: [f64; 3], axes: [f64; 4], moments: [f64; 3]) -> Inertial {
    let turn = pose([0.0; 3], axes).rotation.to_rotation_matrix().into_inner();
    let inertia = turn * Matrix3::from_diagonal(&Vector3::from(moments)) * turn.transpose();
    // Symmetric by construction but for the last digit.
    Inertial { mass, center: Point3::from(center), inertia: (inertia + inertia.transpose()) / 2.0 }
}

/// Two rigidly joined bodies as one, in the first one's frame (parallel axis theorem).
pub(super) fn joined(first: &Inertial, first_from_second: &Pose, second: &Inertial) -> Inertial {
    let mass = first.mass + second.mass;
    let turn = first_from_second.rotation.to_rotation_matrix().into_inner();
    let moved = first_from_second * second.center;
    let center = Point3::from((first.center.coords * first.mass + moved.coords * second.mass) / mass);
    let shifted = |inertia: Matrix3<f64>, mass: f64, from: Point3<f64>| {
        let arm = from - center;
        inertia + (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass
    };
    let inertia =
        shifted(first.inertia, first.mass, first.center) + shifted(turn * second.inertia * turn.transpose(), second.mass, moved);
    Inertial { mass, center, inertia: (inertia + inertia.transpose()) / 2.0 }
}

/// Mass properties of a solid box.
pub(super) fn block(mass: f64, center: [f64; 3], half_extents: [f64; 3]) -> Inertial {
    let [x, y, z] = half_extents.map(|half| half * half * mass / 3.0);
    Inertial { mass, center: Point3::from(center), inertia: Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y)) }
}

/// A capsule between two points of the link frame.
pub(super) fn segment(from: [f64; 3], to: [f64; 3], radius: f64, color: [f32; 3]) -> Solid {
    let along = Vector3::from(to) - Vector3::from(from);
    Solid { shape: Shape::Capsule { radius, half_length: along.norm() / 2.0 }, carrier_from_solid: between(from, to), color }
}

/// A cylinder between two points of the link frame.
pub(super) fn drum(from: [f64; 3], to: [f64; 3], radius: f64, color: [f32; 3]) -> Solid {
    let along = Vector3::from(to) - Vector3::from(from);
    Solid { shape: Shape::Cylinder { radius, half_length: along.norm() / 2.0 }, carrier_from_solid: between(from, to), color }
}

/// A box along the link's axes.
pub(super) fn brick(center: [f64; 3], half_extents: [f64; 3], color: [f32; 3]) -> Solid {
    Solid { shape: Shape::Box { half_extents }, carrier_from_solid: translation(center[0], center[1], center[2]), color }
}

/// The frame midway between two points whose z points from the first to the second.
fn between(from: [f64; 3], to: [f64; 3]) -> Pose {
    let (from, to) = (Vector3::from(from), Vector3::from(to));
    let turn = Rotation3::rotation_between(&Vector3::z(), &(to - from))
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    Pose::from_parts(Translation3::from((from + to) / 2.0), UnitQuaternion::from_rotation_matrix(&turn))
}
