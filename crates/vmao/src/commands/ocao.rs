//! `vmao ocao FILE`: object-centric control as a pure function. The answer is JSON with and without `--json`.

use super::{CommonOptions, Session};
use crate::{
    failure::{Failure, OrBadInput},
    json::Document,
    ocao::answer,
    output::write_whole,
};
use anyhow::Context;
use std::{io::Write, path::PathBuf};

#[derive(Debug, clap::Args)]
pub(super) struct OcaoArguments {
    /// The request, a JSON document; - for standard input
    #[arg(value_name = "FILE")]
    request: PathBuf,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &OcaoArguments, session: &Session) -> Result<(), Failure> {
    let answer = answer(&Document::read(&arguments.request).or_bad_input()?).or_bad_input()?;
    if let Some(default) = &session.out {
        let path = session.output_directory(default)?.join("ocao.json");
        let text = serde_json::to_string_pretty(&answer)?;
        write_whole(&path, |file| writeln!(file, "{text}")).with_context(|| path.display().to_string())?;
    }
    session.print(&answer)
}
