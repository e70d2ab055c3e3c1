//! The whole loop in one directory: explore, train, evaluate, report; what is there already is not made again.

use super::{Session, evaluate::table};
use crate::{
    dataset::{self, DatasetWriter},
    exploration::explore,
    failure::{Failure, OrBadInput},
    interruption::keeps,
    learning::load,
    output::log,
    results::Results,
    run_report::write_report,
    scenes::grasps,
    training::{TrainingRun, go_on},
    training_device::DeviceOptions,
};
use anyhow::Context;
use serde::Serialize;
use std::{
    fs,
    path::{Path, PathBuf},
};
use vmao_net::ModelKind;

/// Where a whole run's results are.
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    pub(super) report: PathBuf,
    pub(super) results: PathBuf,
}

/// Makes the models see all the orders that they are compared in.
pub(super) fn explore_what_is_evaluated(session: &mut Session) -> Result<(), Failure> {
    session.configure(|config| {
        if config.explore.orders.is_empty() {
            config.explore.orders.clone_from(&config.evaluate.orders);
        }
    })
}

/// Runs all stages into `directory`; with `resume`, those that an earlier call left unfinished.
pub(super) fn run(
    session: &Session,
    directory: &Path,
    device: DeviceOptions,
    resume: bool,
) -> Result<(Results, Answer), Failure> {
    let (config, seed) = (&session.config, session.info.seed);
    let data = directory.join("data");
    let writer = DatasetWriter::open(&data)?;
    if !resume || !data.join("run.json").exists() {
        session.save(&data)?;
    }
    let explored = explore(config, &session.info, &writer, None)?;
    log(&format!("explored: {} of {} trials accepted", explored.successes, explored.trials));
    let records = dataset::load(&data)?;
    keeps(format!("what is finished is kept in {}; the same command with --resume and --out goes on", directory.display()));
    let device = device.resolve();
    let mut models = Vec::new();
    for kind in ModelKind::ALL {
        if config.evaluate.methods.iter().any(|method| method.model() == kind) {
            let place = directory.join("models").join(kind.name());
            fs::create_dir_all(&place).with_context(|| place.display().to_string())?;
            session.save(&place)?;
            let go_on = go_on(&directory.join("config.toml"), seed, &data, kind, &place);
            TrainingRun { config, kind, records: &records, seed, device, directory: &place, go_on }.train()?;
            models.push(load(&place, grasps(config)?)?);
        }
    }
    let results = table(session, &models, directory, resume)?;
    let report = write_report(directory)?;
    Ok((results, Answer { report, results: directory.join("results.json") }))
}

/// Whether there is a run in `directory` to go on with; another run there is refused.
pub(super) fn begun(session: &Session, directory: &Path) -> Result<bool, Failure> {
    let begun = directory.join("run.json").exists();
    if begun {
        session.info.check_same_run(directory).or_bad_input()?;
    }
    Ok(begun)
}
