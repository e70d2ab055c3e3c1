//! `vmao object import PATH --out DIR`: what users have becomes what the program can simulate.

use super::{CommonOptions, Session};
use crate::{
    failure::{Failure, OrBadInput, contained},
    object_import,
};
use serde_json::json;
use std::path::PathBuf;
use vmao_import::{HelperMotion, MAX_HULLS, Options, UpAxis};

#[derive(Debug, clap::Args)]
pub(super) struct ImportArguments {
    /// A PartNet-Mobility folder, a URDF file or an MJCF file
    path: PathBuf,
    /// Length of the longest edge in metres [default: the file's, or by category and so that a gripper can hold it]
    #[arg(long, value_name = "METRES", value_parser = within::<1, 3_000>)]
    size: Option<f64>,
    /// Mass of all parts in kilograms [default: the file's, or by category]
    #[arg(long, value_name = "KG", value_parser = within::<1, 100_000>)]
    mass: Option<f64>,
    /// The object's name [default: the folder's or the file's own]
    #[arg(long)]
    name: Option<String>,
    /// Which joint stays where a link without shape has two
    #[arg(long, value_name = "MOTION", default_value = "slide")]
    helper: Helper,
    /// The most convex hulls of a part
    #[arg(long, value_name = "N", default_value_t = vmao_import::DEFAULT_HULLS as u16, value_parser = clap::value_parser!(u16).range(1..=MAX_HULLS as i64))]
    hulls: u16,
    /// Which axis of the file points up
    #[arg(long, value_name = "AXIS", default_value = "auto")]
    up: Up,
    /// The body of a MuJoCo model that is the object, where the world has several
    #[arg(long, value_name = "NAME")]
    body: Option<String>,
    /// The folder that meshes and images may be read from [default: the file's own]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Helper {
    Slide,
    Turn,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Up {
    Auto,
    Y,
    Z,
}

/// A number from `LEAST` to `MOST` thousandths.
fn within<const LEAST: u32, const MOST: u32>(text: &str) -> Result<f64, String> {
    let (least, most) = (f64::from(LEAST) / 1e3, f64::from(MOST) / 1e3);
    let value: Option<f64> = text.parse().ok();
    value.filter(|value| (least..=most).contains(value)).ok_or_else(|| format!("expected a number from {least} to {most}"))
}

pub(super) fn run(arguments: &ImportArguments, session: &Session) -> Result<(), Failure> {
    let Some(out) = &session.out else {
        return Err(Failure::bad_input("--out DIR is missing: the folder to write the object to"));
    };
    object_import::check_free(out)?;
    let options = Options {
        name: arguments.name.clone(),
        size: arguments.size,
        mass: arguments.mass,
        helper: match arguments.helper {
            Helper::Slide => HelperMotion::Slide,
            Helper::Turn => HelperMotion::Turn,
        },
        hulls: Some(usize::from(arguments.hulls)),
        up: match arguments.up {
            Up::Auto => UpAxis::Auto,
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        },
        body: arguments.body.clone(),
        root: arguments.root.clone(),
        cache: Some(object_import::cache_beside(out)),
    };
    let imported = contained(|| vmao_import::import(&arguments.path, &options));
    let refuse = || Failure::bad_input(format!("{}: the reader gave up on it", arguments.path.display()));
    let imported = match imported.ok_or_else(refuse)? {
        Err(error @ vmao_import::Error::Refused { .. }) => Err(error).or_bad_input()?,
        result => result?,
    };
    let written = object_import::write(&imported, out, |folder| session.info.save(folder, &session.config))?;
    session.print(&json!({
        "object": written.object,
        "name": imported.object.name,
        "parts": imported.object.parts.len(),
        "joints": imported.object.joints.len(),
        "repairs": imported.repairs,
        "grippers": written.grippers,
    }))
}
