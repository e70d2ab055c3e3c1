//! `vmao explore`: Algorithm 1 into a data set.

use super::{CommonOptions, Session};
use crate::{
    dataset::DatasetWriter,
    exploration::explore,
    failure::{Failure, OrBadInput},
    sharing::Share,
};
use std::path::Path;

#[derive(Debug, clap::Args)]
pub(super) struct ExploreArguments {
    /// Successes wanted, over the configuration's; whole rounds run, so that there may be some more
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    successes: Option<u64>,
    /// Trials at most, over the configuration's
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u64).range(1..))]
    max_trials: Option<u64>,
    /// Go on with the data set that is there
    #[arg(long)]
    resume: bool,
    /// Run part i of n of every round; all parts in one --out, on one file system; `vmao dataset merge` puts them together
    #[arg(long, value_name = "I/N")]
    shard: Option<Share>,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &ExploreArguments, mut session: Session) -> Result<(), Failure> {
    session.configure(|config| {
        config.explore.successes = arguments.successes.unwrap_or(config.explore.successes);
        config.explore.max_trials = arguments.max_trials.unwrap_or(config.explore.max_trials);
    })?;
    let place = session.out.clone().unwrap_or_else(|| Path::new("runs/explore").to_owned());
    let directory = arguments.shard.map_or_else(|| place.clone(), |share| share.directory(&place));
    if arguments.resume {
        session.info.check_resumes(&directory, &session.config).or_bad_input()?;
    }
    let writer = DatasetWriter::open(&directory)?;
    if !arguments.resume {
        if !writer.found_files().or_bad_input()?.is_empty() {
            let directory = directory.display();
            let message = format!("{directory}: holds a data set, expected an empty directory; --resume goes on with it");
            return Err(Failure::bad_input(message));
        }
        session.save(&directory)?;
    }
    let shared = arguments.shard.map(|share| (share, &*place));
    let explored = session.pool()?.install(|| explore(&session.config, &session.info, &writer, shared))?;
    session.print(&explored)
}
