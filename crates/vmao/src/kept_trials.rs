//! Finished trials of an unfinished table, so that a stopped evaluation goes on where it was.

use crate::evaluation::TrialLine;
use crate::failure::Failure;
use crate::interruption::writing;
use crate::learning::{MAX_LINES_BYTES, json_lines, parse_lines, read, whole_lines};
use crate::rollouts::StoredRollouts;
use anyhow::Context;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use vmao_core::rollout::Rollout;

/// `trials.partial.jsonl`: a line for each trial, in the order in which they ended.
#[derive(Debug)]
pub struct KeptTrials {
    path: PathBuf,
    file: Mutex<File>,
    rollouts: StoredRollouts,
}

impl KeptTrials {
    /// Begins anew in `directory`, or with `resume` goes on with the trials that are there; these come back.
    pub fn open(directory: &Path, resume: bool) -> Result<(Self, Vec<TrialLine>), Failure> {
        let path = directory.join("trials.partial.jsonl");
        let context = || path.display().to_string();
        let mut lines = Vec::new();
        if resume && path.exists() {
            // The trial of a line that was cut runs again.
            let bytes = read(&path, MAX_LINES_BYTES)?;
            let whole = whole_lines(&bytes);
            lines = parse_lines(&path, whole)?;
            OpenOptions::new().write(true).open(&path).and_then(|file| file.set_len(whole.len() as u64)).with_context(context)?;
        } else {
            File::create(&path).with_context(context)?;
            if resume {
                // Either stopped before the first trial, or the table is whole.
                lines = json_lines(&directory.join("trials.jsonl"))?;
            }
        }
        let file = Mutex::new(OpenOptions::new().append(true).open(&path).with_context(context)?);
        Ok((Self { path, file, rollouts: StoredRollouts::open(directory, resume)? }, lines))
    }

    /// Adds a trial: its motion first, so that a kept trial that recorded one has it.
    pub fn keep(&self, line: &TrialLine, rollout: Option<&Rollout>) -> Result<(), Failure> {
        if let Some(rollout) = rollout {
            self.rollouts.keep(line, rollout)?;
        }
        let text = serde_json::to_string(line)? + "\n";
        let _writing = writing();
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(file.write_all(text.as_bytes()).with_context(|| self.path.display().to_string())?)
    }

    /// The table is whole and kept elsewhere: this file goes.
    pub fn finish(self) -> Result<(), Failure> {
        Ok(fs::remove_file(&self.path).with_context(|| self.path.display().to_string())?)
    }
}
