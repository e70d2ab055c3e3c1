//! `vmao demo`: the whole loop at laptop size: explore, train both models, evaluate both in both orders, report.

use super::{CommonOptions, Session, whole_run};
use crate::{
    failure::Failure,
    output::{Layout, print},
    training_device::DeviceOptions,
};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(super) struct DemoArguments {
    /// Go on with the run in --out that was stopped
    #[arg(long, requires = "out")]
    resume: bool,
    #[command(flatten)]
    device: DeviceOptions,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &DemoArguments, mut session: Session) -> Result<(), Failure> {
    whole_run::explore_what_is_evaluated(&mut session)?;
    let directory = match &session.out {
        Some(out) if arguments.resume && whole_run::begun(&session, out)? => out.clone(),
        _ => session.output_directory(&unused(Path::new("runs/demo")))?,
    };
    let (results, answer) =
        session.pool()?.install(|| whole_run::run(&session, &directory, arguments.device, arguments.resume))?;
    match session.layout {
        Layout::Line => session.print(&answer),
        Layout::Indented => {
            Ok(print(&format!("{}\n{}\n{}", results.table(), answer.report.display(), answer.results.display()))?)
        }
    }
}

/// `path`, or the first of `path-2`, `path-3`, … that does not exist: no run overwrites another.
fn unused(path: &Path) -> PathBuf {
    let numbered =
        |number: u32| if number == 1 { path.to_owned() } else { PathBuf::from(format!("{}-{number}", path.display())) };
    (1..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| path.to_owned())
}
