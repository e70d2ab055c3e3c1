//! `vmao reference`: the explored successes of scenes that no training saw, for `vmao score`.

use super::{CommonOptions, Session};
use crate::{
    failure::{Failure, OrBadInput},
    reference::{Grounds, ReferenceScene, explore_reference, set_name},
};
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub(super) struct ReferenceArguments {
    /// Scenes of the sizes explored and as many of those kept back, over the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=999))]
    scenes: Option<u64>,
    /// Tuples tried in each scene, over the configuration's
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    tries: Option<u64>,
    /// Go on with the reference that is there
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

#[derive(Debug, Serialize)]
struct Answer {
    reference: PathBuf,
    scenes: Vec<SceneCount>,
}

#[derive(Debug, Serialize)]
struct SceneCount {
    set: &'static str,
    scene: u64,
    tries: usize,
    successes: usize,
}

pub(super) fn run(arguments: &ReferenceArguments, mut session: Session) -> Result<(), Failure> {
    session.configure(|config| {
        config.score.scenes = arguments.scenes.unwrap_or(config.score.scenes);
        config.score.tries = arguments.tries.unwrap_or(config.score.tries);
    })?;
    let default = Path::new("runs/reference");
    let place = session.out.clone().unwrap_or_else(|| default.to_owned());
    if arguments.resume {
        session.info.check_same_run(&place).or_bad_input()?;
    } else if place.join("run.json").exists() {
        let message = format!("{}: holds a run, expected an empty directory; --resume goes on with it", place.display());
        return Err(Failure::bad_input(message));
    }
    let directory = session.output_directory(default)?;
    let grounds = Grounds::new(&session.config, session.info.seed)?;
    let explored = session.pool()?.install(|| explore_reference(&grounds, &directory))?;
    let count = |ReferenceScene { place, records }: &ReferenceScene| SceneCount {
        set: set_name(place.set),
        scene: place.index,
        tries: records.len(),
        successes: records.iter().filter(|record| record.outcome.is_success()).count(),
    };
    session.print(&Answer { reference: directory, scenes: explored.iter().map(count).collect() })
}
