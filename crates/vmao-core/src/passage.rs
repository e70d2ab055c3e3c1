//! Where lines pass through the matter of several solids.

use crate::{
    geometry::Pose,
    rays::{Span, normal, span},
    shape::Solid,
};
use nalgebra::{Point3, Unit, Vector3};

/// A line's passage through matter: from where to where along it (m), and the outward unit normals there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// Where the line enters and leaves (m along the line, negative behind its origin).
    pub along: Span,
    /// Outward unit normals there.
    pub normals: [Vector3<f64>; 2],
}

impl Solid {
    /// How a line passes through the solid whose carrier stands at `frame_from_carrier`; `None` if it misses.
    pub fn passage(&self, frame_from_carrier: &Pose, origin: &Point3<f64>, direction: &Unit<Vector3<f64>>) -> Option<Passage> {
        let frame_from_solid = frame_from_carrier * self.carrier_from_solid;
        let origin = frame_from_solid.inverse_transform_point(origin).coords;
        let direction = frame_from_solid.inverse_transform_vector(direction);
        let along = span(&self.shape, &origin, &direction)?;
        let normals = along.map(|along| frame_from_solid.rotation * normal(&self.shape, &(origin + direction * along)));
        Some(Passage { along, normals })
    }
}

/// The stretch of matter that a line passes through around its origin: passages that touch count as one.
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
