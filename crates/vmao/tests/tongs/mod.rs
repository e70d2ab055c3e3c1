//! Tongs as an object file: two tapered bars of convex hulls that cross at a pin, unlike anything in the catalogue.

use serde_json::Value;
use std::{fs, path::Path};

/// The file.
pub(crate) const TONGS: &str = include_str!("object.json");

/// The same, to be changed.
pub(crate) fn tongs() -> Value {
    serde_json::from_str(TONGS).unwrap()
}

/// Writes the tongs into `folder` as `object.json`.
pub(crate) fn write(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join("object.json"), TONGS).unwrap();
}
