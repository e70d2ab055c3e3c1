//! Finds the best model of a robot below a folder and copies its meshes.

use super::{
    LIST, MAX_MESHES, MAX_TOTAL_BYTES, Mesh, MeshList, Package, check_mesh_file, link_names,
    matching::{LinkMesh, Match, Matcher},
    mjcf::{self, Body},
};
use crate::{
    failure::{Failure, OrBadInput},
    json::JsonPose,
    output::write_whole,
    provenance::sha256_hex,
    wording::{listed, quoted},
};
use anyhow::{Context, anyhow};
use serde::Serialize;
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
    fs,
    io::{Read, Write},
    path::{Path, PathBuf},
};
use vmao_core::robots::RobotModel;

/// The deepest folder and the most entries that are looked at.
const MAX_FOLDERS_DEEP: usize = 16;
const MAX_ENTRIES: usize = 200_000;
/// The most XML files that are read.
const MAX_MODELS: usize = 5_000;

/// What was imported.
#[derive(Debug, Serialize)]
pub struct Import {
    /// What is now in `meshes.json`.
    #[serde(flatten)]
    pub list: MeshList,
    /// The folder it lies in.
    pub stored_in: PathBuf,
    /// All mesh files together (bytes).
    pub bytes: u64,
    /// Links that have no mesh: they stay the solids that they are in physics.
    pub links_without: Vec<&'static str>,
    /// Bodies that could not be used, and why.
    pub skipped: Vec<String>,
}

/// A model that fits, in the order in which models are preferred.
struct Candidate {
    path: PathBuf,
    found: Match,
}

/// Copies the meshes of `robot` from the package folder `from` to the folder that `prepare` makes once all is checked.
///
/// `meshes.json` is written last.
pub fn import(robot: &RobotModel, from: &Path, prepare: impl FnOnce() -> Result<PathBuf, Failure>) -> Result<Import, Failure> {
    let root = from.canonicalize().with_context(|| from.display().to_string()).or_bad_input()?;
    let found = find(robot, &root)?;
    let files = check_files(&found, &root)?;
    let package = found.first().map_or_else(Package::default, |candidate| Package::of(&candidate.path, &root));
    let out = prepare()?;
    let (copies, bytes) = copy(&files, &out)?;
    for (index, text) in package.texts.iter().enumerate() {
        let path = out.join(format!("LICENCE-{}.txt", index + 1));
        write_whole(&path, |file| file.write_all(text.text.as_bytes())).with_context(|| path.display().to_string())?;
    }
    let describe = |(mesh, file): (&LinkMesh, &PathBuf)| Mesh {
        link: mesh.link.to_owned(),
        file: copies[file].clone(),
        pose: JsonPose::from(&mesh.link_from_mesh),
        scale: mesh.geom.scale,
        rgba: mesh.geom.rgba,
    };
    let meshes: Vec<Mesh> = found.iter().flat_map(|candidate| &candidate.found.meshes).zip(&files).map(describe).collect();
    let have: BTreeSet<&str> = meshes.iter().map(|mesh| mesh.link.as_str()).collect();
    let links_without = link_names(robot).into_iter().filter(|link| !have.contains(link)).collect();
    let models = found.iter().map(|candidate| below(&candidate.path, &root)).collect();
    let list = MeshList { robot: robot.name.to_owned(), package, models, meshes };
    let path = out.join(LIST);
    let text = serde_json::to_string_pretty(&list)?;
    write_whole(&path, |file| writeln!(file, "{text}")).with_context(|| path.display().to_string())?;
    let skipped = found.into_iter().flat_map(|candidate| candidate.found.skipped).collect();
    Ok(Import { list, stored_in: out, bytes, links_without, skipped })
}

fn below(path: &Path, root: &Path) -> String {
    path.strip_prefix(root).unwrap_or(path).display().to_string()
}

/// The best arm, and the best gripper if the arm's model has none.
fn find(robot: &RobotModel, root: &Path) -> Result<Vec<Candidate>, Failure> {
    let matcher = Matcher::new(robot);
    let (mut arms, mut grippers, mut refusals) = (Vec::new(), Vec::new(), Vec::new());
    for path in models(root)? {
        let bodies = match read_model(&path) {
            Ok(Some(bodies)) => bodies,
            Ok(None) => continue,
            Err(message) => {
                refusals.push(format!("{}: {message}", below(&path, root)));
                continue;
            }
        };
        let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (matched, candidates) = if matcher.is_arm(&bodies) {
            (matcher.arm(&bodies), &mut arms)
        } else if matcher.is_gripper(&file_name, &bodies) {
            (matcher.gripper(&bodies), &mut grippers)
        } else {
            continue;
        };
        match matched {
            Ok(found) if found.meshes.is_empty() => {
                refusals.push(format!("{}: no mesh that takes no part in collisions", below(&path, root)));
            }
            Ok(found) => candidates.push(Candidate { path, found }),
            Err(message) => refusals.push(format!("{}: {message}", below(&path, root))),
        }
    }
    let Some(arm) = best(arms) else {
        let refused = refusals.iter().take(5).map(|refusal| format!("\n  {refusal}")).collect::<String>();
        let message = format!("no model of `{}` with meshes below {}{refused}", robot.name, root.display());
        return Err(Failure::bad_input(message));
    };
    let hand = robot.gripper.hand.name;
    let gripper = if arm.found.meshes.iter().any(|mesh| mesh.link == hand) { None } else { best(grippers) };
    Ok(std::iter::once(arm).chain(gripper).collect())
}

/// The one with most links, then with least skipped, then with the shortest and first path.
fn best(candidates: Vec<Candidate>) -> Option<Candidate> {
    let rank = |candidate: &Candidate| {
        let length = candidate.path.components().count();
        (Reverse(candidate.found.links()), candidate.found.skipped.len(), length, candidate.path.clone())
    };
    candidates.into_iter().min_by_key(rank)
}

/// All XML files below `root`, sorted; links are not followed.
fn models(root: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut folders = vec![(root.to_owned(), 0)];
    let (mut found, mut entries) = (Vec::new(), 0);
    while let Some((folder, depth)) = folders.pop() {
        for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string()).or_bad_input()? {
            let entry = entry.with_context(|| folder.display().to_string())?;
            let (kind, path) = (entry.file_type()?, entry.path());
            entries += 1;
            if entries > MAX_ENTRIES || found.len() > MAX_MODELS {
                let limits = format!("more than {MAX_ENTRIES} files or {MAX_MODELS} models");
                return Err(Failure::bad_input(format!("{}: {limits}; name a smaller folder", root.display())));
            }
            if kind.is_dir() && depth < MAX_FOLDERS_DEEP {
                folders.push((path, depth + 1));
            } else if kind.is_file() && path.extension().is_some_and(|extension| extension == "xml") {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// The bodies of a model; none if the file is not a MuJoCo model at all.
fn read_model(path: &Path) -> Result<Option<Vec<Body>>, String> {
    let mut bytes = Vec::new();
    let file = fs::File::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    file.take(mjcf::MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|error| format!("cannot be read: {error}"))?;
    let text = String::from_utf8_lossy(&bytes);
    if !text.contains("<mujoco") {
        return Ok(None);
    }
    if bytes.len() as u64 > mjcf::MAX_BYTES {
        return Err(format!("longer than {} bytes, the most that is read", mjcf::MAX_BYTES));
    }
    mjcf::bodies(&text).map(Some)
}

/// The canonical path of every mesh's file, in order. None may lie outside the package, even behind a link.
fn check_files(found: &[Candidate], root: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    let mut sizes = BTreeMap::new();
    for candidate in found {
        let folder = candidate.path.parent().unwrap_or(root);
        for mesh in &candidate.found.meshes {
            let shown = quoted(&mesh.geom.file.to_string_lossy());
            let refuse = |message: &str| Failure::bad_input(format!("{}: mesh {shown} {message}", below(&candidate.path, root)));
            let path =
                folder.join(&mesh.geom.file).canonicalize().map_err(|error| refuse(&format!("cannot be found: {error}")))?;
            if !path.starts_with(root) {
                return Err(refuse("lies outside the package"));
            }
            sizes.insert(path.clone(), check_mesh_file(&path).map_err(|message| refuse(&message))?);
            files.push(path);
        }
    }
    let total: u64 = sizes.values().sum();
    if files.len() > MAX_MESHES || total > MAX_TOTAL_BYTES {
        let models = listed(found.iter().filter_map(|candidate| candidate.path.to_str()));
        let limit = format!("expected at most {MAX_MESHES} and {MAX_TOTAL_BYTES}");
        return Err(Failure::bad_input(format!("{models}: {} meshes of {total} bytes, {limit}", files.len())));
    }
    Ok(files)
}

/// Copies each file once under a name that its content decides, so that an older list beside it stays true.
fn copy(files: &[PathBuf], out: &Path) -> Result<(BTreeMap<PathBuf, String>, u64), Failure> {
    let mut copies = BTreeMap::new();
    let mut total = 0;
    for source in files {
        if copies.contains_key(source) {
            continue;
        }
        let bytes = fs::read(source).with_context(|| source.display().to_string())?;
        total += bytes.len() as u64;
        let stem: String =
            source.file_stem().unwrap_or_default().to_string_lossy().chars().filter(|c| plain(*c)).take(60).collect();
        let extension = source.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let digest = sha256_hex(&bytes);
        let short = digest.get(..12).ok_or_else(|| anyhow!("a digest of {} letters", digest.len()))?;
        let name = format!("{stem}-{short}.{extension}");
        let path = out.join(&name);
        write_whole(&path, |file| file.write_all(&bytes)).with_context(|| path.display().to_string())?;
        copies.insert(source.clone(), name);
    }
    Ok((copies, total))
}

fn plain(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_' || letter == '-'
}
