//! Robots' meshes in the written scene: only looked at, never touched, without mass.
//!
//! MuJoCo's viewer shows the geom groups 0 to 2. Meshes are in group 2, the solids that they stand for in group 3.

use crate::convention::{compile, pose_attributes};
use crate::error::Error;
use crate::mjcf;
use crate::scene::{Scene, SceneConfig};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use vmao_core::geometry::Pose;

/// A mesh that a link of every robot of this name is shown with.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkMesh {
    /// The robot's name.
    pub robot: &'static str,
    /// The link's name in the robot.
    pub link: &'static str,
    /// The mesh's file; an absolute path, for the scene's own folder does not matter then.
    pub file: PathBuf,
    /// The mesh's frame in the link's.
    pub link_from_mesh: Pose,
    /// From the file's units to metres, along the file's axes.
    pub scale: [f64; 3],
    /// Its colour, each in [0, 1].
    pub rgba: [f32; 4],
}

impl Scene {
    /// The scene as MJCF, made by `config`, with these meshes on its robots; bodies and collisions are the same.
    ///
    /// Fails if a mesh is of a robot that the scene does not have, or if the simulator refuses a mesh.
    pub fn mjcf_with_meshes(&self, config: &SceneConfig, meshes: &[LinkMesh]) -> Result<String, Error> {
        if let Some(mesh) = meshes.iter().find(|mesh| self.robots.iter().all(|robot| robot.name != mesh.robot)) {
            let present: Vec<&str> = self.robots.iter().map(|robot| robot.name).collect();
            return Err(Error::Meshes {
                cause: format!("of robot `{}`; the scene's robots are: {}", mesh.robot, present.join(", ")),
            });
        }
        if let Some(mesh) = meshes.iter().find(|mesh| mesh.file.to_str().is_none()) {
            return Err(Error::Meshes { cause: format!("{} is not UTF-8 text", mesh.file.display()) });
        }
        let mjcf = mjcf::scene(config, &self.robots, &self.world_from_bases, &self.object, meshes);
        compile(&mjcf).map_err(|cause| Error::Meshes { cause })?;
        Ok(mjcf)
    }
}

/// The asset elements of all meshes: one for each file and scale; nothing without meshes.
pub(crate) fn assets(meshes: &[LinkMesh]) -> String {
    let mut xml = String::new();
    if meshes.is_empty() {
        return xml;
    }
    let assets: BTreeSet<(String, String)> = meshes.iter().map(|mesh| (asset_name(mesh), asset_source(mesh))).collect();
    xml.push_str("<asset>\n");
    for (name, source) in assets {
        // A mesh for pictures need not be closed: as a shell it still has the mass properties that MuJoCo computes of any mesh.
        let _infallible = writeln!(xml, r#"<mesh name="{name}" {source} inertia="shell"/>"#);
    }
    xml.push_str("</asset>\n");
    xml
}

fn asset_source(mesh: &LinkMesh) -> String {
    let [x, y, z] = mesh.scale;
    format!(r#"file="{}" scale="{x} {y} {z}""#, escaped(&mesh.file.to_string_lossy()))
}

fn asset_name(mesh: &LinkMesh) -> String {
    let stem = mesh.file.file_name().map(Path::new).unwrap_or(&mesh.file).to_string_lossy().into_owned();
    let [x, y, z] = mesh.scale;
    format!("{}/{}@{x},{y},{z}", mesh.robot, escaped(&stem))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// What the links of one robot are shown with.
pub(crate) struct Dress<'a>(Vec<&'a LinkMesh>);

impl<'a> Dress<'a> {
    pub(crate) fn of(robot: &str, meshes: &'a [LinkMesh]) -> Self {
        Self(meshes.iter().filter(|mesh| mesh.robot == robot).collect())
    }

    /// The attribute that hides the solids of a link that has meshes.
    pub(crate) fn solid_group(&self, link: &str) -> &'static str {
        if self.0.iter().any(|mesh| mesh.link == link) { r#" group="3""# } else { "" }
    }

    /// The elements of the link's meshes.
    pub(crate) fn geoms(&self, link: &str) -> String {
        let mut xml = String::new();
        for mesh in self.0.iter().filter(|mesh| mesh.link == link) {
            let [r, g, b, a] = mesh.rgba;
            let (name, pose) = (asset_name(mesh), pose_attributes(&mesh.link_from_mesh));
            let _infallible = writeln!(
                xml,
                r#"<geom type="mesh" mesh="{name}" {pose} rgba="{r} {g} {b} {a}" contype="0" conaffinity="0" mass="0" group="2"/>"#
            );
        }
        xml
    }
}
