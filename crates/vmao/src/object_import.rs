//! Writes an imported object to a folder of its own: there whole or not at all.

use crate::failure::Failure;
use anyhow::Context;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::{
    fs, io,
    path::{Path, PathBuf},
};
use vmao_core::{
    catalogue::widths_held,
    object_file::{FILE_NAME, MeshEntry, ObjectFile},
    robots::RobotModel,
    wording::quoted,
};
use vmao_import::Import;

/// The folder of meshes and images in an object's folder.
const PICTURES: &str = "visual";
/// The repair report in an object's folder.
pub const REPAIRS: &str = "repairs.json";

/// What was written.
#[derive(Debug, Serialize)]
pub struct Written {
    /// The object's document.
    pub object: PathBuf,
    /// For each robot: the parts that are nowhere as wide as its gripper takes, and how wide they are.
    pub grippers: Map<String, Value>,
}

/// Refuses an output folder that is there already.
pub fn check_free(out: &Path) -> Result<(), Failure> {
    match out.symlink_metadata() {
        Ok(_) => Err(Failure::bad_input(format!("{}: is there already, expected a folder to be made", out.display()))),
        Err(_) => Ok(()),
    }
}

fn folder_of(out: &Path) -> &Path {
    out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where decompositions are kept: beside the output, for whoever imports into the same folder again.
pub fn cache_beside(out: &Path) -> PathBuf {
    folder_of(out).join(".vmao-hulls")
}

/// Writes the object, its pictures and the repair report to `out`; `describe` adds how it was made.
pub fn write(imported: &Import, out: &Path, describe: impl FnOnce(&Path) -> io::Result<()>) -> Result<Written, Failure> {
    let mut document = ObjectFile::new(&imported.object, &[]);
    document.source = Some(imported.source.clone());
    for picture in &imported.pictures {
        if let Some(part) = picture.part {
            let mesh =
                MeshEntry { file: format!("{PICTURES}/{}", picture.file), pose: vmao_core::json_pose::JsonPose::default() };
            document.parts[part].meshes.push(mesh);
        }
    }
    // What every command will read must be what every command accepts.
    document.item().map_err(|error| Failure::bad_input(format!("the object cannot be simulated: {error}")))?;
    let parent = folder_of(out);
    fs::create_dir_all(parent).with_context(|| format!("{}: cannot be made a directory", parent.display()))?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let partial = parent.join(format!(".{name}.{}.partial", std::process::id()));
    let written = fill(&partial, &document, imported).and_then(|()| describe(&partial)).and_then(|()| {
        check_free(out).map_err(|failure| io::Error::other(failure.to_string()))?;
        fs::rename(&partial, out)
    });
    if let Err(error) = written {
        // The disk may be full: give back what was taken. The first error is the one to report.
        drop(fs::remove_dir_all(&partial));
        return Err(Failure::from(anyhow::Error::from(error).context(format!("{}: cannot be written", out.display()))));
    }
    Ok(Written { object: out.join(FILE_NAME), grippers: grippers(imported) })
}

fn fill(folder: &Path, document: &ObjectFile, imported: &Import) -> io::Result<()> {
    if folder.exists() {
        // Left by a run of the same number that was killed.
        fs::remove_dir_all(folder)?;
    }
    fs::create_dir_all(folder.join(PICTURES))?;
    for picture in &imported.pictures {
        fs::write(folder.join(PICTURES).join(&picture.file), &picture.bytes)?;
    }
    fs::write(folder.join(REPAIRS), serde_json::to_string_pretty(&json!({ "repairs": imported.repairs }))? + "\n")?;
    fs::write(folder.join(FILE_NAME), serde_json::to_string_pretty(document)? + "\n")
}

/// For each robot: what its gripper takes, and the parts of which neither the whole nor any solid is that wide.
fn grippers(imported: &Import) -> Map<String, Value> {
    let millimetres = |metres: f64| (metres * 1e4).round() / 10.0;
    let of_robot = |robot: RobotModel| {
        let [least, greatest] = widths_held(&robot.gripper);
        let parts = imported.object.parts.iter().zip(&imported.widths);
        let refused: Vec<String> = parts
            .filter(|(_, widths)| !widths.iter().any(|width| (least..=greatest).contains(width)))
            .map(|(part, widths)| {
                let (name, width) = (quoted(&part.name), millimetres(widths.first().copied().unwrap_or_default()));
                let [least, greatest] = [least, greatest].map(millimetres);
                format!("part {name} is at least {width} mm wide, the gripper takes {least} to {greatest} mm")
            })
            .collect();
        (robot.name.to_owned(), json!({ "refused": refused }))
    };
    RobotModel::NAMES.into_iter().filter_map(RobotModel::named).map(of_robot).collect()
}
