//! Meshes of a robot for pictures: found in an installed package, copied with their licence, read back for scenes.
//!
//! A folder of meshes holds `meshes.json` ([`MeshList`]), the files it names, and the package's licence texts.

mod import;
mod matching;
mod mjcf;
mod package;
#[cfg(test)]
mod tests;

pub use import::{Import, import};
pub use package::{LicenceText, Package};

use crate::{
    json::{self, Document, DocumentError, JsonPath, JsonPose},
    wording::{quoted, unknown},
};
use serde::{Deserialize, Serialize};
use std::path::{Component, Path};
use vmao_core::robots::RobotModel;

/// The list's name in its folder.
pub const LIST: &str = "meshes.json";
/// The most meshes of one robot.
pub const MAX_MESHES: usize = 512;
/// The largest mesh file (bytes).
pub const MAX_MESH_BYTES: u64 = 64 << 20;
/// The most that all mesh files of a robot may have together (bytes).
pub const MAX_TOTAL_BYTES: u64 = 512 << 20;
/// The kinds of mesh files that MuJoCo reads.
const EXTENSIONS: [&str; 3] = ["obj", "stl", "msh"];

/// The meshes of one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshList {
    /// The robot's name.
    pub robot: String,
    /// Where the meshes come from.
    pub package: Package,
    /// The models they were found in, below the folder that was imported from.
    pub models: Vec<String>,
    /// The meshes.
    #[serde(deserialize_with = "json::objects")]
    pub meshes: Vec<Mesh>,
}

/// A mesh on a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mesh {
    /// The link.
    pub link: String,
    /// The file, beside the list.
    pub file: String,
    /// Its frame in the link's.
    pub pose: JsonPose,
    /// From the file's units to metres, along the file's axes.
    pub scale: [f64; 3],
    /// Its colour, each in [0, 1].
    pub rgba: [f32; 4],
}

/// The names of all links, base to fingers.
pub fn link_names(robot: &RobotModel) -> Vec<&'static str> {
    let gripper = &robot.gripper;
    let joints = robot.joints.iter().map(|joint| joint.link.name);
    let fingers = gripper.fingers.iter().map(|finger| finger.link.name);
    [robot.base.name].into_iter().chain(joints).chain([gripper.hand.name]).chain(fingers).collect()
}

/// The meshes in `folder`, ready for a scene. Whatever its list says is checked; it may have been written by others.
pub fn read(folder: &Path) -> Result<Vec<vmao_sim::LinkMesh>, DocumentError> {
    let document = Document::read(&folder.join(LIST))?;
    let list: MeshList = document.parse()?;
    let refuse = |path: &JsonPath, message: String| Err(document.refuse(path, message));
    let Some(robot) = RobotModel::named(&list.robot) else {
        return refuse(&JsonPath::key("robot"), unknown("the program", "robot", &list.robot, RobotModel::NAMES));
    };
    if list.meshes.len() > MAX_MESHES {
        return refuse(&JsonPath::key("meshes"), format!("{} meshes, expected at most {MAX_MESHES}", list.meshes.len()));
    }
    let folder = match folder.canonicalize() {
        Ok(folder) => folder,
        Err(error) => return refuse(&JsonPath::default(), format!("its folder cannot be found: {error}")),
    };
    let mut meshes = Vec::new();
    for (index, mesh) in list.meshes.iter().enumerate() {
        let at = |key: &str| JsonPath::key("meshes").at(index).then(key);
        let Some(&link) = link_names(&robot).iter().find(|link| **link == mesh.link) else {
            return refuse(&at("link"), unknown(robot.name, "link", &mesh.link, link_names(&robot)));
        };
        let path = Path::new(&mesh.file);
        if !matches!(path.components().collect::<Vec<_>>()[..], [Component::Normal(_)]) {
            return refuse(&at("file"), format!("{} is not the name of a file beside {LIST}", quoted(&mesh.file)));
        }
        let file = folder.join(path);
        if let Err(message) = check_mesh_file(&file) {
            return refuse(&at("file"), format!("{}: {message}", quoted(&mesh.file)));
        }
        let Some(link_from_mesh) = mesh.pose.to_pose() else {
            return refuse(&at("pose").then("quaternion"), "is zero".to_owned());
        };
        if mesh.scale.contains(&0.0) {
            return refuse(&at("scale"), "a factor is 0".to_owned());
        }
        if let Some(value) = mesh.rgba.iter().find(|value| !(0.0..=1.0).contains(*value)) {
            return refuse(&at("rgba"), format!("{value}, expected four numbers from 0 to 1"));
        }
        let (scale, rgba) = (mesh.scale, mesh.rgba);
        meshes.push(vmao_sim::LinkMesh { robot: robot.name, link, file, link_from_mesh, scale, rgba });
    }
    Ok(meshes)
}

/// Whether the file is a plain file of a known kind and of a size that is read; its size (bytes).
fn check_mesh_file(path: &Path) -> Result<u64, String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if !EXTENSIONS.contains(&extension.as_str()) {
        return Err(format!("a mesh of kind {}; kinds are: {}", quoted(&extension), EXTENSIONS.join(", ")));
    }
    let metadata = path.metadata().map_err(|error| format!("cannot be read: {error}"))?;
    match metadata.len() {
        _ if !metadata.is_file() => Err("is not a plain file".to_owned()),
        0 => Err("is empty".to_owned()),
        size if size > MAX_MESH_BYTES => Err(format!("has {size} bytes, expected at most {MAX_MESH_BYTES}")),
        size => Ok(size),
    }
}
