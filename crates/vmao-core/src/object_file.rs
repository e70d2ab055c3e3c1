//! The document of one object, `object.json`: what an import writes and every command reads.
//!
//! Everything is given in the object frame, with which all part frames coincide when every joint is at zero.
//! `docs/objects.md` shows an example. Reading checks everything: [`ObjectFile::item`] gives an object that can be
//! simulated, or says what is wrong where.

mod check;

use crate::{
    catalogue::CatalogueItem,
    contact::{Contact, ContactTuple, PartId},
    json_pose::JsonPose,
    object::{ArticulatedObject, Joint, JointKind, Part},
    shape::{Shape, Solid},
};
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// The version of the layout.
pub const SCHEMA: u32 = 1;
/// The name that an object file has in its folder.
pub const FILE_NAME: &str = "object.json";
/// The most parts of an object in a file.
pub const MAX_PARTS: usize = 64;
/// The most solids of an object in a file, all parts together.
pub const MAX_SOLIDS: usize = 1024;
/// The most pictures' meshes of an object in a file, all parts together.
pub const MAX_MESHES: usize = 1024;
/// The most demonstrations in a file.
pub const MAX_DEMONSTRATIONS: usize = 1024;
/// The longest name of an object, a part or a joint.
pub const MAX_NAME: usize = 64;
/// The longest note and the longest path of a mesh (bytes).
pub const MAX_TEXT: usize = 4096;
/// The range of a part's mass (kg).
pub const MASSES: [f64; 2] = [1e-6, 1e3];
/// The range of a solid's sizes (m).
pub const SIZES: [f64; 2] = [1e-5, 100.0];
/// Positions, limits of joints, damping and friction are at most this (m, rad, N·m·s/rad and so on).
pub const LARGEST: f64 = 1e4;

/// An object, as its file says it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectFile {
    /// Version of this layout: [`SCHEMA`].
    pub schema: u32,
    /// Its name: letters, digits, `-`, `_` and `.`.
    pub name: String,
    /// Its parts; the first is the default dependency root.
    pub parts: Vec<PartEntry>,
    /// Its joints; a tree over the parts.
    #[serde(default)]
    pub joints: Vec<JointEntry>,
    /// Known ways to hold it: for each part one contact.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub demonstrations: Vec<Vec<ContactEntry>>,
    /// Where it came from, for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

/// A part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartEntry {
    /// Its name, unique in the object; spelled as the object's.
    pub name: String,
    /// Its mass (kg), spread over its solids by volume.
    pub mass: f64,
    /// What it is made of, for physics and cameras.
    pub solids: Vec<SolidEntry>,
    /// What it looks like, for pictures only.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub meshes: Vec<MeshEntry>,
}

/// A solid of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolidEntry {
    /// `{"type": "box", "half_extents": [x, y, z]}` and the like; sizes in metres.
    pub shape: Shape,
    /// Where it is in the part's frame.
    #[serde(default)]
    pub pose: JsonPose,
    /// Red, green, blue in [0, 1].
    pub color: [f32; 3],
}

/// A mesh for pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshEntry {
    /// An OBJ file, relative to the object file's folder, with `/` and without `..`.
    pub file: String,
    /// Where it is in the part's frame.
    #[serde(default)]
    pub pose: JsonPose,
}

/// A joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointEntry {
    /// Its name, unique among the joints; spelled as the object's.
    pub name: String,
    /// Revolute, prismatic, ball or fixed.
    #[serde(rename = "type")]
    pub kind: JointKind,
    /// The part that the motion is relative to.
    pub parent: String,
    /// The part that moves for a positive position.
    pub child: String,
    /// A point on the axis or the centre of a ball, object frame at zero (m); asked of revolute and ball joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anchor: Option<[f64; 3]>,
    /// The axis, object frame at zero, of any length but zero; asked of revolute and prismatic joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// Lowest and highest position (rad or m), zero between them; of a ball joint, zero and the largest angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<[f64; 2]>,
    /// Viscous damping (N·m·s/rad or N·s/m).
    #[serde(default)]
    pub damping: f64,
    /// Dry friction (N·m or N).
    #[serde(default)]
    pub friction: f64,
}

/// Where the two fingers of one gripper hold one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactEntry {
    /// The part.
    pub part: String,
    /// Finger 1 and finger 2, part frame (m).
    pub fingers: [[f64; 3]; 2],
}

/// One step into the document.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The value of this key.
    Key(&'static str),
    /// The element with this index.
    Index(usize),
}

/// What is wrong with an object file, and where.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}{message}", position(place))]
pub struct ObjectFileError {
    /// The way to the value that is refused.
    pub place: Vec<Step>,
    /// What was found and what was expected.
    pub message: String,
}

struct Position<'a>(&'a [Step]);

fn position(place: &[Step]) -> Position<'_> {
    Position(place)
}

impl fmt::Display for Position<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (depth, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) if depth == 0 => formatter.write_str(key)?,
                Step::Key(key) => write!(formatter, ".{key}")?,
                Step::Index(index) => write!(formatter, "[{index}]")?,
            }
        }
        if self.0.is_empty() { Ok(()) } else { formatter.write_str(": ") }
    }
}

impl ObjectFile {
    /// The document of an object and known ways to hold it; meshes and a note may be added.
    pub fn new(object: &ArticulatedObject, demonstrations: &[ContactTuple]) -> Self {
        let name = |part: PartId| object.parts[usize::from(part.0)].name.clone();
        let contact = |contact: &Contact| ContactEntry { part: name(contact.part), fingers: contact.fingers.map(Into::into) };
        Self {
            schema: SCHEMA,
            name: object.name.clone(),
            parts: object.parts.iter().map(PartEntry::from).collect(),
            joints: object.joints.iter().map(|joint| JointEntry::new(joint, name(joint.parent), name(joint.child))).collect(),
            demonstrations: demonstrations.iter().map(|tuple| tuple.iter().map(contact).collect()).collect(),
            source: None,
        }
    }

    /// The object with its demonstrations, or the first thing that is wrong with the document.
    pub fn item(&self) -> Result<CatalogueItem, ObjectFileError> {
        check::item(self)
    }
}

impl From<&Part> for PartEntry {
    fn from(part: &Part) -> Self {
        let solid = |solid: &Solid| SolidEntry {
            shape: solid.shape.clone(),
            pose: JsonPose::from(&solid.carrier_from_solid),
            color: solid.color,
        };
        Self { name: part.name.clone(), mass: part.mass, solids: part.solids.iter().map(solid).collect(), meshes: Vec::new() }
    }
}

impl JointEntry {
    fn new(joint: &Joint, parent: String, child: String) -> Self {
        let (anchored, turning) = match joint.kind {
            JointKind::Revolute | JointKind::Prismatic => (true, true),
            JointKind::Ball => (true, false),
            JointKind::Fixed => (false, false),
        };
        Self {
            name: joint.name.clone(),
            kind: joint.kind,
            parent,
            child,
            anchor: anchored.then(|| joint.anchor.into()),
            axis: turning.then(|| joint.axis.into_inner().into()),
            limits: joint.limits.filter(|_| joint.kind != JointKind::Fixed),
            damping: joint.damping,
            friction: joint.friction,
        }
    }
}
