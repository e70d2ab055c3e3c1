//! Where a line runs inside a solid: closed forms, solid by solid, in the solid's own frame.
//!
//! All solids are convex, so that what a line shares with one is a single span; a ray meets the surface where its span
//! begins, or, if it starts inside, where it ends. Lengths are counted in lengths of the direction, which need not be one.

use crate::convex_hull::{ConvexHull, Plane};
use crate::shape::Shape;
use nalgebra::Vector3;

/// From where to where a line is inside a solid, in lengths of its direction; what lies behind its origin is negative.
pub type Span = [f64; 2];

/// The span of the line `origin + t · direction` inside `shape`, both in the shape's frame; `None` if it passes by.
///
/// A line that touches the surface only has an empty span there. The direction must not be zero.
pub fn span(shape: &Shape, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Span> {
    match *shape {
        Shape::Convex(ref hull) => polyhedron(origin, direction, hull),
        Shape::Sphere { radius } => ball(origin, direction, radius),
        Shape::Capsule { radius, half_length } => capsule(origin, direction, radius, half_length),
        Shape::Cylinder { radius, half_length } => cylinder(origin, direction, radius, half_length),
        Shape::Box { half_extents } => cuboid(origin, direction, &half_extents),
    }
}

/// Where a ray with this span first meets the surface, at zero or further ahead.
#[inline]
pub fn ahead([enter, leave]: Span) -> Option<f64> {
    if enter >= 0.0 {
        Some(enter)
    } else if leave >= 0.0 {
        Some(leave)
    } else {
        None
    }
}

/// The outward unit normal of the surface at `point`, which lies on it (shape's frame); on an edge, of one of its sides.
pub fn normal(shape: &Shape, point: &Vector3<f64>) -> Vector3<f64> {
    let flat = Vector3::new(point.x, point.y, 0.0);
    let along_z = Vector3::z() * point.z.signum();
    match *shape {
        Shape::Convex(ref hull) => {
            let height = |plane: &Plane| plane.normal.dot(point) - plane.offset;
            let side = hull.planes().iter().max_by(|a, b| height(a).total_cmp(&height(b)));
            side.map_or_else(Vector3::zeros, |plane| plane.normal)
        }
        Shape::Sphere { .. } => point.normalize(),
        Shape::Capsule { half_length, .. } => (point - Vector3::z() * point.z.clamp(-half_length, half_length)).normalize(),
        Shape::Cylinder { radius, half_length } if flat.norm() - radius < point.z.abs() - half_length => along_z,
        Shape::Cylinder { .. } => flat.normalize(),
        Shape::Box { half_extents } => {
            let side = (point.abs() - Vector3::from(half_extents)).imax();
            let mut normal = Vector3::zeros();
            normal[side] = point[side].signum();
            normal
        }
    }
}

/// a r² − |o × d|² is the discriminant b² − a c without its cancellation.
#[inline]
pub(crate) fn ball(origin: &Vector3<f64>, direction: &Vector3<f64>, radius: f64) -> Option<Span> {
    let a = direction.norm_squared();
    let discriminant = a * radius * radius - origin.cross(direction).norm_squared();
    roots(a, origin.dot(direction), discriminant)
}

/// Inside the infinite cylinder, cut off by the planes of both ends.
#[inline]
pub(crate) fn cylinder(origin: &Vector3<f64>, direction: &Vector3<f64>, radius: f64, half_length: f64) -> Option<Span> {
    let [enter, leave] = pillar(origin, direction, radius)?;
    let [from, to] = slab(origin.z, direction.z, half_length)?;
    some(enter.max(from), leave.min(to))
}

/// Inside the infinite cylinder; beyond its ends, inside the ball there.
#[inline]
pub(crate) fn capsule(origin: &Vector3<f64>, direction: &Vector3<f64>, radius: f64, half_length: f64) -> Option<Span> {
    let [enter, leave] = pillar(origin, direction, radius)?;
    let end = |t: f64, which: usize| {
        // Along the axis t is infinite, and its sign says which end.
        let z = origin.z + t * direction.z;
        if z.abs() <= half_length {
            return Some(t);
        }
        let origin = Vector3::new(origin.x, origin.y, origin.z - half_length.copysign(z));
        ball(&origin, direction, radius).map(|span| span[which])
    };
    Some([end(enter, 0)?, end(leave, 1)?])
}

#[inline]
pub(crate) fn cuboid(origin: &Vector3<f64>, direction: &Vector3<f64>, half_extents: &[f64; 3]) -> Option<Span> {
    let [x, y, z] = half_extents;
    let [x0, x1] = slab(origin.x, direction.x, *x)?;
    let [y0, y1] = slab(origin.y, direction.y, *y)?;
    let [z0, z1] = slab(origin.z, direction.z, *z)?;
    some(x0.max(y0).max(z0), x1.min(y1).min(z1))
}

/// Behind the planes of all faces.
#[inline]
pub(crate) fn polyhedron(origin: &Vector3<f64>, direction: &Vector3<f64>, hull: &ConvexHull) -> Option<Span> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for plane in hull.planes() {
        let (depth, speed) = (plane.offset - plane.normal.dot(origin), plane.normal.dot(direction));
        if speed > 0.0 {
            leave = leave.min(depth / speed);
        } else if speed < 0.0 {
            enter = enter.max(depth / speed);
        } else if depth < 0.0 {
            return None;
        }
        if enter > leave {
            return None;
        }
    }
    Some([enter, leave])
}

/// The infinite cylinder about z; a line along z is inside all the way or not at all.
#[inline]
fn pillar(origin: &Vector3<f64>, direction: &Vector3<f64>, radius: f64) -> Option<Span> {
    let a = direction.x * direction.x + direction.y * direction.y;
    if a == 0.0 {
        let inside = origin.x * origin.x + origin.y * origin.y <= radius * radius;
        return inside.then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let across = origin.x * direction.y - origin.y * direction.x;
    roots(a, origin.x * direction.x + origin.y * direction.y, a * radius * radius - across * across)
}

/// Between two planes at `±half`; a line along them is inside all the way or not at all.
#[inline]
fn slab(origin: f64, direction: f64, half: f64) -> Option<Span> {
    if direction == 0.0 {
        return (origin.abs() <= half).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let [a, b] = [(-half - origin) / direction, (half - origin) / direction];
    Some([a.min(b), a.max(b)])
}

#[inline]
fn roots(a: f64, b: f64, discriminant: f64) -> Option<Span> {
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    Some([(-b - root) / a, (-b + root) / a])
}

#[inline]
fn some(enter: f64, leave: f64) -> Option<Span> {
    (enter <= leave).then_some([enter, leave])
}
