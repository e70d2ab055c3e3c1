//! A cabinet with a door on its left and a drawer on its right, each with a handle; the body has one at the back.
//!
//! Object frame: the table at z = 0, the body towards +y; the door's hinge stands at the left edge of the front.

use super::drawer::{Bay, rear, slide};
use super::kit::{GAP, Grip, Resistance, bar, item as assemble, joint, part, pick, spoke, stream};
use super::lid::{Tab, forward};
use super::{CatalogueItem, InstanceSet};
use crate::{
    geometry::Pose,
    object::{JointKind, Part},
};
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;

/// The door's smallest opening, and how far it opens further (rad). Less open, its hand would meet the drawer's.
const LEAST_OPEN: f64 = 115.0 * PI / 180.0;
const OPENING: f64 = 55.0 * PI / 180.0;

/// The cabinet of this instance, held by three handles.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(7, set, instance);
    let (width, depth, height) = (stream.range(0.190, 0.220), stream.range(0.085, 0.105), stream.range(0.055, 0.070));
    let wall = stream.range(0.004, 0.006);
    let tab =
        Tab { length: stream.range(0.048, 0.056), width: stream.range(0.018, 0.023), thickness: stream.range(0.019, 0.022) };
    let masses = [stream.range(0.16, 0.20), stream.range(0.05, 0.06), stream.range(0.05, 0.06)];
    let travel = stream.range(0.6, 0.7) * depth;
    let door_resistance = Resistance { damping: stream.range(0.006, 0.012), friction: stream.range(0.02, 0.04) };
    let slide_resistance = Resistance { damping: stream.range(2.0, 4.0), friction: stream.range(0.5, 0.9) };
    let palettes = [
        [[0.55, 0.38, 0.24], [0.80, 0.66, 0.42], [0.35, 0.24, 0.18]],
        [[0.78, 0.78, 0.75], [0.30, 0.45, 0.40], [0.85, 0.60, 0.30]],
        [[0.32, 0.35, 0.42], [0.72, 0.30, 0.26], [0.75, 0.72, 0.62]],
    ];
    let [color, door_color, drawer_color] = pick(&mut stream, &palettes);

    let half = width / 2.0;
    let bay = |x| Bay { x, z: [0.0, height], depth, wall };
    let mut body = bay([-half, 0.0]).shell(color);
    body.extend(bay([0.0, half]).shell(color));
    let back = rear(depth, height - tab.thickness / 2.0);
    body.push(tab.solid(&back, 0.0, drawer_color));

    let front = Pose::translation(half / 2.0, 0.0, 0.0) * forward(height / 2.0);
    let mut drawer = bay([0.0, half]).drawer(drawer_color);
    drawer.push(tab.solid(&front, 0.0, color));

    // A closed door points from its hinge to +x; opening turns it clockwise, seen from above, to the front.
    let door_frame = Pose::translation(0.0, 0.0, height / 2.0) * spoke(-half, 0.0, -LEAST_OPEN);
    let door_length = half - GAP;
    let plate = bar(&door_frame, [0.004, door_length], [0.008, height - 0.008], door_color);
    let door = vec![plate, tab.solid(&door_frame, door_length, color)];

    let grips: [Grip; 3] = [tab.grip(0, &back, 0.0), tab.grip(1, &door_frame, door_length), tab.grip(2, &front, 0.0)];
    let line = (Point3::new(-half, 0.0, 0.0), -Vector3::z_axis());
    let hinge = joint("hinge", JointKind::Revolute, [0, 1], line, OPENING, door_resistance);
    let parts: Vec<Part> = [("body", body), ("door", door), ("drawer", drawer)]
        .into_iter()
        .zip(masses)
        .map(|((name, solids), mass)| part(name, mass, solids))
        .collect();
    assemble("cabinet", parts, vec![hinge, slide(2, travel, slide_resistance)], &grips)
}
