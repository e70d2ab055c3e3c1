//! How large the object is made, where it stands, and what its parts weigh.

use crate::{
    category::{Category, DENSITIES, UNKNOWN_DENSITY, UNKNOWN_LENGTH},
    repairs::{Quirk, Repairs},
    solid::SolidDraft,
    source::{Source, SourceKind},
    structure::Structure,
};
use nalgebra::Vector3;

/// Every part shall be at most this wide in some direction: what the Panda's pads take, less 4 mm (m).
pub(super) const GRIPPABLE: f64 = 0.070;
/// No default makes an object smaller than this (m).
const SMALLEST: f64 = 0.06;
/// Files that speak of metres are believed when the longest edge is between these (m).
const BELIEVED: [f64; 2] = [0.03, 1.0];
/// No part weighs less (kg), nor less than this share of the whole.
const LIGHTEST: f64 = 1e-3;
const LIGHTEST_SHARE: f64 = 0.01;
/// No object weighs more by default (kg).
const HEAVIEST: f64 = 10.0;

/// From the file's lengths to metres, and onto the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    /// The factor.
    pub(super) factor: f64,
    /// Added after it (m).
    pub(super) moved: Vector3<f64>,
    /// The longest edge then (m).
    pub(super) longest: f64,
}

/// Lowest and highest corner of all solids.
fn corners(parts: &[Vec<SolidDraft>]) -> (Vector3<f64>, Vector3<f64>) {
    let axis = |axis: usize| extent(parts.iter().flatten(), &Vector3::ith(axis, 1.0));
    let [x, y, z] = [axis(0), axis(1), axis(2)];
    (Vector3::new(x[0], y[0], z[0]), Vector3::new(x[1], y[1], z[1]))
}

fn extent<'a>(solids: impl Iterator<Item = &'a SolidDraft>, direction: &Vector3<f64>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    solids.map(|solid| solid.extent(direction)).fold(none, |[low, high], [a, b]| [low.min(a), high.max(b)])
}

/// How long the solids are along a direction (m).
pub(super) fn extent_along(solids: &[SolidDraft], direction: &Vector3<f64>) -> f64 {
    let [low, high] = extent(solids.iter(), direction);
    high - low
}

/// The least width of the solids, over the axes and over the normals of their own faces.
fn least_width(solids: &[SolidDraft]) -> f64 {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let normals = solids.iter().flat_map(|solid| solid.hull.planes().map(|(normal, _)| normal.into_inner()));
    axes.into_iter().chain(normals).map(|axis| extent_along(solids, &axis)).fold(f64::INFINITY, f64::min)
}

/// The least width of all solids together, then of each (m).
pub(super) fn widths(solids: &[SolidDraft]) -> Vec<f64> {
    let each = solids.iter().map(|solid| least_width(std::slice::from_ref(solid)));
    std::iter::once(least_width(solids)).chain(each).collect()
}

/// How to bring the object to its size, its middle over the origin, its lowest point on z = 0.
pub(super) fn placement(
    parts: &[Vec<SolidDraft>],
    source: &Source,
    asked: Option<f64>,
    category: Option<Category>,
    repairs: &mut Repairs,
) -> Placement {
    let (low, high) = corners(parts);
    let longest = (high - low).max();
    let meters = source.kind != SourceKind::PartNet && (BELIEVED[0]..=BELIEVED[1]).contains(&longest);
    let target = match asked {
        Some(size) => size,
        None if meters => longest,
        None => {
            let usual = category.map_or(UNKNOWN_LENGTH, |category| category.length);
            let widest = parts.iter().map(|solids| least_width(solids)).fold(0.0, f64::max);
            let graspable = GRIPPABLE / widest * longest;
            usual.min(graspable.max(SMALLEST))
        }
    };
    let factor = target / longest;
    if (factor - 1.0).abs() > 1e-9 {
        let why = match (asked, category) {
            (Some(_), _) => "as asked".to_owned(),
            (None, Some(category)) if target < category.length => {
                format!("as a {} is, made smaller until each part is {:.0} mm wide somewhere", category.name, GRIPPABLE * 1e3)
            }
            (None, Some(category)) => format!("as long as a {} is", category.name),
            (None, None) if target < UNKNOWN_LENGTH => format!("so that each part is {:.0} mm wide somewhere", GRIPPABLE * 1e3),
            (None, None) => "as long as objects of the catalogue are".to_owned(),
        };
        let what = format!("longest edge {longest:.4} made {target:.4} m, {why}: meshes, origins and slides times {factor:.6}");
        repairs.add(Quirk::Size, "", what);
    }
    let middle = (low + high) / 2.0 * factor;
    let moved = Vector3::new(-middle.x, -middle.y, -low.z * factor);
    if moved.norm() > 1e-9 {
        let what =
            format!("moved by [{:.4}, {:.4}, {:.4}] m: stands on z = 0, its middle over the origin", moved.x, moved.y, moved.z);
        repairs.add(Quirk::Place, "", what);
    }
    Placement { factor, moved, longest: target }
}

/// What each part weighs (kg). Fails if the mass asked for is less than parts must weigh.
pub(super) fn masses(
    structure: &Structure,
    parts: &[Vec<SolidDraft>],
    placement: &Placement,
    (kind, asked, category): (SourceKind, Option<f64>, Option<Category>),
    repairs: &mut Repairs,
) -> Result<Vec<f64>, String> {
    let volumes: Vec<f64> = parts.iter().map(|solids| solids.iter().map(SolidDraft::volume).sum()).collect();
    let whole: f64 = volumes.iter().sum();
    let grown = placement.factor.powi(3);
    let given: Option<Vec<f64>> = structure.parts.iter().map(|part| part.mass.map(|mass| mass * grown)).collect();
    let sane = |masses: &Vec<f64>| {
        let dense = |(mass, volume): (&f64, &f64)| (DENSITIES[0]..=DENSITIES[1]).contains(&(mass / volume));
        // What has no size in metres has no mass in kilograms.
        kind != SourceKind::PartNet && masses.iter().zip(&volumes).all(dense) && masses.iter().sum::<f64>() <= HEAVIEST
    };
    let total = match (asked, category) {
        (Some(mass), _) => mass,
        (None, Some(category)) => category.mass * (placement.longest / category.length).powi(3),
        (None, None) => (UNKNOWN_DENSITY * whole).min(HEAVIEST),
    };
    let shares: Vec<f64> = match given.filter(sane) {
        Some(masses) if asked.is_none() => return Ok(masses.into_iter().map(|mass| mass.max(LIGHTEST)).collect()),
        Some(masses) => masses.iter().map(|mass| mass / masses.iter().sum::<f64>()).collect(),
        None => volumes.iter().map(|volume| volume / whole).collect(),
    };
    if asked.is_some_and(|mass| mass < LIGHTEST * parts.len() as f64) {
        let least = LIGHTEST * parts.len() as f64;
        return Err(format!("a mass of {total} kg was asked for, expected at least {least} kg for {} parts", parts.len()));
    }
    let lightest = LIGHTEST.max(LIGHTEST_SHARE * total);
    let masses: Vec<f64> = shares.iter().map(|share| (share * total).max(lightest)).collect();
    let found = if structure.parts.iter().any(|part| part.mass.is_some()) { "masses missing or absurd" } else { "no masses" };
    let basis = match (asked, category) {
        (Some(_), _) => "as asked".to_owned(),
        (None, Some(category)) => format!("of a {} this size", category.name),
        (None, None) => format!("at {UNKNOWN_DENSITY} kg/m³"),
    };
    let sum: f64 = masses.iter().sum();
    repairs.add(Quirk::Mass, "", format!("{found}: {sum:.4} kg in all, {basis}, spread by the volume of the hulls"));
    Ok(masses)
}
