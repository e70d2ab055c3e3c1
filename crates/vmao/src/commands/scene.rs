//! `vmao scene --out FILE.xml`: the exact MJCF that the configured trials run on.

use super::{CommonOptions, Session};
use crate::{
    failure::{Failure, OrBadInput},
    output::write_whole,
    robot_meshes,
    scenes::scenes,
};
use anyhow::Context;
use serde_json::json;
use std::{io::Write, path::PathBuf};
use vmao_core::catalogue::InstanceSet;

#[derive(Debug, clap::Args)]
pub(super) struct SceneArguments {
    /// Show robots with these meshes, a folder that `vmao robot meshes` wrote; may be repeated
    #[arg(long, value_name = "DIR")]
    meshes: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &SceneArguments, session: &Session) -> Result<(), Failure> {
    let path = session.out.clone().unwrap_or_else(|| PathBuf::from("scene.xml"));
    if path.is_dir() {
        return Err(Failure::bad_input(format!("{}: is a directory, expected the name of a file to write", path.display())));
    }
    let scenes = scenes(&session.config, InstanceSet::Train)?;
    let scene = scenes.first().ok_or_else(|| Failure::bad_input("the object has no sizes"))?;
    let mut meshes = Vec::new();
    for folder in &arguments.meshes {
        meshes.extend(robot_meshes::read(folder).or_bad_input()?);
    }
    let mjcf = if meshes.is_empty() {
        scene.mjcf.clone()
    } else {
        scene.mjcf_with_meshes(&session.config.scene, &meshes).or_bad_input()?
    };
    write_whole(&path, |file| file.write_all(mjcf.as_bytes())).with_context(|| path.display().to_string())?;
    session.info.save_beside(&path, &session.config).with_context(|| path.display().to_string())?;
    session.print(&json!({ "scene": path }))
}
