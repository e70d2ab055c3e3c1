//! Demonstrations from a file that anyone can write: named points of each part, and which two of them hold it.

use crate::{
    json::{Document, DocumentError, JsonPath},
    wording::{Place, quoted, unknown},
};
use nalgebra::{Point3, Unit, center};
use serde::Deserialize;
use std::collections::BTreeMap;
use vmao_core::{
    catalogue::CatalogueItem,
    contact::{Contact, ContactTuple, PartId},
    distance::Convex,
    geometry::Pose,
    object::Part,
    passage::stretch_through,
    shape::Shape,
};

/// Points may lie this far off the surface of their part (m): someone measured them.
pub const TOLERANCE: f64 = 0.002;
/// The most demonstrations of a file, and the most points and parts.
const MOST: usize = 1024;

/// A file of demonstrations; `docs/demonstrations.md` has an example.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemonstrationsFile {
    schema: u32,
    /// By part, then by name: part frame (m).
    points: BTreeMap<String, BTreeMap<String, [f64; 3]>>,
    demonstrations: Vec<Demonstration>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Demonstration {
    grasps: Vec<Grasp>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Grasp {
    part: String,
    /// Names of two points.
    fingers: [String; 2],
}

impl DemonstrationsFile {
    /// Reads JSON if the text begins with a brace, TOML otherwise.
    pub fn parse(document: &Document) -> Result<Self, DocumentError> {
        let file: Self = if document.text().trim_start().starts_with('{') {
            document.parse()?
        } else {
            toml::from_str(document.text()).map_err(|error| {
                let place = error.span().map(|span| Place::of(document.text().as_bytes(), span.start));
                DocumentError { place, ..document.refuse(&JsonPath::default(), error.message().trim().to_owned()) }
            })?
        };
        let refuse = |key: &str, message: String| Err(document.refuse(&JsonPath::key(key), message));
        if file.schema != 1 {
            return refuse("schema", format!("schema {}, expected 1", file.schema));
        }
        let points: usize = file.points.values().map(BTreeMap::len).sum();
        if points > MOST || file.points.len() > MOST {
            return refuse("points", format!("{points} points of {} parts, expected at most {MOST}", file.points.len()));
        }
        if !(1..=MOST).contains(&file.demonstrations.len()) {
            return refuse("demonstrations", format!("{} demonstrations, expected 1 to {MOST}", file.demonstrations.len()));
        }
        let wild = |point: &[f64; 3]| !point.iter().all(|x| x.abs() <= 100.0);
        for (part, points) in &file.points {
            if let Some((name, point)) = points.iter().find(|(_, point)| wild(point)) {
                let message = format!("point {} of part {} is {point:?}, expected metres", quoted(name), quoted(part));
                return refuse("points", message);
            }
        }
        Ok(file)
    }

    /// The contact tuples for `item`, their points on its surface; or what does not fit and why.
    pub fn tuples(&self, item: &CatalogueItem) -> Result<Vec<ContactTuple>, String> {
        let tuple = |(index, demonstration): (usize, &Demonstration)| {
            self.tuple(item, demonstration).map_err(|error| format!("demonstrations[{index}]: {error}"))
        };
        self.demonstrations.iter().enumerate().map(tuple).collect()
    }

    fn tuple(&self, item: &CatalogueItem, demonstration: &Demonstration) -> Result<ContactTuple, String> {
        let parts = &item.object.parts;
        let names = || parts.iter().map(|part| &*part.name);
        let mut tuple = ContactTuple::new();
        for grasp in &demonstration.grasps {
            let part = names()
                .position(|name| name == grasp.part)
                .ok_or_else(|| unknown(format!("object `{}`", item.object.name), "part", &grasp.part, names()))?;
            if tuple.iter().any(|contact| usize::from(contact.part.0) == part) {
                return Err(format!("part {} again, expected each part once", quoted(&grasp.part)));
            }
            let [a, b] = &grasp.fingers;
            let fingers = [self.point(&parts[part], a)?, self.point(&parts[part], b)?];
            if (fingers[0] - fingers[1]).norm() < 1e-3 {
                return Err(format!("points {} and {} coincide, expected one on each side", quoted(a), quoted(b)));
            }
            tuple.push(Contact { part: PartId(part as u16), fingers });
        }
        let held = |part: usize| tuple.iter().any(|contact| usize::from(contact.part.0) == part);
        match (0..parts.len()).find(|&part| !held(part)) {
            Some(part) => Err(format!("no grasp of part {}, expected one of each part", quoted(&parts[part].name))),
            None => Ok(tuple),
        }
    }

    /// The named point of a part, refused if it is not on the part's surface.
    fn point(&self, part: &Part, name: &str) -> Result<Point3<f64>, String> {
        let points = self.points.get(&part.name);
        let known = || points.into_iter().flatten().map(|(name, _)| name.as_str());
        let point = points
            .and_then(|points| points.get(name))
            .ok_or_else(|| unknown(format!("part {}", quoted(&part.name)), "point", name, known()))?;
        let height = height(part, point);
        if height.abs() > TOLERANCE {
            let (millimetres, side) = (height.abs() * 1e3, if height > 0.0 { "off" } else { "below" });
            let message = format!("point {} is {millimetres:.1} mm {side} the surface of part", quoted(name));
            return Err(format!("{message} {}, expected at most {:.0} mm", quoted(&part.name), TOLERANCE * 1e3));
        }
        Ok(Point3::from(*point))
    }
}

/// How far a point (part frame, m) lies off the surface of a part, negative inside.
fn height(part: &Part, [x, y, z]: &[f64; 3]) -> f64 {
    let dot = Convex::new(&Shape::Sphere { radius: 0.0 }, &Pose::translation(*x, *y, *z));
    let solids = part.solids.iter().map(|solid| Convex::new(&solid.shape, &solid.carrier_from_solid));
    solids.map(|solid| solid.signed_distance(&dot)).fold(f64::INFINITY, f64::min)
}

/// The same ways to hold another size of the object: fingers moved along their line to where its surface is.
///
/// Ways whose line misses the part are left out.
pub fn fitted(tuples: &[ContactTuple], item: &CatalogueItem) -> Vec<ContactTuple> {
    let contact = |contact: &Contact| {
        let solids = &item.object.parts.get(usize::from(contact.part.0))?.solids;
        let direction = Unit::try_new(contact.fingers[1] - contact.fingers[0], 1e-9)?;
        let middle = center(&contact.fingers[0], &contact.fingers[1]);
        let stretch = stretch_through(solids, &middle, &direction)?;
        Some(Contact { part: contact.part, fingers: stretch.along.map(|along| middle + direction.as_ref() * along) })
    };
    tuples.iter().filter_map(|tuple| tuple.iter().map(contact).collect()).collect()
}
