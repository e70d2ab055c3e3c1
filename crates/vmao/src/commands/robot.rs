//! `vmao robot meshes NAME --from DIR`: meshes for pictures, from a package that the user has installed.

use super::{CommonOptions, Session};
use crate::{
    failure::Failure,
    output::{Layout, print},
    robot_meshes::{Import, import},
    wording::{listed, unknown},
};
use std::{fmt::Write, path::PathBuf};
use vmao_core::robots::RobotModel;

#[derive(Debug, clap::Args)]
pub(super) struct RobotArguments {
    #[command(subcommand)]
    pub(super) action: Action,
}

#[derive(Debug, clap::Subcommand)]
pub(super) enum Action {
    /// Copy a robot's meshes from an installed package, and print the package's licence
    ///
    /// Reads the MuJoCo model of the robot that the package carries. Only pictures use the meshes: `vmao scene --meshes`.
    /// Writes meshes.json, the mesh files and the licence to --out [default: meshes/NAME].
    Meshes {
        /// Its name: panda or sawyer
        name: String,
        /// The package's folder, for example site-packages/robosuite
        #[arg(long, value_name = "DIR")]
        from: PathBuf,
        #[command(flatten)]
        common: CommonOptions,
    },
}

impl Action {
    pub(super) fn common(&self) -> &CommonOptions {
        match self {
            Self::Meshes { common, .. } => common,
        }
    }
}

pub(super) fn run(arguments: &RobotArguments, session: &Session) -> Result<(), Failure> {
    let Action::Meshes { name, from, .. } = &arguments.action;
    let refuse = || Failure::bad_input(unknown("the program", "robot", name, RobotModel::NAMES));
    let robot = RobotModel::named(name).ok_or_else(refuse)?;
    let prepare = || session.output_directory(&PathBuf::from("meshes").join(robot.name));
    let import = import(&robot, from, prepare)?;
    match session.layout {
        Layout::Line => session.print(&import),
        Layout::Indented => Ok(print(&description(&import))?),
    }
}

fn description(import: &Import) -> String {
    let list = &import.list;
    let mut text = String::new();
    for licence in &list.package.texts {
        let _infallible = writeln!(text, "---- {}\n{}\n----", licence.file, licence.text.trim_end());
    }
    let _infallible = writeln!(text, "{}", list.package.summary());
    let _infallible = writeln!(text, "models: {}", listed(list.models.iter().map(String::as_str)));
    for skipped in &import.skipped {
        let _infallible = writeln!(text, "skipped: {skipped}");
    }
    let _infallible = writeln!(text, "links without a mesh: {}", listed(import.links_without.iter().copied()));
    let megabytes = import.bytes as f64 / 1e6;
    let _infallible = write!(text, "{} meshes, {megabytes:.1} MB, in {}", list.meshes.len(), import.stored_in.display());
    text
}
