//! The whole way from a path to an object: read, place, decompose, separate, size, weigh, colour.

mod naming;
mod sizing;

use crate::{
    cache::Cache,
    category::{self, BALL, Category, Resistance, SLIDE},
    decompose::decompose,
    description::Motion,
    error::Error,
    mesh::Mesh,
    overlap,
    repairs::{Quirk, Repair, Repairs},
    solid::SolidDraft,
    source::{Source, SourceKind},
    structure::{HelperMotion, JointDraft, PartDraft, Structure, structure},
    surface::{Loader, triangle_color},
    visual::{Picture, pictures},
};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::path::{Path, PathBuf};
use vmao_core::{
    contact::PartId,
    geometry::Pose,
    object::{ArticulatedObject, Joint, JointKind, Part},
    shape::Solid,
    wording::quoted,
};

/// The most hulls of a part unless asked otherwise; ours: 8 to 32 are usual.
pub const DEFAULT_HULLS: usize = 16;
/// The most hulls of a part that may be asked for.
pub const MAX_HULLS: usize = 64;
/// The most parts of an object; more are no object that hands hold.
pub(crate) const MAX_PARTS: usize = 32;

/// Which axis of the file points up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpAxis {
    /// z, unless a PartNet-Mobility folder left its raw meshes' y up.
    #[default]
    Auto,
    /// y.
    Y,
    /// z.
    Z,
}

/// What an import may be told.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// The object's name; else the file's.
    pub name: Option<String>,
    /// The longest edge (m); else by category, and so that every part fits between the pads.
    pub size: Option<f64>,
    /// The mass of all parts together (kg); else the file's, or by category.
    pub mass: Option<f64>,
    /// Which joint of a helper link stays.
    pub helper: HelperMotion,
    /// The most hulls of a part; else [`DEFAULT_HULLS`].
    pub hulls: Option<usize>,
    /// Which axis points up.
    pub up: UpAxis,
    /// The top body of a MuJoCo model that is the object.
    pub body: Option<String>,
    /// The folder that files may be read from; else the description's own.
    pub root: Option<PathBuf>,
    /// Where decompositions are kept; nowhere if none.
    pub cache: Option<PathBuf>,
}

/// An object, its pictures, and how it came about.
#[derive(Debug, Clone)]
pub struct Import {
    /// The object.
    pub object: ArticulatedObject,
    /// What it looks like.
    pub pictures: Vec<Picture>,
    /// For each part: its least width, then the least width of each of its solids (m).
    pub widths: Vec<Vec<f64>>,
    /// What was put right.
    pub repairs: Vec<Repair>,
    /// What it was made from, for people.
    pub source: String,
}

/// What a part is made of while it is worked on.
struct PartMaterials {
    solids: Vec<SolidDraft>,
    surfaces: Vec<Mesh>,
}

/// Reads what lies at `path` and makes an object of it.
pub fn import(path: &Path, options: &Options) -> Result<Import, Error> {
    let mut source = Source::read(path, options.root.as_deref(), options.body.as_deref())?;
    let mut repairs = std::mem::take(&mut source.description.repairs);
    let shown = source.shown(path);
    let refuse = |message: String| Error::refused(&shown, message);
    let mut structure = structure(&source.description, &source.junk, options.helper, &mut repairs).map_err(refuse)?;
    if structure.parts.len() > MAX_PARTS {
        return Err(refuse(format!("{} parts that move, expected at most {MAX_PARTS}", structure.parts.len())));
    }
    turn_up(&mut structure, &source, options.up, &mut repairs);
    let mut loader = Loader::new(&source.files);
    let cache = options.cache.as_deref().map(Cache::at).unwrap_or_default();
    let hulls = options.hulls.unwrap_or(DEFAULT_HULLS).clamp(1, MAX_HULLS);
    let mut materials = Vec::new();
    for part in &structure.parts {
        let made = part_materials(part, &mut loader, &cache, hulls, &mut repairs)?;
        if made.solids.is_empty() {
            return Err(refuse(format!("part {} has no shape with an extent", quoted(&part.name))));
        }
        materials.push(made);
    }
    separate(&structure, &mut materials, &mut repairs);
    let category = source.category.as_deref().and_then(category::named);
    let placement = sizing::placement(&materials_solids(&materials), &source, options.size, category, &mut repairs);
    for part in &mut materials {
        part.solids = part.solids.iter().map(|solid| solid.scaled(placement.factor, &placement.moved)).collect();
        let place = |point: &Point3<f64>| Point3::from(point.coords * placement.factor + placement.moved);
        part.surfaces = std::mem::take(&mut part.surfaces).into_iter().map(|mesh| mesh.mapped(place)).collect();
        color(&mut part.solids, &part.surfaces, &loader);
    }
    let solids = materials_solids(&materials);
    let masses =
        sizing::masses(&structure, &solids, &placement, (source.kind, options.mass, category), &mut repairs).map_err(refuse)?;
    let names = naming::names(&structure, &source, &mut repairs);
    let mut parts = Vec::new();
    for ((part, mass), name) in materials.iter().zip(masses).zip(&names.parts) {
        let solids: Result<Vec<Solid>, String> = part.solids.iter().map(SolidDraft::to_core).collect();
        parts.push(Part { name: name.clone(), solids: solids.map_err(refuse)?, mass });
    }
    let joints = structure.joints.iter().zip(names.joints);
    let joints = joints.map(|(joint, name)| made_joint(joint, name, &placement, &solids, category, &mut repairs)).collect();
    let widths = solids.iter().map(|solids| sizing::widths(solids)).collect();
    let name = naming::object(options.name.as_deref().unwrap_or(&source.description.name));
    let surfaces: Vec<Vec<Mesh>> = materials.into_iter().map(|part| part.surfaces).collect();
    let pictures = pictures(&surfaces, &names.parts, &loader).map_err(refuse)?;
    let category = source.category.as_deref().map_or_else(String::new, |name| format!(", category {}", quoted(name)));
    let note = format!("{} {}{category}, {} long", source.kind.name(), quoted(&source.file), millimetres(placement.longest));
    Ok(Import { object: ArticulatedObject { name, parts, joints }, pictures, widths, repairs: repairs.into_list(), source: note })
}

fn millimetres(metres: f64) -> String {
    format!("{:.0} mm", metres * 1e3)
}

fn materials_solids(materials: &[PartMaterials]) -> Vec<Vec<SolidDraft>> {
    materials.iter().map(|part| part.solids.clone()).collect()
}

/// PartNet's own turn from its meshes' y-up, -z-front frame to z up, x front: `rpy="1.5708 0 -1.5708"`.
fn raw_to_upright() -> UnitQuaternion<f64> {
    crate::xml::roll_pitch_yaw([std::f64::consts::FRAC_PI_2, 0.0, -std::f64::consts::FRAC_PI_2])
}

/// Turns the object so that z is up.
fn turn_up(structure: &mut Structure, source: &Source, up: UpAxis, repairs: &mut Repairs) {
    let raw = || {
        // Shapes that are not turned at all stand as the raw meshes do, and those have y up.
        let mut shapes = structure.parts.iter().flat_map(|part| part.visuals.iter().chain(&part.collisions));
        source.kind == SourceKind::PartNet && shapes.all(|shape| shape.object_from_geometry.rotation.angle() < 1e-6)
    };
    let turned = match up {
        UpAxis::Z => false,
        UpAxis::Y => true,
        UpAxis::Auto => raw(),
    };
    if !turned {
        if source.kind == SourceKind::PartNet {
            repairs.add(Quirk::UpAxis, "", "meshes with y up, turned to z up once, by the base's own joint");
        }
        return;
    }
    let turn = Pose::from_parts(Vector3::zeros().into(), raw_to_upright());
    for part in &mut structure.parts {
        for shape in part.visuals.iter_mut().chain(&mut part.collisions) {
            shape.object_from_geometry = turn * shape.object_from_geometry;
        }
    }
    for joint in &mut structure.joints {
        joint.anchor = turn * joint.anchor;
        joint.axis = turn.rotation * joint.axis;
    }
    repairs.add(Quirk::UpAxis, "", "y was up and no joint turned it: turned to z up");
}

/// Loads a part's surfaces and makes its solids.
fn part_materials(
    part: &PartDraft,
    loader: &mut Loader<'_>,
    cache: &Cache,
    most: usize,
    repairs: &mut Repairs,
) -> Result<PartMaterials, Error> {
    let mut solids = Vec::new();
    let mut meshes = Vec::new();
    for shape in &part.collisions {
        match SolidDraft::of_form(&shape.form, &shape.object_from_geometry) {
            Some(solid) => solids.push(solid),
            None => meshes.push(loader.load(shape, repairs)?),
        }
    }
    if !meshes.is_empty() {
        let stored = |soup: &_, make: &dyn Fn(&_) -> Vec<_>| cache.hulls(soup, most, make);
        let meshes: Vec<&Mesh> = meshes.iter().collect();
        match decompose(&meshes, most, stored) {
            Some(made) => {
                if made.thickened > 0 {
                    let what = format!("{} flat pieces given a thickness of a hundredth of their length", made.thickened);
                    repairs.add(Quirk::FlatMesh, &part.name, what);
                }
                if !made.convex {
                    let what = format!("{} meshes decomposed into {} convex hulls", meshes.len(), made.hulls.len());
                    repairs.add(Quirk::NotConvex, &part.name, what);
                }
                solids.extend(made.hulls.into_iter().map(SolidDraft::of_hull));
            }
            None => repairs.add(Quirk::BrokenMesh, &part.name, "collision meshes without an extent left out"),
        }
    }
    // Without looks of its own, a part looks like what it collides with.
    let seen = if part.visuals.is_empty() { &part.collisions } else { &part.visuals };
    let surfaces = seen.iter().map(|shape| loader.load(shape, repairs)).collect::<Result<_, _>>()?;
    Ok(PartMaterials { solids, surfaces })
}

/// Parts that are not joined must not overlap.
fn separate(structure: &Structure, materials: &mut [PartMaterials], repairs: &mut Repairs) {
    let joined = |a: usize, b: usize| {
        structure.joints.iter().any(|joint| (joint.parent, joint.child) == (a, b) || (joint.parent, joint.child) == (b, a))
    };
    let names = structure.parts.iter().map(|part| part.name.clone());
    let solids = materials.iter_mut().map(|part| std::mem::take(&mut part.solids));
    let mut parts: Vec<(String, Vec<SolidDraft>)> = names.zip(solids).collect();
    overlap::separate(&mut parts, joined, repairs);
    for (part, (_, solids)) in materials.iter_mut().zip(parts) {
        part.solids = solids;
    }
}

/// Gives each solid the mean colour of the surface that is nearest to it.
fn color(solids: &mut [SolidDraft], surfaces: &[Mesh], loader: &Loader<'_>) {
    let mut sums = vec![([0.0_f64; 3], 0.0_f64); solids.len()];
    let mut all = ([0.0_f64; 3], 0.0_f64);
    let planes: Vec<Vec<_>> = solids.iter().map(|solid| solid.hull.planes().collect()).collect();
    for mesh in surfaces {
        // Of a fine mesh a part is enough: colours are means.
        let step = mesh.faces.len().div_ceil(20_000).max(1);
        for face in mesh.faces.iter().step_by(step) {
            let (middle, area, rgb) = triangle_color(loader, mesh, face);
            let beyond = |index: usize| {
                let over = planes[index].iter().map(|(n, d): &(nalgebra::Unit<Vector3<f64>>, f64)| n.dot(&middle.coords) - d);
                over.fold(f64::NEG_INFINITY, f64::max)
            };
            let nearest = (0..solids.len()).min_by(|&a, &b| beyond(a).total_cmp(&beyond(b)));
            for (sum, weight) in nearest.map(|index| &mut sums[index]).into_iter().chain([&mut all]) {
                *weight += area;
                sum.iter_mut().zip(rgb).for_each(|(sum, value)| *sum += area * f64::from(value));
            }
        }
    }
    for (solid, (sum, weight)) in solids.iter_mut().zip(sums) {
        let (sum, weight) = if weight > 0.0 { (sum, weight) } else { all };
        if weight > 0.0 {
            solid.color = sum.map(|value| (value / weight).clamp(0.0, 1.0) as f32);
        }
    }
}

/// The joint as core has it.
fn made_joint(
    joint: &JointDraft,
    name: String,
    placement: &sizing::Placement,
    solids: &[Vec<SolidDraft>],
    category: Option<Category>,
    repairs: &mut Repairs,
) -> Joint {
    let (kind, usual) = match joint.motion {
        Motion::Turn => (JointKind::Revolute, category.map_or(category::PIVOT, |category| category.turning)),
        Motion::Slide => (JointKind::Prismatic, SLIDE),
        Motion::Ball => (JointKind::Ball, BALL),
        // Reduced away before.
        Motion::Fixed | Motion::Free => (JointKind::Fixed, Resistance { damping: 0.0, friction: 0.0 }),
    };
    let mut sane = |value: Option<f64>, usual: f64, what: &str| match value {
        Some(value) if (0.0..=100.0).contains(&value) && value > 0.0 => value,
        found => {
            let found = found.map_or_else(|| "none".to_owned(), |value| value.to_string());
            repairs.add(Quirk::Resistance, &joint.name, format!("{what} {found}: {usual}"));
            usual
        }
    };
    let damping = sane(joint.damping, usual.damping, "damping");
    let friction = sane(joint.friction, usual.friction, "friction");
    let limits = match (kind, joint.limits) {
        (JointKind::Prismatic, Some(range)) => Some(range.map(|bound| bound * placement.factor)),
        (JointKind::Prismatic, None) => {
            let reach = sizing::extent_along(&solids[joint.child], &joint.axis) / 4.0;
            Some([-reach, reach])
        }
        (_, limits) => limits,
    };
    Joint {
        name,
        kind,
        parent: PartId(joint.parent as u16),
        child: PartId(joint.child as u16),
        anchor: Point3::from(joint.anchor.coords * placement.factor + placement.moved),
        axis: joint.axis,
        limits,
        damping,
        friction,
    }
}
