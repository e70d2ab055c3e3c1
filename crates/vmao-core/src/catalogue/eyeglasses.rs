//! Eyeglasses of a size for robots' hands: a frame with two lenses and two temples, each on a hinge of its own.
//!
//! They stand on the lenses' rims and the temples' tips. Object frame: both hinges about z, the frame along x, the temples
//! towards -y. Joint positions are zero where the temples are least open, and grow outward.

use super::kit::{Grip, Pin, Resistance, bar, block, item as assemble, joint, part, pick, placed, spoke, stream};
use super::{CatalogueItem, InstanceSet};
use crate::{
    geometry::Pose,
    object::JointKind,
    shape::{Shape, Solid},
};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Between frame and temple at joint position zero, and how far a temple opens further (rad).
const LEAST_OPEN: f64 = 105.0 * PI / 180.0;
const OPENING: f64 = 45.0 * PI / 180.0;
/// How much of a temple's end bends down (m).
const TIP: f64 = 0.010;

/// The eyeglasses of this instance, held by the bridge and by both temples.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(5, set, instance);
    let (span, temple_length) = (stream.range(0.190, 0.215), stream.range(0.140, 0.155));
    let (frame_width, temple_width) = (stream.range(0.017, 0.020), stream.range(0.017, 0.020));
    let thickness = stream.range(0.021, 0.025);
    let lens_radius = stream.range(0.027, 0.031);
    let (frame_mass, temple_mass) = (stream.range(0.06, 0.08), stream.range(0.035, 0.045));
    let resistance = Resistance { damping: stream.range(0.006, 0.012), friction: stream.range(0.02, 0.035) };
    let palettes = [
        [[0.30, 0.16, 0.09], [0.45, 0.26, 0.14]],
        [[0.10, 0.18, 0.42], [0.22, 0.34, 0.62]],
        [[0.55, 0.10, 0.18], [0.72, 0.28, 0.30]],
    ];
    let [color, temple_color] = pick(&mut stream, &palettes);

    let half = span / 2.0;
    let pin = Pin { radius: 0.6 * frame_width.max(temple_width), thickness, layers: 2 };
    let ends = [spoke(-half, 0.0, 0.0), spoke(half, 0.0, PI)];
    let temples = [spoke(-half, 0.0, -LEAST_OPEN), spoke(half, 0.0, PI + LEAST_OPEN)];
    let mut front: Vec<Solid> = ends.iter().flat_map(|end| pin.knuckle(end, 0, frame_width, color)).collect();
    front.push(bar(&ends[0], [pin.reach(), span - pin.reach()], [frame_width, thickness], color));
    front.extend([-0.3, 0.3].map(|share| lens(share * span, lens_radius, thickness)));
    let ground = thickness / 2.0 - 2.0 * lens_radius;
    let temple = |index: usize| {
        let mut solids = pin.knuckle(&temples[index], 1, temple_width, temple_color).to_vec();
        solids.push(bar(&temples[index], [pin.reach(), temple_length], [temple_width, thickness], temple_color));
        let tip = block(
            [temple_length - TIP, -temple_width / 2.0, ground],
            [temple_length, temple_width / 2.0, -thickness / 2.0],
            temple_color,
        );
        solids.push(placed(&temples[index], &tip));
        solids
    };
    let parts = vec![
        part("frame", frame_mass, front),
        part("left-temple", temple_mass, temple(0)),
        part("right-temple", temple_mass, temple(1)),
    ];
    let grip = |part, frame, stretch, width| Grip { part, frame, stretch, width, finger_1: 1.0 };
    let on_temple = [0.58 * temple_length, temple_length - TIP - 0.010];
    let grips = [
        grip(0, ends[0], [half - 0.012, half + 0.012], frame_width),
        grip(1, temples[0], on_temple, temple_width),
        grip(2, temples[1], on_temple, temple_width),
    ];
    let hinge = |name, child, x, axis| {
        joint(name, JointKind::Revolute, [0, child], (Point3::new(x, 0.0, 0.0), axis), OPENING, resistance)
    };
    let joints = vec![hinge("left-hinge", 1, -half, -Vector3::z_axis()), hinge("right-hinge", 2, half, Vector3::z_axis())];
    assemble("eyeglasses", parts, joints, &grips)
}

/// A round lens that hangs from the top of the frame at `x` (m).
fn lens(x: f64, radius: f64, thickness: f64) -> Solid {
    let upright = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
    let carrier_from_solid = Pose::from_parts(Translation3::new(x, 0.0, thickness / 2.0 - radius), upright);
    Solid { shape: Shape::Cylinder { radius, half_length: 0.004 }, carrier_from_solid, color: [0.16, 0.24, 0.30] }
}
