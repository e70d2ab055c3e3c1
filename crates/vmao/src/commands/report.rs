//! `vmao report RUN_DIR`: report.html of a run.

use super::{CommonOptions, Session};
use crate::{failure::Failure, run_report::write_report};
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(super) struct ReportArguments {
    /// A run directory of `vmao demo` or `vmao evaluate`
    #[arg(value_name = "RUN_DIR")]
    directory: PathBuf,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &ReportArguments, session: &Session) -> Result<(), Failure> {
    let report = session.pool()?.install(|| write_report(&arguments.directory))?;
    session.print(&json!({ "report": report }))
}
