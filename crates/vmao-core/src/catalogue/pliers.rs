//! Pliers: two bent levers crossing at a pivot, each a handle and a jaw.
//!
//! Object frame: pivot at the origin, joint axis +z, jaws towards +x, handles towards -x. Joint position zero is the
//! handles' smallest spread.

use super::{CatalogueItem, InstanceSet};
use crate::{
    contact::{Contact, PartId},
    geometry::Pose,
    object::{ArticulatedObject, Joint, JointKind, Part},
    random::Stream,
    shape::{Shape, Solid},
};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::PI;

/// Spread of the handles at joint position zero, and how far they open further (rad).
///
/// Wide, because two Panda hands, each 20 cm across, hold the two handles at the same time.
const SMALLEST_SPREAD: f64 = 80.0 * PI / 180.0;
const OPENING: f64 = 60.0 * PI / 180.0;
/// Jaws stand this far off the +x axis at joint position zero (rad).
const JAW_ANGLE: f64 = 6.0 * PI / 180.0;
const HUB_RADIUS: f64 = 0.017;

struct Size {
    handle_length: f64,
    handle_width: f64,
    jaw_length: f64,
    thickness: f64,
    mass: f64,
    colors: [[f32; 3]; 2],
}

fn size(set: InstanceSet, instance: u16) -> Size {
    let label = match set {
        InstanceSet::Train => 0,
        InstanceSet::HeldOut => 1,
    };
    let mut stream = Stream::new(0, &[label, u64::from(instance)]);
    let palettes = [
        [[0.80, 0.16, 0.14], [0.15, 0.30, 0.70]],
        [[0.90, 0.55, 0.10], [0.10, 0.45, 0.45]],
        [[0.75, 0.20, 0.45], [0.25, 0.50, 0.20]],
    ];
    Size {
        handle_length: stream.range(0.135, 0.165),
        handle_width: stream.range(0.014, 0.020),
        jaw_length: stream.range(0.050, 0.070),
        thickness: stream.range(0.018, 0.024),
        mass: stream.range(0.18, 0.28),
        colors: palettes[stream.index(palettes.len())],
    }
}

/// The pliers of this instance and eight demonstrated tuples.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let size = size(set, instance);
    let part =
        |name: &str, side: f64, color| Part { name: name.to_owned(), solids: lever(&size, side, color), mass: size.mass / 2.0 };
    let object = ArticulatedObject {
        name: "pliers".to_owned(),
        parts: vec![part("lever-a", 1.0, size.colors[0]), part("lever-b", -1.0, size.colors[1])],
        joints: vec![Joint {
            name: "pivot".to_owned(),
            kind: JointKind::Revolute,
            parent: PartId(0),
            child: PartId(1),
            anchor: Point3::origin(),
            axis: Vector3::z_axis(),
            limits: Some([0.0, OPENING]),
            damping: 0.01,
            friction: 0.03,
        }],
    };
    let demonstrations =
        [(0.60, 0.85), (0.85, 0.60), (0.65, 0.75), (0.85, 0.85), (0.70, 0.70), (0.75, 0.65), (0.90, 0.70), (0.70, 0.90)]
            .into_iter()
            .map(|(a, b)| vec![hold(&size, 0, a), hold(&size, 1, b)])
            .collect();
    CatalogueItem { object, demonstrations }
}

/// Direction of a lever's handle at joint position zero, from the pivot. `side` is +1 for lever a, -1 for lever b.
fn handle_angle(side: f64) -> f64 {
    PI - side * SMALLEST_SPREAD / 2.0
}

fn lever(size: &Size, side: f64, color: [f32; 3]) -> Vec<Solid> {
    let steel = [0.62, 0.64, 0.67];
    let bar = |angle: f64, from: f64, to: f64, width: f64, thickness: f64, color| Solid {
        shape: Shape::Box { half_extents: [(to - from) / 2.0, width / 2.0, thickness / 2.0] },
        carrier_from_solid: turned(angle) * Translation3::new((from + to) / 2.0, 0.0, 0.0),
        color,
    };
    // The levers cross in two layers: lever a's hub below, lever b's above.
    let hub = Solid {
        shape: Shape::Cylinder { radius: HUB_RADIUS, half_length: size.thickness / 4.0 },
        carrier_from_solid: Pose::translation(0.0, 0.0, -side * size.thickness / 4.0),
        color: steel,
    };
    vec![
        hub,
        bar(handle_angle(side), HUB_RADIUS * 0.7, size.handle_length, size.handle_width, size.thickness, color),
        bar(-side * JAW_ANGLE, HUB_RADIUS * 0.7, size.jaw_length, 0.012, size.thickness, steel),
    ]
}

fn turned(angle: f64) -> Pose {
    Pose::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle))
}

/// A contact across the width of the handle of part 0 or 1, a `fraction` of the way along it. Finger 1 is on the outer side.
fn hold(size: &Size, part: u16, fraction: f64) -> Contact {
    let side = if part == 0 { 1.0 } else { -1.0 };
    let along = fraction * size.handle_length;
    // The outer side of lever a's handle, seen along the handle from the pivot, is to the right: -y.
    let at = |across: f64| turned(handle_angle(side)) * Point3::new(along, -across * side * size.handle_width / 2.0, 0.0);
    Contact { part: PartId(part), fingers: [at(1.0), at(-1.0)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn demonstrated_fingers_lie_on_opposite_surfaces_of_their_own_handle() {
        for instance in 0..6 {
            let size = size(InstanceSet::Train, instance);
            for tuple in item(InstanceSet::Train, instance).demonstrations {
                for (index, contact) in tuple.iter().enumerate() {
                    assert_eq!(usize::from(contact.part.0), index);
                    let width = contact.width();
                    assert!((width - size.handle_width).abs() < 1e-12);
                    let middle = nalgebra::center(&contact.fingers[0], &contact.fingers[1]);
                    let angle = middle.y.atan2(middle.x).rem_euclid(2.0 * PI);
                    let side = if index == 0 { 1.0 } else { -1.0 };
                    assert!((angle - handle_angle(side)).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn opening_the_joint_spreads_the_handles() {
        // Lever b's handle lies clockwise past -x of lever a's; a positive turn about +z takes it further away.
        assert!(handle_angle(-1.0) > PI && handle_angle(1.0) < PI);
        assert!((handle_angle(-1.0) - handle_angle(1.0) - SMALLEST_SPREAD).abs() < 1e-12);
    }

    #[test]
    fn finger_one_is_on_the_outer_side() {
        let contact = hold(&size(InstanceSet::Train, 0), 0, 0.8);
        // Lever a's handle points to -x, +y; outward is +y of the bisector -x.
        assert!(contact.fingers[0].y > contact.fingers[1].y);
        let mirrored = hold(&size(InstanceSet::Train, 0), 1, 0.8);
        assert!(mirrored.fingers[0].y < mirrored.fingers[1].y);
    }
}
