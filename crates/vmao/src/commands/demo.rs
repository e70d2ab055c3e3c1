//! `vmao demo`: the whole loop at laptop size: explore, train both models, evaluate both in both orders, report.

use super::{CommonOptions, Session, evaluate::table};
use crate::{
    dataset::{self, DatasetWriter},
    exploration::explore,
    failure::Failure,
    interruption::keeps,
    learning::load,
    output::{Layout, log, print},
    run_report::write_report,
    scenes::grasps,
    training::{TrainingRun, go_on},
};
use anyhow::Context;
use serde::Serialize;
use std::{
    fs,
    path::{Path, PathBuf},
};
use vmao_net::ModelKind;

#[derive(Debug, clap::Args)]
pub(super) struct DemoArguments {
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

#[derive(Debug, Serialize)]
struct Answer {
    report: PathBuf,
    results: PathBuf,
}

pub(super) fn run(_arguments: &DemoArguments, mut session: Session) -> Result<(), Failure> {
    // The models are used in all the orders that are compared, so they must have seen all of them.
    session.configure(|config| {
        if config.explore.orders.is_empty() {
            config.explore.orders.clone_from(&config.evaluate.orders);
        }
    })?;
    let directory = session.output_directory(&unused(Path::new("runs/demo")))?;
    let (results, report) = session.pool()?.install(|| -> Result<_, Failure> {
        let (config, seed) = (&session.config, session.info.seed);
        let data = directory.join("data");
        let writer = DatasetWriter::open(&data)?;
        session.save(&data)?;
        let explored = explore(config, &session.info, &writer, None)?;
        log(&format!("explored: {} of {} trials accepted", explored.successes, explored.trials));
        let records = dataset::load(&data)?;
        let mut models = Vec::new();
        for kind in ModelKind::ALL {
            if config.evaluate.methods.iter().any(|method| method.model() == kind) {
                let place = directory.join("models").join(kind.name());
                fs::create_dir_all(&place).with_context(|| place.display().to_string())?;
                session.save(&place)?;
                let go_on = go_on(&directory.join("config.toml"), seed, &data, kind, &place);
                TrainingRun { config, kind, records: &records, seed, directory: &place, go_on }.train()?;
                models.push(load(&place, grasps(config)?)?);
            }
        }
        let place = directory.display();
        keeps(format!(
            "the data set and the networks are kept in {place}; go on with `vmao evaluate --checkpoint {place}/models`"
        ));
        let results = table(&session, &models, &directory)?;
        Ok((results, write_report(&directory)?))
    })?;
    match session.layout {
        Layout::Line => session.print(&Answer { report, results: directory.join("results.json") }),
        Layout::Indented => {
            Ok(print(&format!("{}\n{}\n{}", results.table(), report.display(), directory.join("results.json").display()))?)
        }
    }
}

/// `path`, or the first of `path-2`, `path-3`, … that does not exist: no run overwrites another.
fn unused(path: &Path) -> PathBuf {
    let numbered =
        |number: u32| if number == 1 { path.to_owned() } else { PathBuf::from(format!("{}-{number}", path.display())) };
    (1..).map(numbered).find(|path| !path.exists()).unwrap_or_else(|| path.to_owned())
}
