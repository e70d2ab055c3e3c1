//! Pliers: two crossing levers, each a handle and a jaw.

use super::kit::{Resistance, part, pick, stream};
use super::levers::{Levers, pivot};
use super::{CatalogueItem, InstanceSet};
use crate::object::ArticulatedObject;
use std::f64::consts::PI;

/// The pliers of this instance and eight demonstrated tuples.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(0, set, instance);
    let palettes = [
        [[0.80, 0.16, 0.14], [0.15, 0.30, 0.70]],
        [[0.90, 0.55, 0.10], [0.10, 0.45, 0.45]],
        [[0.75, 0.20, 0.45], [0.25, 0.50, 0.20]],
    ];
    let levers = Levers {
        hub_radius: 0.017,
        handle_length: stream.range(0.135, 0.165),
        handle_width: stream.range(0.014, 0.020),
        tool_length: stream.range(0.050, 0.070),
        tool_width: 0.012,
        tool_angle: 6.0 * PI / 180.0,
        thickness: stream.range(0.018, 0.024),
    };
    let mass = stream.range(0.18, 0.28);
    let colors = pick(&mut stream, &palettes);
    let object = ArticulatedObject {
        name: "pliers".to_owned(),
        parts: vec![
            part("lever-a", mass / 2.0, levers.solids(0, colors[0])),
            part("lever-b", mass / 2.0, levers.solids(1, colors[1])),
        ],
        joints: vec![pivot(Resistance { damping: 0.01, friction: 0.03 })],
    };
    let grips = [0, 1].map(|lever| levers.grip(lever, [0.0, levers.handle_length]));
    let demonstrations =
        [(0.60, 0.85), (0.85, 0.60), (0.65, 0.75), (0.85, 0.85), (0.70, 0.70), (0.75, 0.65), (0.90, 0.70), (0.70, 0.90)]
            .into_iter()
            .map(|(a, b)| vec![grips[0].at(a), grips[1].at(b)])
            .collect();
    CatalogueItem { object, demonstrations }
}
