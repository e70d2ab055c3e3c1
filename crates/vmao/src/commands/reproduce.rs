//! `vmao reproduce`: the supplement's Table 1 from nothing, with its statistics; goes on where it was stopped.

use super::{CommonOptions, Session, whole_run};
use crate::{
    evaluation::TrialLine,
    failure::Failure,
    learning::json_lines,
    output::{Layout, log, print, write_whole},
    published::markdown,
    training_device::DeviceOptions,
};
use anyhow::Context;
use std::{io::Write, path::Path};

/// The experiment's configuration, over the demonstration's: its name in messages, and its text.
pub(super) const CONFIGURATION: (&str, &str) = ("configs/reproduce.toml", include_str!("../../../../configs/reproduce.toml"));

#[derive(Debug, clap::Args)]
pub(super) struct ReproduceArguments {
    /// Trials of each cell, over the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    trials: Option<u64>,
    #[command(flatten)]
    device: DeviceOptions,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &ReproduceArguments, mut session: Session) -> Result<(), Failure> {
    session.configure(|config| config.evaluate.trials = arguments.trials.unwrap_or(config.evaluate.trials))?;
    whole_run::explore_what_is_evaluated(&mut session)?;
    let directory = session.out.clone().unwrap_or_else(|| Path::new("runs/reproduce").to_owned());
    let resume = whole_run::begun(&session, &directory)?;
    if resume {
        log(&format!("{}: goes on with the run that is there", directory.display()));
    } else {
        session.output_directory(&directory)?;
    }
    let (results, answer) = session.pool()?.install(|| whole_run::run(&session, &directory, arguments.device, resume))?;
    let lines: Vec<TrialLine> = json_lines(&directory.join("trials.jsonl"))?;
    let table = markdown(&results, &lines, session.config.scene.timestep);
    let place = directory.join("results.md");
    write_whole(&place, |file| file.write_all(table.as_bytes())).with_context(|| place.display().to_string())?;
    match session.layout {
        Layout::Line => session.print(&results),
        Layout::Indented => {
            let files = [&place, &answer.report, &answer.results].map(|path| path.display().to_string()).join("\n");
            Ok(print(&format!("{}\n{files}", results.table()))?)
        }
    }
}
