//! What catalogue objects are put together from: blocks, bars, knuckles that cross in layers, joints, and grips along bars.
//!
//! A bar's frame has its hinge at the origin, x along the bar, y across it and z along the hinge's axis.

use super::{CatalogueItem, InstanceSet};
use crate::{
    contact::{Contact, ContactTuple, PartId},
    geometry::Pose,
    object::{ArticulatedObject, Joint, JointKind, Part},
    random::Stream,
    shape::{Shape, Solid},
};
use nalgebra::{Point3, Translation3, Unit, UnitQuaternion, Vector3};

/// Bare metal.
pub(super) const STEEL: [f32; 3] = [0.62, 0.64, 0.67];
/// Rubber, keys, lenses.
pub(super) const DARK: [f32; 3] = [0.13, 0.14, 0.16];
/// Between the solids of two parts that pass each other (m).
pub(super) const GAP: f64 = 0.0015;

/// The numbers that decide one size of the `kind`-th object; the two sets share none.
pub(super) fn stream(kind: u64, set: InstanceSet, instance: u16) -> Stream {
    let label = match set {
        InstanceSet::Train => 0,
        InstanceSet::HeldOut => 1,
    };
    Stream::new(kind, &[label, u64::from(instance)])
}

/// One of these at random.
pub(super) fn pick<T: Copy>(stream: &mut Stream, choices: &[T]) -> T {
    choices[stream.index(choices.len())]
}

/// An upright block between two opposite corners (m).
pub(super) fn block(low: [f64; 3], high: [f64; 3], color: [f32; 3]) -> Solid {
    let (low, high) = (Vector3::from(low), Vector3::from(high));
    let half_extents = ((high - low) / 2.0).into();
    Solid { shape: Shape::Box { half_extents }, carrier_from_solid: Translation3::from((low + high) / 2.0).into(), color }
}

/// The same solid, carried along with `frame`.
pub(super) fn placed(frame: &Pose, solid: &Solid) -> Solid {
    Solid { carrier_from_solid: frame * solid.carrier_from_solid, ..solid.clone() }
}

/// A turn by `angle` (rad) about +z.
pub(super) fn turned(angle: f64) -> Pose {
    Pose::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle))
}

/// A bar's frame at `x`, `y` (m) that points in the direction `angle` (rad) from +x.
pub(super) fn spoke(x: f64, y: f64, angle: f64) -> Pose {
    Pose::translation(x, y, 0.0) * turned(angle)
}

/// A bar along x of `frame` (m); `section` is its width along y and its thickness along z.
pub(super) fn bar(frame: &Pose, [from, to]: [f64; 2], [width, thickness]: [f64; 2], color: [f32; 3]) -> Solid {
    let solid = block([from, -width / 2.0, -thickness / 2.0], [to, width / 2.0, thickness / 2.0], color);
    placed(frame, &solid)
}

/// A hinge about z where several parts meet in layers, each part with a disc and a neck in its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pin {
    /// Of the discs (m); bars begin outside them.
    pub(super) radius: f64,
    /// Of all layers together (m).
    pub(super) thickness: f64,
    /// Number of layers.
    pub(super) layers: usize,
}

impl Pin {
    /// Where a bar begins that must not touch the other layers' discs (m).
    pub(super) fn reach(&self) -> f64 {
        self.radius + GAP
    }

    /// The disc and the neck of `layer` (0 is the lowest) for a bar of `width` in `frame`.
    pub(super) fn knuckle(&self, frame: &Pose, layer: usize, width: f64, color: [f32; 3]) -> [Solid; 2] {
        let height = self.thickness / self.layers as f64;
        let raised = frame * Pose::translation(0.0, 0.0, (layer as f64 + 0.5) * height - self.thickness / 2.0);
        let half_length = (height - GAP / 2.0) / 2.0;
        let disc =
            Solid { shape: Shape::Cylinder { radius: self.radius, half_length }, carrier_from_solid: raised, color: STEEL };
        [disc, bar(&raised, [0.0, self.reach() + 0.004], [width, 2.0 * half_length], color)]
    }
}

/// A part of this name; `mass` in kg.
pub(super) fn part(name: &str, mass: f64, solids: Vec<Solid>) -> Part {
    Part { name: name.to_owned(), solids, mass }
}

/// How stiffly a joint moves: viscous damping (N·m·s/rad or N·s/m) and dry friction (N·m or N).
#[derive(Debug, Clone, Copy)]
pub(super) struct Resistance {
    pub(super) damping: f64,
    pub(super) friction: f64,
}

/// A joint from part `parent` to part `child` whose position runs from zero to `range` (rad or m).
pub(super) fn joint(
    name: &str,
    kind: JointKind,
    [parent, child]: [u16; 2],
    (anchor, axis): (Point3<f64>, Unit<Vector3<f64>>),
    range: f64,
    resistance: Resistance,
) -> Joint {
    Joint {
        name: name.to_owned(),
        kind,
        parent: PartId(parent),
        child: PartId(child),
        anchor,
        axis,
        limits: Some([0.0, range]),
        damping: resistance.damping,
        friction: resistance.friction,
    }
}

/// A stretch of a bar that a gripper can close across.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grip {
    /// The part it belongs to.
    pub(super) part: u16,
    /// The bar's frame at joint positions zero.
    pub(super) frame: Pose,
    /// Where the stretch begins and ends along x (m).
    pub(super) stretch: [f64; 2],
    /// How far apart the fingers are, along y (m).
    pub(super) width: f64,
    /// +1 if finger 1 lies towards +y, -1 if towards -y.
    pub(super) finger_1: f64,
}

impl Grip {
    /// The contact a `fraction` of the way along the stretch.
    pub(super) fn at(&self, fraction: f64) -> Contact {
        let [from, to] = self.stretch;
        let along = from + fraction * (to - from);
        let finger = |side: f64| self.frame * Point3::new(along, side * self.finger_1 * self.width / 2.0, 0.0);
        Contact { part: PartId(self.part), fingers: [finger(1.0), finger(-1.0)] }
    }
}

/// Eight tuples spread over the grips: tuple k holds grip i at the (3k + 5i mod 8)-th of eight even fractions.
fn demonstrations(grips: &[Grip]) -> Vec<ContactTuple> {
    let fraction = |tuple: usize, grip: usize| ((3 * tuple + 5 * grip) % 8) as f64 / 7.0;
    (0..8).map(|tuple| grips.iter().enumerate().map(|(index, grip)| grip.at(fraction(tuple, index))).collect()).collect()
}

/// The object `name` of these parts and joints, with eight ways to hold it, one grip for each part in order.
pub(super) fn item(name: &str, parts: Vec<Part>, joints: Vec<Joint>, grips: &[Grip]) -> CatalogueItem {
    let demonstrations = demonstrations(grips);
    CatalogueItem { object: ArticulatedObject { name: name.to_owned(), parts, joints }, demonstrations }
}
