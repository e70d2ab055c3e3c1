//! A small chest with one drawer: the drawer slides out of the case, both have a handle.
//!
//! Object frame: the table at z = 0, the case towards +y, the drawer's front at y = 0; the drawer slides towards -y.

use super::kit::{GAP, Resistance, block, item as assemble, joint, part, pick, stream};
use super::lid::{Tab, forward};
use super::lidded_box::tray;
use super::{CatalogueItem, InstanceSet};
use crate::{
    geometry::Pose,
    object::{Joint, JointKind},
    shape::Solid,
};
use nalgebra::{Point3, Vector3};
use std::f64::consts::FRAC_PI_2;

/// The drawer of this instance, held by the handles of case and drawer.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(6, set, instance);
    let (width, depth, height) = (stream.range(0.095, 0.120), stream.range(0.095, 0.120), stream.range(0.048, 0.060));
    let wall = stream.range(0.004, 0.006);
    let tab =
        Tab { length: stream.range(0.048, 0.056), width: stream.range(0.018, 0.023), thickness: stream.range(0.019, 0.022) };
    let (case_mass, drawer_mass) = (stream.range(0.12, 0.15), stream.range(0.06, 0.08));
    let travel = stream.range(0.6, 0.7) * depth;
    let resistance = Resistance { damping: stream.range(2.0, 4.0), friction: stream.range(0.5, 0.9) };
    let palettes = [
        [[0.62, 0.46, 0.30], [0.85, 0.80, 0.70]],
        [[0.28, 0.36, 0.40], [0.80, 0.52, 0.25]],
        [[0.70, 0.72, 0.68], [0.30, 0.48, 0.62]],
    ];
    let [color, front_color] = pick(&mut stream, &palettes);

    let half = width / 2.0;
    let bay = Bay { x: [-half, half], z: [0.0, height], depth, wall };
    let mut case = bay.shell(color);
    let back = rear(depth, height - tab.thickness / 2.0);
    case.push(tab.solid(&back, 0.0, front_color));
    let front = forward(height / 2.0);
    let mut drawer = bay.drawer(front_color);
    drawer.push(tab.solid(&front, 0.0, color));
    let grips = [tab.grip(0, &back, 0.0), tab.grip(1, &front, 0.0)];
    let parts = vec![part("case", case_mass, case), part("drawer", drawer_mass, drawer)];
    assemble("drawer", parts, vec![slide(1, travel, resistance)], &grips)
}

/// A frame with x towards +y of the object, z up, at the back of a case of this `depth`, at height `z` (m).
pub(super) fn rear(depth: f64, z: f64) -> Pose {
    Pose::translation(0.0, depth, z) * super::kit::turned(FRAC_PI_2)
}

/// The slide that takes `child` out of part 0, towards -y, by at most `travel` (m).
pub(super) fn slide(child: u16, travel: f64, resistance: Resistance) -> Joint {
    joint("slide", JointKind::Prismatic, [0, child], (Point3::origin(), -Vector3::y_axis()), travel, resistance)
}

/// A compartment that is open towards -y (m).
pub(super) struct Bay {
    pub(super) x: [f64; 2],
    pub(super) z: [f64; 2],
    pub(super) depth: f64,
    pub(super) wall: f64,
}

impl Bay {
    /// Floor, roof, sides and back.
    pub(super) fn shell(&self, color: [f32; 3]) -> Vec<Solid> {
        let ([x0, x1], [z0, z1], depth, wall) = (self.x, self.z, self.depth, self.wall);
        vec![
            block([x0, 0.0, z0], [x1, depth, z0 + wall], color),
            block([x0, 0.0, z1 - wall], [x1, depth, z1], color),
            block([x0, 0.0, z0 + wall], [x0 + wall, depth, z1 - wall], color),
            block([x1 - wall, 0.0, z0 + wall], [x1, depth, z1 - wall], color),
            block([x0 + wall, depth - wall, z0 + wall], [x1 - wall, depth, z1 - wall], color),
        ]
    }

    /// A tray that fits in, behind a thicker front.
    pub(super) fn drawer(&self, color: [f32; 3]) -> Vec<Solid> {
        let ([x0, x1], [z0, z1], clear) = (self.x, self.z, self.wall + GAP);
        let low = [x0 + clear, 0.004, z0 + clear];
        let mut solids = tray(low, [x1 - clear, self.depth - clear, z1 - clear - 0.006], self.wall / 2.0, color);
        solids.push(block([x0 + clear, 0.0, z0 + clear], [x1 - clear, 0.006, z1 - clear], color));
        solids
    }
}
