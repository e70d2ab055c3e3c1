//! Where lines pass through solids.

use crate::{
    geometry::Pose,
    shape::{Shape, Solid},
};
use nalgebra::{Point3, Unit, Vector3};

/// A line's passage through a solid: from where to where along it (m), and the outward normals there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// Where the line enters and leaves (m along the line, negative behind its origin).
    pub along: [f64; 2],
    /// Outward unit normals there.
    pub normals: [Vector3<f64>; 2],
}

impl Passage {
    /// The whole line, to be cut.
    fn everything() -> Self {
        Self { along: [f64::NEG_INFINITY, f64::INFINITY], normals: [Vector3::zeros(); 2] }
    }

    /// Keeps what lies where `normal`·x ≤ `offset` for the line `origin` + t `direction`; false if nothing is left.
    fn cut(&mut self, (origin, direction): (&Point3<f64>, &Vector3<f64>), normal: &Vector3<f64>, offset: f64) -> bool {
        let (height, slope) = (normal.dot(&origin.coords) - offset, normal.dot(direction));
        if slope == 0.0 {
            return height <= 0.0;
        }
        let t = -height / slope;
        let side = usize::from(slope > 0.0);
        if side == 1 && t < self.along[1] || side == 0 && t > self.along[0] {
            (self.along[side], self.normals[side]) = (t, *normal);
        }
        self.along[0] <= self.along[1]
    }
}

impl Shape {
    /// How the line `origin` + t `direction` (own frame) passes through the solid; `None` if it misses.
    pub fn passage(&self, origin: &Point3<f64>, direction: &Unit<Vector3<f64>>) -> Option<Passage> {
        let line = (origin, direction.as_ref());
        let mut passage = Passage::everything();
        match *self {
            Self::Sphere { radius } => ball(line, &Point3::origin(), radius),
            Self::Box { half_extents } => {
                let sides = (0..3).flat_map(|axis| [1.0, -1.0].map(|side| (axis, side)));
                let mut cut = |(axis, side): (usize, f64)| passage.cut(line, &(Vector3::ith(axis, side)), half_extents[axis]);
                sides.into_iter().all(&mut cut).then_some(passage)
            }
            Self::Convex(ref hull) => {
                hull.planes().iter().all(|plane| passage.cut(line, &plane.normal, plane.offset)).then_some(passage)
            }
            Self::Cylinder { radius, half_length } => {
                let ends = [1.0, -1.0].into_iter().all(|side| passage.cut(line, &(Vector3::z() * side), half_length));
                let mantle = mantle(line, radius)?;
                for side in [0, 1] {
                    let inner = if side == 0 { mantle.along[0] > passage.along[0] } else { mantle.along[1] < passage.along[1] };
                    if inner {
                        (passage.along[side], passage.normals[side]) = (mantle.along[side], mantle.normals[side]);
                    }
                }
                (ends && passage.along[0] <= passage.along[1]).then_some(passage)
            }
            Self::Capsule { radius, half_length } => {
                let rod = Self::Cylinder { radius, half_length }.passage(origin, direction);
                let end = |side: f64| ball(line, &Point3::new(0.0, 0.0, side * half_length), radius);
                let pieces = [rod, end(1.0), end(-1.0)];
                // A convex solid's passage is one stretch: from the first way in to the last way out.
                pieces.into_iter().flatten().reduce(|a, b| {
                    let (enter, leave) =
                        (if a.along[0] <= b.along[0] { a } else { b }, if a.along[1] >= b.along[1] { a } else { b });
                    Passage { along: [enter.along[0], leave.along[1]], normals: [enter.normals[0], leave.normals[1]] }
                })
            }
        }
    }
}

impl Solid {
    /// How a line given in the carrier's frame passes through the solid at `frame_from_carrier`; `None` if it misses.
    pub fn passage(&self, frame_from_carrier: &Pose, origin: &Point3<f64>, direction: &Unit<Vector3<f64>>) -> Option<Passage> {
        let frame_from_solid = frame_from_carrier * self.carrier_from_solid;
        let local = Unit::new_unchecked(frame_from_solid.inverse_transform_vector(direction));
        let passage = self.shape.passage(&frame_from_solid.inverse_transform_point(origin), &local)?;
        Some(Passage { normals: passage.normals.map(|normal| frame_from_solid.rotation * normal), ..passage })
    }
}

/// An infinite cylinder about z.
fn mantle((origin, direction): (&Point3<f64>, &Vector3<f64>), radius: f64) -> Option<Passage> {
    let (out, across) = (origin.coords.xy(), direction.xy());
    let square = across.norm_squared();
    if square < 1e-24 {
        return (out.norm() <= radius).then(Passage::everything);
    }
    let middle = -out.dot(&across) / square;
    let room = radius * radius - (out + across * middle).norm_squared();
    let half = (room >= 0.0).then(|| (room / square).sqrt())?;
    let along = [middle - half, middle + half];
    Some(Passage { along, normals: along.map(|t| (out + across * t).push(0.0) / radius) })
}

fn ball((origin, direction): (&Point3<f64>, &Vector3<f64>), center: &Point3<f64>, radius: f64) -> Option<Passage> {
    let offset = origin - center;
    let middle = -offset.dot(direction);
    let room = radius * radius - (offset + direction * middle).norm_squared();
    let half = (room >= 0.0).then(|| room.sqrt())?;
    let along = [middle - half, middle + half];
    Some(Passage { along, normals: along.map(|t| (offset + direction * t) / radius) })
}

/// The stretch of solid matter that a line passes through around its origin: passages that touch count as one.
///
/// `None` if the origin lies in no solid. The solids' carrier stands at the identity.
pub fn stretch_through(solids: &[Solid], origin: &Point3<f64>, direction: &Unit<Vector3<f64>>) -> Option<Passage> {
    const SEAM: f64 = 1e-4; // m: solids drawn side by side
    let passages: Vec<Passage> = solids.iter().filter_map(|solid| solid.passage(&Pose::identity(), origin, direction)).collect();
    let mut whole: Option<Passage> = None;
    loop {
        let [low, high] = whole.map_or([0.0, 0.0], |passage| passage.along);
        let touches = |passage: &&Passage| {
            let [from, to] = passage.along;
            from <= high + SEAM && to >= low - SEAM && (whole.is_none() || from < low || to > high)
        };
        let Some(next) = passages.iter().find(touches) else { return whole };
        let Some(known) = &mut whole else {
            whole = Some(*next);
            continue;
        };
        for side in [0, 1] {
            if (side == 0 && next.along[0] < low) || (side == 1 && next.along[1] > high) {
                (known.along[side], known.normals[side]) = (next.along[side], next.normals[side]);
            }
        }
    }
}
