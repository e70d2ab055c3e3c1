//! From an object file to an object that can be simulated, or to the first thing that is wrong with it.

use super::{
    ContactEntry, JointEntry, LARGEST, MASSES, MAX_DEMONSTRATIONS, MAX_MESHES, MAX_NAME, MAX_PARTS, MAX_SOLIDS, MAX_TEXT,
    ObjectFile, ObjectFileError, PartEntry, SCHEMA, SIZES, SolidEntry, Step,
};
use crate::{
    catalogue::CatalogueItem,
    contact::{Contact, ContactTuple, PartId},
    geometry::Pose,
    json_pose::{JsonPose, normalized},
    object::{ArticulatedObject, Joint, JointKind, Part},
    object_graph::ObjectGraph,
    shape::{Shape, Solid},
};
use nalgebra::{Point3, Unit, Vector3};

/// A way into the document that grows step by step.
#[derive(Clone, Default)]
struct Place(Vec<Step>);

impl Place {
    fn key(&self, key: &'static str) -> Self {
        Self(self.0.iter().copied().chain([Step::Key(key)]).collect())
    }

    fn at(&self, index: usize) -> Self {
        Self(self.0.iter().copied().chain([Step::Index(index)]).collect())
    }

    fn refuse<T>(self, message: String) -> Result<T, ObjectFileError> {
        Err(ObjectFileError { place: self.0, message })
    }

    fn ensure(&self, holds: bool, message: impl FnOnce() -> String) -> Result<(), ObjectFileError> {
        if holds { Ok(()) } else { self.clone().refuse(message()) }
    }

    /// Refuses a number outside `[low, high]`, and one that is no number.
    fn within(&self, value: f64, [low, high]: [f64; 2]) -> Result<(), ObjectFileError> {
        self.ensure(value >= low && value <= high, || format!("{value:?}, expected a number from {low} to {high}"))
    }

    fn vector(&self, values: &[f64; 3]) -> Result<(), ObjectFileError> {
        values.iter().enumerate().try_for_each(|(axis, &value)| self.at(axis).within(value, [-LARGEST, LARGEST]))
    }

    /// Refuses all names but those that are safe in every document, path and terminal.
    fn name(&self, name: &str) -> Result<(), ObjectFileError> {
        let safe = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.".contains(&byte));
        self.ensure(safe && (1..=MAX_NAME).contains(&name.len()), || {
            let shown: String = name.escape_debug().take(MAX_NAME).collect();
            format!("`{shown}`, expected 1 to {MAX_NAME} letters, digits, `-`, `_` or `.`")
        })
    }

    fn at_most(&self, count: usize, most: usize, what: &str) -> Result<(), ObjectFileError> {
        self.ensure(count <= most, || format!("{count} {what}, expected at most {most}"))
    }

    fn pose(&self, pose: &JsonPose) -> Result<Pose, ObjectFileError> {
        self.key("position").vector(&pose.position)?;
        let quaternion = self.key("quaternion");
        quaternion.ensure(pose.quaternion.iter().all(|x| x.is_finite()), || "not finite, expected a rotation".to_owned())?;
        pose.to_pose().map_or_else(|| quaternion.refuse("zero, expected a rotation [w, x, y, z]".to_owned()), Ok)
    }
}

pub(super) fn item(file: &ObjectFile) -> Result<CatalogueItem, ObjectFileError> {
    let root = Place::default();
    root.key("schema").ensure(file.schema == SCHEMA, || format!("{}, expected {SCHEMA}", file.schema))?;
    root.key("name").name(&file.name)?;
    if let Some(source) = &file.source {
        root.key("source").at_most(source.len(), MAX_TEXT, "bytes")?;
    }
    let parts = parts(&root.key("parts"), &file.parts)?;
    let joints = joints(&root.key("joints"), &file.joints, &parts)?;
    let object = ArticulatedObject { name: file.name.clone(), parts, joints };
    if let Err(error) = ObjectGraph::of(&object) {
        return root.key("joints").refuse(error.to_string());
    }
    let place = root.key("demonstrations");
    place.at_most(file.demonstrations.len(), MAX_DEMONSTRATIONS, "demonstrations")?;
    let tuple = |(index, entries): (usize, &Vec<ContactEntry>)| contacts(&place.at(index), entries, &object.parts);
    let demonstrations = file.demonstrations.iter().enumerate().map(tuple).collect::<Result<_, _>>()?;
    Ok(CatalogueItem { object, demonstrations })
}

/// Refuses the second of two equal names.
fn unique<'a>(place: &Place, names: impl Iterator<Item = &'a str>) -> Result<(), ObjectFileError> {
    let mut seen: Vec<&str> = Vec::new();
    for (index, name) in names.enumerate() {
        if let Some(first) = seen.iter().position(|other| *other == name) {
            return place.at(index).key("name").refuse(format!("`{name}` again, already the name of number {first}"));
        }
        seen.push(name);
    }
    Ok(())
}

fn parts(place: &Place, entries: &[PartEntry]) -> Result<Vec<Part>, ObjectFileError> {
    place.ensure(!entries.is_empty(), || "no parts, expected at least one".to_owned())?;
    place.at_most(entries.len(), MAX_PARTS, "parts")?;
    place.at_most(entries.iter().map(|part| part.solids.len()).sum(), MAX_SOLIDS, "solids")?;
    place.at_most(entries.iter().map(|part| part.meshes.len()).sum(), MAX_MESHES, "meshes")?;
    let part = |(index, entry): (usize, &PartEntry)| part(&place.at(index), entry);
    let parts = entries.iter().enumerate().map(part).collect::<Result<Vec<_>, _>>()?;
    unique(place, parts.iter().map(|part| &*part.name))?;
    Ok(parts)
}

fn part(place: &Place, entry: &PartEntry) -> Result<Part, ObjectFileError> {
    place.key("name").name(&entry.name)?;
    place.key("mass").within(entry.mass, MASSES)?;
    let solids = place.key("solids");
    solids.ensure(!entry.solids.is_empty(), || "no solids, expected at least one".to_owned())?;
    for (index, mesh) in entry.meshes.iter().enumerate() {
        let place = place.key("meshes").at(index);
        mesh_path(&place.key("file"), &mesh.file)?;
        place.key("pose").pose(&mesh.pose)?;
    }
    let solid = |(index, entry): (usize, &SolidEntry)| solid(&solids.at(index), entry);
    let solids = entry.solids.iter().enumerate().map(solid).collect::<Result<_, _>>()?;
    Ok(Part { name: entry.name.clone(), solids, mass: entry.mass })
}

/// Refuses paths that could lead out of the object's folder, on any system.
fn mesh_path(place: &Place, path: &str) -> Result<(), ObjectFileError> {
    let inside = path.split('/').all(|step| !step.is_empty() && step != "." && step != "..");
    let plain = !path.contains(|letter: char| letter.is_control() || "\\:".contains(letter));
    let named = path.to_ascii_lowercase().ends_with(".obj") && path.len() <= MAX_TEXT;
    place.ensure(inside && plain && named, || {
        let shown: String = path.escape_debug().take(MAX_NAME).collect();
        format!("`{shown}`, expected the path of an .obj file within the object's folder")
    })
}

fn solid(place: &Place, entry: &SolidEntry) -> Result<Solid, ObjectFileError> {
    let carrier_from_solid = place.key("pose").pose(&entry.pose)?;
    let [smallest, largest] = SIZES;
    let shape = place.key("shape");
    let size = |key: &'static str, value: f64| shape.key(key).within(value, [smallest, largest]);
    match entry.shape {
        Shape::Sphere { radius } => size("radius", radius)?,
        Shape::Capsule { radius, half_length } | Shape::Cylinder { radius, half_length } => {
            size("radius", radius)?;
            size("half_length", half_length)?;
        }
        Shape::Box { half_extents } => half_extents.into_iter().try_for_each(|half| size("half_extents", half))?,
        // Checked when it was made.
        Shape::Convex(_) => {}
    }
    for (channel, &value) in entry.color.iter().enumerate() {
        place.key("color").at(channel).within(value.into(), [0.0, 1.0])?;
    }
    Ok(Solid { shape: entry.shape.clone(), carrier_from_solid, color: entry.color })
}

fn joints(place: &Place, entries: &[JointEntry], parts: &[Part]) -> Result<Vec<Joint>, ObjectFileError> {
    place.at_most(entries.len(), MAX_PARTS, "joints")?;
    let joint = |(index, entry): (usize, &JointEntry)| joint(&place.at(index), entry, parts);
    let joints = entries.iter().enumerate().map(joint).collect::<Result<Vec<_>, _>>()?;
    unique(place, joints.iter().map(|joint| &*joint.name))?;
    Ok(joints)
}

fn part_named(place: &Place, name: &str, parts: &[Part]) -> Result<PartId, ObjectFileError> {
    let found = parts.iter().position(|part| part.name == name);
    found.map(|index| PartId(index as u16)).map_or_else(
        || {
            let names: Vec<&str> = parts.iter().map(|part| &*part.name).collect();
            let shown: String = name.escape_debug().take(MAX_NAME).collect();
            place.clone().refuse(format!("object has no part `{shown}`; parts are: {}", names.join(", ")))
        },
        Ok,
    )
}

fn joint(place: &Place, entry: &JointEntry, parts: &[Part]) -> Result<Joint, ObjectFileError> {
    place.key("name").name(&entry.name)?;
    let parent = part_named(&place.key("parent"), &entry.parent, parts)?;
    let child = part_named(&place.key("child"), &entry.child, parts)?;
    let asked = |key: &'static str, value: Option<[f64; 3]>, needed: bool| match value {
        Some(vector) => place.key(key).vector(&vector).map(|()| vector),
        None if needed => place.clone().refuse(format!("no {key}, expected one of a {} joint", entry.kind.name())),
        None => Ok([0.0; 3]),
    };
    let anchor = asked("anchor", entry.anchor, matches!(entry.kind, JointKind::Revolute | JointKind::Ball))?;
    let turning = matches!(entry.kind, JointKind::Revolute | JointKind::Prismatic);
    let axis = match normalized(asked("axis", entry.axis, turning)?) {
        Some(axis) => Unit::new_unchecked(Vector3::from(axis)),
        None if turning => return place.key("axis").refuse("zero, expected a direction".to_owned()),
        None => Vector3::z_axis(),
    };
    if let Some([low, high]) = entry.limits {
        let limits = place.key("limits");
        limits.at(0).within(low, [-LARGEST, LARGEST])?;
        limits.at(1).within(high, [-LARGEST, LARGEST])?;
        limits.ensure(low < high, || format!("[{low:?}, {high:?}], expected [low, high] with low < high"))?;
        let from_zero = entry.kind != JointKind::Ball || low == 0.0;
        limits.ensure(low <= 0.0 && high >= 0.0 && from_zero, || {
            format!(
                "[{low:?}, {high:?}] without zero, at which the parts are drawn; expected low ≤ 0 ≤ high (a ball: [0, angle])"
            )
        })?;
    }
    place.key("damping").within(entry.damping, [0.0, LARGEST])?;
    place.key("friction").within(entry.friction, [0.0, LARGEST])?;
    Ok(Joint {
        name: entry.name.clone(),
        kind: entry.kind,
        parent,
        child,
        anchor: Point3::from(anchor),
        axis,
        limits: entry.limits,
        damping: entry.damping,
        friction: entry.friction,
    })
}

/// A demonstration: one contact for every part, none twice.
fn contacts(place: &Place, entries: &[ContactEntry], parts: &[Part]) -> Result<ContactTuple, ObjectFileError> {
    let mut tuple = ContactTuple::new();
    for (index, entry) in entries.iter().enumerate() {
        let place = place.at(index);
        let part = part_named(&place.key("part"), &entry.part, parts)?;
        let again = tuple.iter().any(|contact| contact.part == part);
        place.key("part").ensure(!again, || format!("`{}` again, expected each part once", entry.part))?;
        for (finger, point) in entry.fingers.iter().enumerate() {
            place.key("fingers").at(finger).vector(point)?;
        }
        tuple.push(Contact { part, fingers: entry.fingers.map(Point3::from) });
    }
    let missing = (0..parts.len()).find(|&part| !tuple.iter().any(|contact| usize::from(contact.part.0) == part));
    match missing {
        Some(part) => place.clone().refuse(format!("no contact on part `{}`, expected one on each part", parts[part].name)),
        None => Ok(tuple),
    }
}
