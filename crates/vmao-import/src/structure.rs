//! From links and joints to parts: one tree, placed with every joint within its limits, and nothing in it without shape.
//!
//! After placing, everything is in the object's frame, so joining links is joining lists.

mod limits;
mod place;
mod reduce;

use crate::{
    description::{Description, Form, Motion},
    repairs::{Quirk, Repairs},
};
use nalgebra::{Point3, Unit, Vector3};
use vmao_core::geometry::Pose;

/// Of a helper link's two joints, the one that stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum HelperMotion {
    /// The one that slides.
    #[default]
    Slide,
    /// The one that turns.
    Turn,
}

/// A geometry in the object's frame.
#[derive(Debug, Clone)]
pub struct PlacedGeometry {
    /// The link and the geometry's own name.
    pub name: String,
    /// Where it is.
    pub object_from_geometry: Pose,
    /// What it is.
    pub form: Form,
    /// Its colour, if the description says it.
    pub color: Option<[f32; 4]>,
    /// Its image, if the description names one.
    pub texture: Option<String>,
}

/// A rigid part: one link, or several that were fixed to each other.
#[derive(Debug, Clone, Default)]
pub struct PartDraft {
    /// Its name.
    pub name: String,
    /// The links in it.
    pub links: Vec<String>,
    /// What is looked at.
    pub visuals: Vec<PlacedGeometry>,
    /// What collides.
    pub collisions: Vec<PlacedGeometry>,
    /// What its links weigh, if all that have a shape say so (kg).
    pub mass: Option<f64>,
}

impl PartDraft {
    fn is_empty(&self) -> bool {
        self.visuals.is_empty() && self.collisions.is_empty()
    }
}

/// A joint in the object's frame; zero is where the object is placed.
#[derive(Debug, Clone)]
pub struct JointDraft {
    /// Its name.
    pub name: String,
    /// What motion it allows: turn, slide or ball.
    pub motion: Motion,
    /// Index of the part that the motion is relative to.
    pub parent: usize,
    /// Index of the part that moves.
    pub child: usize,
    /// A point on the axis (m).
    pub anchor: Point3<f64>,
    /// The axis.
    pub axis: Unit<Vector3<f64>>,
    /// Lowest and highest position, zero between them; none if endless (rad or m).
    pub limits: Option<[f64; 2]>,
    /// Viscous damping, if the file says it.
    pub damping: Option<f64>,
    /// Dry friction, if the file says it.
    pub friction: Option<f64>,
}

/// Parts and the joints between them: a tree, its root first.
#[derive(Debug, Clone)]
pub struct Structure {
    /// The parts.
    pub parts: Vec<PartDraft>,
    /// The joints.
    pub joints: Vec<JointDraft>,
}

/// The structure of `description`; links named in `dropped` are left out with all that hangs on them.
///
/// Fails if the joints are no tree, or if links without shape hold several others together.
pub fn structure(
    description: &Description,
    dropped: &[String],
    helper: HelperMotion,
    repairs: &mut Repairs,
) -> Result<Structure, String> {
    let placed = place::place(description, dropped, repairs)?;
    let structure = reduce::reduce(placed, helper, repairs)?;
    if structure.parts.iter().all(PartDraft::is_empty) {
        return Err("no link has a visual or a collision shape".to_owned());
    }
    Ok(structure)
}

/// Says that something was left out.
fn ignored(repairs: &mut Repairs, subject: &str, what: &str) {
    repairs.add(Quirk::Ignored, subject, what);
}
