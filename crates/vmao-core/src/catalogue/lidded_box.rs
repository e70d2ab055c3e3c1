//! A box with a hinged lid: a handle in front, a tab on the lid.
//!
//! Object frame: the hinge along x at the back, the box towards -y, the table under it at z = 0.

use super::kit::{Resistance, block, item as assemble, part, pick, stream};
use super::lid::{Lid, Tab, forward};
use super::{CatalogueItem, InstanceSet};
use crate::shape::Solid;

/// The box of this instance, held by its handle and by the lid's tab.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(4, set, instance);
    let (width, depth, height) = (stream.range(0.110, 0.145), stream.range(0.085, 0.105), stream.range(0.050, 0.065));
    let wall = stream.range(0.004, 0.006);
    let tab =
        Tab { length: stream.range(0.048, 0.056), width: stream.range(0.018, 0.023), thickness: stream.range(0.019, 0.022) };
    let lid = Lid { hinge_height: height, depth, width, thickness: stream.range(0.006, 0.009), tab };
    let (base_mass, lid_mass) = (stream.range(0.14, 0.18), stream.range(0.05, 0.07));
    let resistance = Resistance { damping: stream.range(0.012, 0.020), friction: stream.range(0.06, 0.08) };
    let palettes = [
        [[0.55, 0.36, 0.20], [0.72, 0.52, 0.30]],
        [[0.16, 0.40, 0.34], [0.80, 0.72, 0.45]],
        [[0.38, 0.22, 0.48], [0.76, 0.60, 0.78]],
        [[0.25, 0.33, 0.52], [0.78, 0.40, 0.30]],
    ];
    let [color, accent] = pick(&mut stream, &palettes);

    let base_frame = forward(height - tab.thickness / 2.0);
    let mut base = tray([-width / 2.0, -depth, 0.0], [width / 2.0, 0.0, height], wall, color);
    base.push(tab.solid(&base_frame, depth, accent));
    let grips = [tab.grip(0, &base_frame, depth), lid.grip()];
    let parts = vec![part("box", base_mass, base), part("lid", lid_mass, lid.solids(accent, color))];
    assemble("lidded-box", parts, vec![lid.hinge(resistance)], &grips)
}

/// Floor and four walls between two opposite corners (m), open above.
pub(super) fn tray([x0, y0, z0]: [f64; 3], [x1, y1, z1]: [f64; 3], wall: f64, color: [f32; 3]) -> Vec<Solid> {
    vec![
        block([x0, y0, z0], [x1, y1, z0 + wall], color),
        block([x0, y0, z0 + wall], [x1, y0 + wall, z1], color),
        block([x0, y1 - wall, z0 + wall], [x1, y1, z1], color),
        block([x0, y0 + wall, z0 + wall], [x0 + wall, y1 - wall, z1], color),
        block([x1 - wall, y0 + wall, z0 + wall], [x1, y1 - wall, z1], color),
    ]
}
