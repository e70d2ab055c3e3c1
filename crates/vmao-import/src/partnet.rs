//! What a PartNet-Mobility folder says beside its URDF: category, link names, raw extent, junk.

use serde::Deserialize;
use std::collections::BTreeMap;
use vmao_core::wording::Place;

/// URDF files of such a folder, the most worked-over first.
pub const URDFS: [&str; 4] = ["mobility_cvx.urdf", "mobility_vhacd.urdf", "mobility_fixed.urdf", "mobility.urdf"];
/// The largest side file that is read (bytes).
pub const MAX_BYTES: u64 = 8 << 20;
/// The most entries of a list.
const MAX_ENTRIES: usize = 4096;

/// An entry of `mobility_v2.json`.
#[derive(Debug, Clone, Deserialize)]
pub struct MobilityLink {
    /// Its number: link `link_<id>` of the URDF.
    pub id: i64,
    /// The joint's kind; `junk` is to be left out.
    #[serde(default)]
    pub joint: String,
    /// What it is.
    #[serde(default)]
    pub name: String,
}

/// `meta.json`.
#[derive(Debug, Clone, Deserialize)]
pub struct Meta {
    /// The category, as `Bottle`.
    pub model_cat: String,
}

/// `bounding_box.json`: the raw meshes' extent.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct BoundingBox {
    /// Lowest corner.
    pub min: [f64; 3],
    /// Highest corner.
    pub max: [f64; 3],
}

/// A JSON text as `T`; fails with a place.
fn json<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| {
        let place = Place { line: error.line(), column: error.column().max(1) };
        let message = error.to_string();
        format!("{place}: {}", message.rsplit_once(" at line ").map_or(message.as_str(), |(message, _)| message))
    })
}

/// The entries of `mobility_v2.json`.
pub fn mobility(text: &str) -> Result<Vec<MobilityLink>, String> {
    let links: Vec<MobilityLink> = json(text)?;
    if links.len() > MAX_ENTRIES { Err(format!("{} entries, expected at most {MAX_ENTRIES}", links.len())) } else { Ok(links) }
}

/// The category in `meta.json`.
pub fn meta(text: &str) -> Result<Meta, String> {
    json(text)
}

/// The extent in `bounding_box.json`.
pub fn bounding_box(text: &str) -> Result<BoundingBox, String> {
    let found: BoundingBox = json(text)?;
    let sane = found.min.iter().zip(&found.max).all(|(low, high)| low <= high && low.abs() <= 1e6 && high.abs() <= 1e6);
    if sane { Ok(found) } else { Err(format!("min {:?} and max {:?} are no box", found.min, found.max)) }
}

/// Link names of `semantics.txt`: `link_0 hinge lid` names `link_0` a `lid`.
pub fn semantics(text: &str) -> Result<BTreeMap<String, String>, String> {
    let mut names = BTreeMap::new();
    for (index, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().take(3).collect();
        match words[..] {
            [] => {}
            [link, _, name] => {
                if names.len() == MAX_ENTRIES {
                    return Err(format!("line {}: more than {MAX_ENTRIES} links", index + 1));
                }
                names.insert(link.to_owned(), name.to_owned());
            }
            _ => return Err(format!("line {}: expected a link, a joint's kind and a name", index + 1)),
        }
    }
    Ok(names)
}
