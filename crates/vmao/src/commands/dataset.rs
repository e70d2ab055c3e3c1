//! `vmao dataset`: put the data sets of shards together, say what is in one, show one of its trials.

use super::{CommonOptions, Session};
use crate::{
    config::Config,
    dataset::{self, DatasetWriter},
    failure::{Failure, OrBadInput},
    merging::Pieces,
    output::{Layout, print, write_whole},
    provenance::RunInfo,
    replay::{data_directory, difference, run_again},
    report::{Provenance, ReportData, RolloutFigure, render},
    rollouts::PackedRollout,
    statistics::statistics,
};
use anyhow::Context;
use serde::Serialize;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};
use vmao_core::outcome::TrialOutcome;
use vmao_sim::Recording;

#[derive(Debug, clap::Args)]
pub(super) struct DatasetArguments {
    #[command(subcommand)]
    pub(super) action: Action,
}

#[derive(Debug, clap::Subcommand)]
pub(super) enum Action {
    /// The data set of the single run from those of its shards, into --out
    Merge {
        /// Directories of shards, or directories with such directories in them
        #[arg(required = true, value_name = "DIR")]
        directories: Vec<PathBuf>,
        #[command(flatten)]
        common: CommonOptions,
    },
    /// Trials, acceptance, failures, contacts of each part and distributions
    Stats {
        /// A data set, or a run with one in `data`
        #[arg(value_name = "DIR")]
        directory: PathBuf,
        #[command(flatten)]
        common: CommonOptions,
    },
    /// Runs one trial again, checks that it equals its record bit for bit, and writes a report with its motion
    Show {
        /// A data set, or a run with one in `data`
        #[arg(value_name = "DIR")]
        directory: PathBuf,
        /// Number of the trial
        #[arg(value_name = "K")]
        trial: u64,
        #[command(flatten)]
        common: CommonOptions,
    },
}

impl Action {
    pub(super) fn common(&self) -> &CommonOptions {
        match self {
            Self::Merge { common, .. } | Self::Stats { common, .. } | Self::Show { common, .. } => common,
        }
    }
}

#[derive(Debug, Serialize)]
struct Shown {
    report: PathBuf,
    equal: bool,
}

pub(super) fn run(arguments: &DatasetArguments, session: &Session) -> Result<(), Failure> {
    match &arguments.action {
        Action::Merge { directories, .. } => merge(directories, session),
        Action::Stats { directory, .. } => {
            let statistics = statistics(&existing(directory)?)?;
            match session.layout {
                Layout::Line => session.print(&statistics),
                Layout::Indented => Ok(print(statistics.table().trim_end())?),
            }
        }
        Action::Show { directory, trial, .. } => show(&existing(directory)?, *trial, session),
    }
}

fn existing(directory: &Path) -> Result<PathBuf, Failure> {
    data_directory(directory)?
        .ok_or_else(|| Failure::bad_input(format!("{}: no trials-*.parquet, expected a data set", directory.display())))
}

fn merge(directories: &[PathBuf], session: &Session) -> Result<(), Failure> {
    let out = session.out.as_deref().ok_or_else(|| Failure::bad_input("--out: missing, expected where to write the data set"))?;
    let pieces = Pieces::find(directories)?;
    let writer = DatasetWriter::open(out)?;
    let merged = pieces.merge(&writer)?;
    let info = RunInfo { command: session.info.command.clone(), ..pieces.info };
    info.save(out, &pieces.config).with_context(|| format!("{}: cannot be written to", out.display()))?;
    session.print(&merged)
}

fn show(directory: &Path, trial: u64, session: &Session) -> Result<(), Failure> {
    let config = Config::load(Some(&directory.join("config.toml")), &[]).or_bad_input()?;
    let info = RunInfo::load(directory).or_bad_input()?;
    let files = dataset::found_files(directory).or_bad_input()?;
    let Some(file) = files.iter().find(|file| (file.first..=file.last).contains(&trial)) else {
        let (first, last) = (files[0].first, files[files.len() - 1].last);
        let message = format!("{}: no trial {trial}; trials are {first} to {last}", directory.display());
        return Err(Failure::bad_input(message));
    };
    let record = dataset::read_round(file).or_bad_input()?.swap_remove((trial - file.first) as usize);
    let again = run_again(&config, &record, Recording::On)?;
    if let Some(difference) = difference(&record, &again.record) {
        let file = file.path.display();
        return Err(Failure::Work(anyhow::anyhow!("{file}: trial {trial} run again is another: {difference}")));
    }
    let (what, why) = match record.outcome {
        TrialOutcome::Success => ("success".to_owned(), String::new()),
        TrialOutcome::Failed(stage) => (format!("failure at {}", stage.name()), format!(" {}.", record.detail)),
    };
    let title = format!("Trial {trial}: {what}");
    let rollout = PackedRollout::pack(&again.rollout.unwrap_or_default())?;
    let caption = format!("{} order, {} steps.{why}", record.order.name(), record.steps);
    let data = ReportData {
        title: format!("vmao · {} with {} · trial {trial}", config.object_name(), config.robots.names.join(" + ")),
        summary: format!("Trial {trial} of {}, {what}; run again from its record, equal bit for bit.", directory.display()),
        rollouts: vec![RolloutFigure { title, caption, trial: None, rollout }],
        provenance: Provenance {
            command: session.info.command.join(" "),
            version: info.version.clone(),
            commit: info.commit.clone(),
            seed: info.seed,
            digest: dataset::digest([&record]),
            config: config.to_toml()?,
        },
        ..ReportData::default()
    };
    let place = session.out.clone().unwrap_or_else(|| Path::new("runs").join(format!("trial-{trial}")));
    fs::create_dir_all(&place).with_context(|| place.display().to_string())?;
    if place.canonicalize()? != directory.canonicalize()? {
        // The configuration used is the run's; the data set itself keeps its own.
        RunInfo { command: session.info.command.clone(), ..info }
            .save(&place, &config)
            .with_context(|| place.display().to_string())?;
    }
    let report = place.join("report.html");
    let page = render(&data)?;
    write_whole(&report, |file| file.write_all(page.as_bytes())).with_context(|| report.display().to_string())?;
    session.print(&Shown { report, equal: true })
}
