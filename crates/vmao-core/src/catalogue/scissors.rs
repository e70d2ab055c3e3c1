//! Scissors: two crossing levers, each a shank that ends in a loop and a blade.

use super::kit::{Resistance, bar, item as assemble, part, pick, stream};
use super::levers::{Levers, pivot};
use super::{CatalogueItem, InstanceSet};
use crate::{geometry::Pose, shape::Solid};
use std::f64::consts::{PI, TAU};

/// A loop is a ring of so many straight pieces.
const LOOP_PIECES: u32 = 8;

/// The scissors of this instance, held by their shanks.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(1, set, instance);
    let levers = Levers {
        hub_radius: stream.range(0.014, 0.017),
        handle_length: stream.range(0.145, 0.165),
        handle_width: stream.range(0.016, 0.020),
        tool_length: stream.range(0.090, 0.120),
        tool_width: stream.range(0.010, 0.013),
        tool_angle: 4.0 * PI / 180.0,
        thickness: stream.range(0.020, 0.024),
    };
    let loop_radius = stream.range(0.020, 0.026);
    let mass = stream.range(0.12, 0.20);
    let resistance = Resistance { damping: stream.range(0.006, 0.012), friction: stream.range(0.02, 0.04) };
    let color = pick(&mut stream, &[[0.85, 0.45, 0.10], [0.12, 0.35, 0.65], [0.15, 0.50, 0.30], [0.60, 0.15, 0.50]]);
    let lever = |index: u16| {
        let mut solids = levers.solids(index, color);
        let center = levers.handle(index) * Pose::translation(levers.handle_length + loop_radius, 0.0, 0.0);
        solids.extend(ring(&center, loop_radius, levers.thickness, color));
        solids
    };
    let parts = vec![part("blade-a", mass / 2.0, lever(0)), part("blade-b", mass / 2.0, lever(1))];
    // Clear of the other shank towards the pivot, and of the loop.
    let grips = [0, 1].map(|index| levers.grip(index, [0.6 * levers.handle_length, levers.handle_length - 0.018]));
    assemble("scissors", parts, vec![pivot(resistance)], &grips)
}

/// A ring about z of straight pieces, 7 mm wide.
fn ring(center: &Pose, radius: f64, thickness: f64, color: [f32; 3]) -> Vec<Solid> {
    let half = radius * (PI / f64::from(LOOP_PIECES)).tan() + 0.003;
    let piece = |index: u32| {
        let out = center * super::kit::turned(TAU * f64::from(index) / f64::from(LOOP_PIECES));
        bar(&(out * Pose::translation(radius, 0.0, 0.0)), [-0.0035, 0.0035], [2.0 * half, thickness], color)
    };
    (0..LOOP_PIECES).map(piece).collect()
}
