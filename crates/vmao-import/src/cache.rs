//! Decompositions kept on disk, by the content of what was decomposed and by all that decides the result.
//!
//! A stored file is checked like any other input; one that is damaged is made again.

use crate::{
    decompose::{CONCAVITY, RESOLUTION, Soup},
    hull::{Hull, MAX_HULL_VERTICES},
};
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
};

/// Changes with the code that decomposes.
const MAKER: &str = "vmao-import 1, parry3d-f64 0.31.1";
/// The largest stored file that is read (bytes).
const MAX_BYTES: u64 = 4 << 20;

/// A folder of stored hulls, or none.
#[derive(Debug, Clone, Default)]
pub struct Cache {
    folder: Option<PathBuf>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredHull {
    vertices: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl Cache {
    /// Keeps hulls in `folder`, which is made when there is something to keep.
    pub fn at(folder: &Path) -> Self {
        Self { folder: Some(folder.to_owned()) }
    }

    /// The hulls of this soup, stored or made by `make`; `most` is how many were asked for.
    pub fn hulls(&self, soup: &Soup, most: usize, make: &dyn Fn(&Soup) -> Vec<Hull>) -> Vec<Hull> {
        let Some(folder) = &self.folder else { return make(soup) };
        let path = folder.join(format!("{}.json", key(soup, most)));
        if let Some(hulls) = stored(&path, most) {
            return hulls;
        }
        let hulls = make(soup);
        // Whoever cannot keep it makes it again the next time.
        drop(keep(folder, &path, &hulls));
        hulls
    }
}

fn key(soup: &Soup, most: usize) -> String {
    let mut hash = Sha256::new();
    hash.update(format!("{MAKER} {RESOLUTION} {CONCAVITY} {MAX_HULL_VERTICES} {most} {}\n", soup.vertices.len()));
    for vertex in &soup.vertices {
        vertex.iter().for_each(|x| hash.update(x.to_bits().to_le_bytes()));
    }
    for triangle in &soup.triangles {
        triangle.iter().for_each(|corner| hash.update(corner.to_le_bytes()));
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn stored(path: &Path, most: usize) -> Option<Vec<Hull>> {
    let mut text = String::new();
    if !path.metadata().ok()?.is_file() {
        return None;
    }
    fs::File::open(path).ok()?.take(MAX_BYTES).read_to_string(&mut text).ok()?;
    read(&text).filter(|hulls| hulls.len() <= most)
}

/// The hulls of a stored file; none if it is damaged.
pub fn read(text: &str) -> Option<Vec<Hull>> {
    let found: Vec<StoredHull> = serde_json::from_str(text).ok()?;
    let hull = |stored: StoredHull| {
        let vertices: Vec<Point3<f64>> = stored.vertices.into_iter().map(Point3::from).collect();
        let hull = Hull { vertices, faces: stored.faces };
        let bounded = hull.vertices.iter().all(|vertex| vertex.coords.amax() <= 2.0) && hull.vertices.len() <= MAX_HULL_VERTICES;
        (bounded && hull.is_sound()).then_some(hull)
    };
    found.into_iter().map(hull).collect::<Option<Vec<Hull>>>().filter(|hulls| !hulls.is_empty())
}

fn keep(folder: &Path, path: &Path, hulls: &[Hull]) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let plain = |hull: &Hull| StoredHull {
        vertices: hull.vertices.iter().map(|vertex| vertex.coords.into()).collect(),
        faces: hull.faces.clone(),
    };
    let text = serde_json::to_string(&hulls.iter().map(plain).collect::<Vec<_>>())?;
    // Two imports at once write the same bytes; each under a name of its own until they are whole.
    let partial = path.with_extension(format!("{}.partial", std::process::id()));
    let written = fs::write(&partial, text).and_then(|()| fs::rename(&partial, path));
    if written.is_err() {
        drop(fs::remove_file(&partial));
    }
    written
}
