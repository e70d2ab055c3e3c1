//! Rectangular sticks: n of them on one axis as a star, one alone for a single arm, or three end to end as a chain.
//!
//! Object frame: z is the axis of all hinges, the sticks lie in the plane z = 0. The first three are red, white and blue.

use super::kit::{Grip, Pin, Resistance, bar, item as assemble, joint, part, spoke, stream};
use super::{CatalogueItem, InstanceSet};
use crate::object::{Joint, JointKind};
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;

/// Fewest and most sticks of a star.
pub(super) const COUNTS: std::ops::RangeInclusive<usize> = 1..=6;

const NAMES: [&str; 6] = ["red", "white", "blue", "green", "yellow", "violet"];
const COLORS: [[f32; 3]; 6] =
    [[0.78, 0.10, 0.12], [0.93, 0.93, 0.91], [0.10, 0.22, 0.70], [0.12, 0.50, 0.22], [0.92, 0.75, 0.12], [0.48, 0.18, 0.60]];

/// Smallest and largest angle between neighbours in a star (degrees), and the sticks' mean length (m), by count from one.
///
/// The largest angles add up to less than a full turn by the smallest one, so that first and last keep apart too. Sticks
/// are longer where they are many, because every Panda hand beside them is 20 cm across.
const STARS: [([f64; 2], f64); 6] = [
    ([80.0, 140.0], 0.155),
    ([80.0, 140.0], 0.155),
    ([80.0, 140.0], 0.170),
    ([75.0, 94.0], 0.200),
    ([60.0, 74.0], 0.225),
    ([50.0, 61.0], 0.250),
];

/// How far a chain's neighbours bend to either side (degrees).
const BEND: f64 = 60.0;

/// What all sticks of an object share.
struct Stick {
    length: f64,
    width: f64,
    thickness: f64,
    mass: f64,
    resistance: Resistance,
}

impl Stick {
    fn draw(kind: u64, set: InstanceSet, instance: u16, length: f64) -> Self {
        let mut stream = stream(kind, set, instance);
        Self {
            length: length * stream.range(0.95, 1.06),
            width: stream.range(0.017, 0.022),
            thickness: stream.range(0.021, 0.025),
            mass: stream.range(0.07, 0.10),
            resistance: Resistance { damping: stream.range(0.006, 0.014), friction: stream.range(0.02, 0.04) },
        }
    }
}

/// A star of `count` sticks on one axis: stick k + 1 turns relative to stick k, away from it as the position grows.
///
/// With three sticks the middle one, white, is the centre of the tree: red and blue both depend on it when it is the root.
pub(super) fn star(name: &str, count: usize, set: InstanceSet, instance: u16) -> CatalogueItem {
    let (spread, length) = STARS[count.clamp(*COUNTS.start(), *COUNTS.end()) - COUNTS.start()];
    let stick = Stick::draw(20 + count as u64, set, instance, length);
    let [smallest, largest] = spread.map(f64::to_radians);
    // Wide enough that neighbours at their smallest angle do not meet outside the discs.
    let radius = (stick.width / 2.0 / (smallest / 2.0).tan() + 0.003).max(0.017);
    let pin = Pin { radius, thickness: stick.thickness, layers: count };
    let frame = |index: usize| spoke(0.0, 0.0, index as f64 * smallest);
    let solids = |index: usize| {
        let mut solids = pin.knuckle(&frame(index), index, stick.width, COLORS[index]).to_vec();
        solids.push(bar(&frame(index), [pin.reach(), stick.length], [stick.width, stick.thickness], COLORS[index]));
        solids
    };
    let parts = (0..count).map(|index| part(NAMES[index], stick.mass, solids(index))).collect();
    let grip = |index: usize| Grip {
        part: index as u16,
        frame: frame(index),
        stretch: [0.6 * stick.length, stick.length - 0.012],
        width: stick.width,
        finger_1: 1.0,
    };
    let grips: Vec<Grip> = (0..count).map(grip).collect();
    let joints = (1..count).map(|child| hinge(child, 0.0, largest - smallest, stick.resistance)).collect();
    assemble(name, parts, joints, &grips)
}

/// Three sticks end to end; at joint positions zero the outer ones are bent fully to the middle one's right.
pub(super) fn chain(name: &str, set: InstanceSet, instance: u16) -> CatalogueItem {
    let stick = Stick::draw(30, set, instance, 0.128);
    // One hand at an end carries all three, a third of a metre of them.
    let mass = 0.6 * stick.mass;
    let pin = Pin { radius: 0.6 * stick.width, thickness: stick.thickness, layers: 2 };
    let (half, bend) = (stick.length / 2.0, BEND.to_radians());
    // Frames at the hinges: two for the middle stick, one for each of the others.
    let middle = [spoke(-half, 0.0, 0.0), spoke(half, 0.0, PI)];
    let outer = [spoke(-half, 0.0, PI + bend), spoke(half, 0.0, -bend)];
    let section = [stick.width, stick.thickness];
    let end = |index: usize, color: [f32; 3]| {
        let mut solids = pin.knuckle(&outer[index], 1, stick.width, color).to_vec();
        solids.push(bar(&outer[index], [pin.reach(), stick.length], section, color));
        solids
    };
    let mut white: Vec<_> = middle.iter().flat_map(|frame| pin.knuckle(frame, 0, stick.width, COLORS[1])).collect();
    white.push(bar(&middle[0], [pin.reach(), stick.length - pin.reach()], section, COLORS[1]));
    let parts =
        vec![part(NAMES[0], mass, end(0, COLORS[0])), part(NAMES[1], mass, white), part(NAMES[2], mass, end(1, COLORS[2]))];
    let grip = |part, frame, from: f64, to: f64| Grip {
        part,
        frame,
        stretch: [from * stick.length, to * stick.length],
        width: stick.width,
        finger_1: 1.0,
    };
    let grips = [grip(0, outer[0], 0.6, 0.9), grip(1, middle[0], 0.4, 0.6), grip(2, outer[1], 0.6, 0.9)];
    let joints = vec![hinge(1, -half, 2.0 * bend, stick.resistance), hinge(2, half, 2.0 * bend, stick.resistance)];
    assemble(name, parts, joints, &grips)
}

/// The hinge about +z at `x` (m) by which stick `child` hangs on the one before it.
fn hinge(child: usize, x: f64, range: f64, resistance: Resistance) -> Joint {
    let name = format!("{}-{}", NAMES[child - 1], NAMES[child]);
    let line = (Point3::new(x, 0.0, 0.0), Vector3::z_axis());
    joint(&name, JointKind::Revolute, [child as u16 - 1, child as u16], line, range, resistance)
}
