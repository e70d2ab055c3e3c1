//! `vmao scene --out FILE.xml`: the exact MJCF that the configured trials run on.

use super::{CommonOptions, Session};
use crate::{failure::Failure, output::write_whole, scenes::scenes};
use anyhow::Context;
use serde_json::json;
use std::{io::Write, path::PathBuf};
use vmao_core::catalogue::InstanceSet;

#[derive(Debug, clap::Args)]
pub(super) struct SceneArguments {
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(_arguments: &SceneArguments, session: &Session) -> Result<(), Failure> {
    let path = session.out.clone().unwrap_or_else(|| PathBuf::from("scene.xml"));
    let scenes = scenes(&session.config, InstanceSet::Train)?;
    let scene = scenes.first().ok_or_else(|| Failure::bad_input("the object has no sizes"))?;
    write_whole(&path, |file| file.write_all(scene.mjcf.as_bytes())).with_context(|| path.display().to_string())?;
    session.print(&json!({ "scene": path }))
}
