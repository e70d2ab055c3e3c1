//! `vmao verify`: runs recorded trials of a run again and compares them bit for bit.

use super::{CommonOptions, Session};
use crate::{failure::Failure, replay::verify};
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(super) struct VerifyArguments {
    /// A run of explore, evaluate or demo
    #[arg(value_name = "RUN_DIR")]
    run: PathBuf,
    /// Trials to run again, drawn from all of the run's with --seed
    #[arg(long, value_name = "K", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    trials: u64,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &VerifyArguments, session: &Session) -> Result<(), Failure> {
    let verified = session.pool()?.install(|| verify(&arguments.run, arguments.trials, session.info.seed))?;
    session.print(&verified)?;
    match verified.difference {
        None => Ok(()),
        Some(difference) => Err(Failure::Work(anyhow::Error::msg(difference))),
    }
}
