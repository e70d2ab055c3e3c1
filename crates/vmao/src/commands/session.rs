//! The options that every command takes, and what they resolve to.

use crate::{
    config::Config,
    failure::{Failure, OrBadInput},
    output::{Layout, print_json},
    provenance::RunInfo,
};
use anyhow::Context;
use serde::Serialize;
use std::{
    fs,
    num::NonZeroUsize,
    path::{Path, PathBuf},
    thread,
};
use vmao_sim::profile;

/// The options that every command takes.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Options of every command")]
pub struct CommonOptions {
    /// Configuration file, over the shipped one
    #[arg(long, value_name = "FILE.toml")]
    pub config: Option<PathBuf>,
    /// Change one value of the configuration; may be repeated
    #[arg(long = "set", value_name = "SECTION.KEY=VALUE")]
    pub settings: Vec<String>,
    /// Seed: with the configuration and a trial's number it decides everything
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Threads; never changes a result [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub workers: Option<u16>,
    /// Directory for what is written
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Say on stderr where the trials' time went
    #[arg(long)]
    pub profile: bool,
    /// One JSON document on stdout
    #[arg(long)]
    pub json: bool,
}

/// A command's resolved surroundings.
#[derive(Debug, Clone)]
pub struct Session {
    /// The configuration.
    pub config: Config,
    /// What is saved as `run.json`.
    pub info: RunInfo,
    /// Threads to use.
    pub workers: usize,
    /// The directory asked for.
    pub out: Option<PathBuf>,
    /// Whether stdout is for a program or for a person.
    pub layout: Layout,
}

impl Session {
    /// Resolves the options; a configuration that cannot be used is bad input.
    pub fn start(options: &CommonOptions, command_line: &[String]) -> Result<Self, Failure> {
        Self::start_over(None, options, command_line)
    }

    /// The same over one of the further shipped configurations, (name, text).
    pub fn start_over(base: Option<(&str, &str)>, options: &CommonOptions, command_line: &[String]) -> Result<Self, Failure> {
        if options.profile {
            profile::start();
        }
        let config = Config::load_over(base, options.config.as_deref(), &options.settings).or_bad_input()?;
        let info = RunInfo::new(command_line, options.seed, &config)?;
        let cores = || thread::available_parallelism().map_or(1, NonZeroUsize::get);
        Ok(Self {
            config,
            info,
            workers: options.workers.map_or_else(cores, usize::from),
            out: options.out.clone(),
            layout: if options.json { Layout::Line } else { Layout::Indented },
        })
    }

    /// Changes the configuration by a command's own options; what is saved beside the output follows.
    pub fn configure(&mut self, change: impl FnOnce(&mut Config)) -> Result<(), Failure> {
        change(&mut self.config);
        self.info.config_sha256 = self.config.sha256()?;
        Ok(())
    }

    /// A pool of the threads asked for.
    pub fn pool(&self) -> Result<rayon::ThreadPool, Failure> {
        Ok(rayon::ThreadPoolBuilder::new().num_threads(self.workers).build()?)
    }

    /// The output directory, `--out` or `default`: made if need be, with the configuration and `run.json` in it.
    pub fn output_directory(&self, default: &Path) -> Result<PathBuf, Failure> {
        let directory = self.out.as_deref().unwrap_or(default);
        fs::create_dir_all(directory).with_context(|| format!("{}: cannot be made a directory", directory.display()))?;
        self.save(directory)?;
        Ok(directory.to_owned())
    }

    /// Writes the configuration and `run.json` into a directory.
    pub fn save(&self, directory: &Path) -> Result<(), Failure> {
        Ok(self.info.save(directory, &self.config).with_context(|| format!("{}: cannot be written to", directory.display()))?)
    }

    /// Writes a JSON document to stdout, on one line with `--json`.
    pub fn print<T: Serialize>(&self, document: &T) -> Result<(), Failure> {
        Ok(print_json(document, self.layout).context("stdout")?)
    }
}
