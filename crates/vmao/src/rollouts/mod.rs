//! The motions of a run's trials: recorded while they are evaluated, kept one file a trial, shown by the report and exported.

mod bodies;
mod columns;
mod mounts;
mod packed;

pub(crate) use columns::squeeze;
pub use packed::PackedRollout;

use crate::evaluation::TrialLine;
use crate::failure::{Failure, OrBadInput};
use crate::json::Document;
use crate::output::write_whole;
use crate::results::Method;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use vmao_core::order::GraspOrder;
use vmao_core::rollout::Rollout;

/// Version of the files' layout.
const SCHEMA: u32 = 2;

/// `rollouts/` of a run directory: one JSON file for each trial of the table.
#[derive(Debug)]
pub struct StoredRollouts {
    directory: PathBuf,
}

/// A file: whose motion it is, and the motion.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredRollout {
    schema: u32,
    order: GraspOrder,
    method: Method,
    index: u64,
    rollout: PackedRollout,
}

impl StoredRollouts {
    /// Those of a run directory.
    pub fn of(run: &Path) -> Self {
        Self { directory: run.join("rollouts") }
    }

    /// Makes room for the rollouts of a table; without `resume` those of an earlier table are removed.
    pub fn open(run: &Path, resume: bool) -> Result<Self, Failure> {
        let stored = Self::of(run);
        let context = || stored.directory.display().to_string();
        fs::create_dir_all(&stored.directory).with_context(context)?;
        if !resume {
            for entry in fs::read_dir(&stored.directory).with_context(context)? {
                let path = entry.with_context(context)?.path();
                if path.extension().is_some_and(|extension| extension == "json") {
                    fs::remove_file(&path).with_context(|| path.display().to_string())?;
                }
            }
        }
        Ok(stored)
    }

    /// Where the motion of a trial is or would be.
    pub fn path(&self, line: &TrialLine) -> PathBuf {
        self.directory.join(format!("{}-{}-{}.json", line.order.name(), line.method.name(), line.index))
    }

    /// Keeps the motion of a trial.
    pub fn keep(&self, line: &TrialLine, rollout: &Rollout) -> Result<(), Failure> {
        let path = self.path(line);
        let rollout = PackedRollout::pack(rollout)?;
        let (order, method, index) = (line.order, line.method, line.index);
        let text = serde_json::to_string(&StoredRollout { schema: SCHEMA, order, method, index, rollout })? + "\n";
        Ok(write_whole(&path, |file| file.write_all(text.as_bytes())).with_context(|| path.display().to_string())?)
    }

    /// The motion of a trial, if it is kept; a file of another trial or layout is refused.
    pub fn read(&self, line: &TrialLine) -> Result<Option<PackedRollout>, Failure> {
        let path = self.path(line);
        if !path.is_file() {
            return Ok(None);
        }
        let stored: StoredRollout = Document::read(&path).or_bad_input()?.parse().or_bad_input()?;
        let refuse = |what: String| Err(Failure::bad_input(format!("{}: {what}", path.display())));
        if stored.schema != SCHEMA {
            return refuse(format!("schema {}, expected {SCHEMA}; without this file the trial can be run again", stored.schema));
        }
        let found = (stored.order, stored.method, stored.index);
        if found != (line.order, line.method, line.index) {
            let (order, method, index) = (found.0.name(), found.1.name(), found.2);
            return refuse(format!("the rollout of trial {index} of {method}, {order}, expected that of its name"));
        }
        Ok(Some(stored.rollout))
    }
}
