//! A small, rugged laptop: a base with keys and a carrying handle, and a screen with a tab.
//!
//! Object frame: the hinge along x, the base towards -y, the table under it at z = 0.

use super::kit::{DARK, Resistance, bar, block, item as assemble, part, pick, stream};
use super::lid::{Lid, Tab, forward};
use super::{CatalogueItem, InstanceSet};

/// The laptop of this instance, held by its handle and by the screen's tab.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(3, set, instance);
    let (width, depth) = (stream.range(0.135, 0.165), stream.range(0.090, 0.105));
    let height = stream.range(0.019, 0.023);
    let tab = Tab { length: stream.range(0.048, 0.056), width: stream.range(0.018, 0.023), thickness: height };
    let lid_tab = Tab { thickness: stream.range(0.018, 0.021), ..tab };
    let lid = Lid { hinge_height: height, depth, width, thickness: stream.range(0.008, 0.011), tab: lid_tab };
    let (base_mass, lid_mass) = (stream.range(0.11, 0.14), stream.range(0.048, 0.060));
    let resistance = Resistance { damping: stream.range(0.015, 0.025), friction: stream.range(0.07, 0.085) };
    let color = pick(&mut stream, &[[0.70, 0.71, 0.73], [0.25, 0.28, 0.33], [0.80, 0.74, 0.62], [0.32, 0.42, 0.50]]);

    let base_frame = forward(height / 2.0);
    let base = vec![
        // Some of it behind the hinge, or a screen far open would tip it over.
        block([-width / 2.0, -depth, 0.0], [width / 2.0, 0.012, height], color),
        block([-0.42 * width, -0.55 * depth, height], [0.42 * width, -0.14 * depth, height + 0.001], DARK),
        block([-0.12 * width, -0.90 * depth, height], [0.12 * width, -0.65 * depth, height + 0.001], DARK),
        tab.solid(&base_frame, depth, color),
    ];
    let mut screen = lid.solids(color, color);
    let inside = lid.frame() * crate::geometry::translation(0.0, 0.0, -lid.thickness / 2.0);
    screen.push(bar(&inside, [0.08 * depth, 0.94 * depth], [0.92 * width, 0.001], [0.20, 0.42, 0.62]));
    let grips = [tab.grip(0, &base_frame, depth), lid.grip()];
    let parts = vec![part("base", base_mass, base), part("screen", lid_mass, screen)];
    assemble("laptop", parts, vec![lid.hinge(resistance)], &grips)
}
