//! Two levers that cross at a pivot, each a handle and a tool: what pliers and scissors have in common.
//!
//! Object frame: pivot at the origin, joint axis +z, tools towards +x, handles towards -x. Joint position zero is the
//! handles' smallest spread.

use super::kit::{Grip, Resistance, STEEL, bar, joint, turned};
use crate::{
    geometry::Pose,
    object::{Joint, JointKind},
    shape::{Shape, Solid},
};
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;

/// Spread of the handles at joint position zero, and how far they open further (rad).
///
/// Wide, because two Panda hands, each 20 cm across, hold the two handles at the same time.
pub(super) const SMALLEST_SPREAD: f64 = 80.0 * PI / 180.0;
const OPENING: f64 = 60.0 * PI / 180.0;

/// The sizes of both levers (m, rad).
pub(super) struct Levers {
    pub(super) hub_radius: f64,
    pub(super) handle_length: f64,
    pub(super) handle_width: f64,
    pub(super) tool_length: f64,
    pub(super) tool_width: f64,
    /// Tools stand this far off the +x axis at joint position zero.
    pub(super) tool_angle: f64,
    pub(super) thickness: f64,
}

/// +1 for lever a, -1 for lever b.
pub(super) fn side(lever: u16) -> f64 {
    if lever == 0 { 1.0 } else { -1.0 }
}

impl Levers {
    /// The frame of a lever's handle at joint position zero: x from the pivot along the handle.
    pub(super) fn handle(&self, lever: u16) -> Pose {
        turned(PI - side(lever) * SMALLEST_SPREAD / 2.0)
    }

    /// Hub, handle and tool of a lever. They cross in two layers: lever a's hub below, lever b's above.
    pub(super) fn solids(&self, lever: u16, color: [f32; 3]) -> Vec<Solid> {
        let hub = Solid {
            shape: Shape::Cylinder { radius: self.hub_radius, half_length: self.thickness / 4.0 },
            carrier_from_solid: Pose::translation(0.0, 0.0, -side(lever) * self.thickness / 4.0),
            color: STEEL,
        };
        let tool = turned(-side(lever) * self.tool_angle);
        let begin = self.hub_radius * 0.7;
        vec![
            hub,
            bar(&self.handle(lever), [begin, self.handle_length], [self.handle_width, self.thickness], color),
            bar(&tool, [begin, self.tool_length], [self.tool_width, self.thickness], STEEL),
        ]
    }

    /// A grip on a stretch of a lever's handle. Finger 1 is on the outer side: of lever a, to the right seen from the pivot.
    pub(super) fn grip(&self, lever: u16, stretch: [f64; 2]) -> Grip {
        Grip { part: lever, frame: self.handle(lever), stretch, width: self.handle_width, finger_1: -side(lever) }
    }
}

/// The pivot, which spreads the handles as its position grows.
pub(super) fn pivot(resistance: Resistance) -> Joint {
    joint("pivot", JointKind::Revolute, [0, 1], (Point3::origin(), Vector3::z_axis()), OPENING, resistance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levers() -> Levers {
        let (handle_length, handle_width, tool_length, tool_width) = (0.15, 0.018, 0.06, 0.012);
        Levers { hub_radius: 0.017, handle_length, handle_width, tool_length, tool_width, tool_angle: 0.1, thickness: 0.02 }
    }

    #[test]
    fn opening_the_joint_spreads_the_handles() {
        let along = |lever, turn| turned(turn) * levers().handle(lever) * Vector3::x();
        // Lever b is the child: a positive turn about +z takes its handle away from lever a's.
        assert!((along(0, 0.0).angle(&along(1, 0.0)) - SMALLEST_SPREAD).abs() < 1e-12);
        assert!((along(0, 0.0).angle(&along(1, OPENING)) - SMALLEST_SPREAD - OPENING).abs() < 1e-12);
    }

    #[test]
    fn finger_one_is_on_the_outer_side() {
        // Handles point to -x; outward is +y for lever a and -y for lever b.
        for lever in 0..2 {
            let contact = levers().grip(lever, [0.0, 0.15]).at(0.8);
            assert!(side(lever) * (contact.fingers[0].y - contact.fingers[1].y) > 0.0);
        }
    }
}
