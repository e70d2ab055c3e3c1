//! What trainings leave for people and programs to look at: `training.jsonl`, and an event file of TensorBoard for each network.
//!
//! A line is written before the state that follows it, so a resumed training finds at least the lines of its epochs; it drops
//! those beyond, which are written again. Nothing here holds a time.

use crate::failure::{Failure, OrBadInput};
use crate::interruption::writing;
use crate::learning::{grasp_directory, json_lines, parse_lines, whole_lines};
use crate::output::write_whole;
use crate::tensorboard::{header, scalars};
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use vmao_net::EpochReport;

const NAME: &str = "training.jsonl";
/// TensorBoard takes files for its own by `tfevents`.
const EVENTS: &str = "events.out.tfevents.0.vmao";

/// One line of `training.jsonl`. Losses in nats; none where there was nothing to measure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochLine {
    /// Which grasp step's network.
    pub grasp: usize,
    /// From one.
    pub epoch: usize,
    /// Cross-entropy on the training examples.
    pub train_reconstruction: f32,
    /// KL divergence on the training examples; zero for Top-1.
    pub train_kl: f32,
    /// Cross-entropy on the validation examples.
    pub validation_reconstruction: Option<f32>,
    /// KL divergence on the validation examples.
    pub validation_kl: Option<f32>,
    /// Weight of the divergence.
    pub beta: f32,
    /// Adam's step size.
    pub learning_rate: f32,
    /// Length of the gradient, mean over the epoch's batches.
    pub gradient_norm: f32,
}

impl EpochLine {
    /// The line of an epoch of the network of this grasp step.
    pub fn of(grasp: usize, report: &EpochReport) -> Self {
        Self {
            grasp,
            epoch: report.epoch,
            train_reconstruction: report.training.reconstruction,
            train_kl: report.training.kl,
            validation_reconstruction: report.validation.map(|elbo| elbo.reconstruction),
            validation_kl: report.validation.map(|elbo| elbo.kl),
            beta: report.beta,
            learning_rate: report.learning_rate,
            gradient_norm: report.gradient_norm,
        }
    }

    fn json(&self) -> io::Result<String> {
        Ok(serde_json::to_string(self)? + "\n")
    }

    fn event(&self) -> Vec<u8> {
        let measured = [
            ("cross_entropy/training", Some(self.train_reconstruction)),
            ("cross_entropy/validation", self.validation_reconstruction),
            ("kl/training", Some(self.train_kl)),
            ("kl/validation", self.validation_kl),
            ("schedule/beta", Some(self.beta)),
            ("schedule/learning_rate", Some(self.learning_rate)),
            ("gradient_norm", Some(self.gradient_norm)),
        ];
        let values: Vec<(&str, f32)> = measured.into_iter().filter_map(|(tag, value)| Some((tag, value?))).collect();
        scalars(self.epoch as u64, &values)
    }
}

/// The logs of all networks of one `train`.
#[derive(Debug)]
pub struct TrainingLog {
    directory: PathBuf,
    /// By grasp, then epoch.
    lines: Vec<EpochLine>,
    /// The two files as long as a network is being trained.
    open: Option<(File, File)>,
}

impl TrainingLog {
    /// The log in `directory`, with what earlier processes wrote; a last line without end is what a kill leaves, and is dropped.
    pub fn read(directory: &Path) -> Result<Self, Failure> {
        let path = directory.join(NAME);
        let text = match fs::read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            text => text.with_context(|| path.display().to_string()).or_bad_input()?,
        };
        let mut lines: Vec<EpochLine> = parse_lines(&path, whole_lines(&text))?;
        lines.sort_by_key(|line| (line.grasp, line.epoch));
        Ok(Self { directory: directory.to_owned(), lines, open: None })
    }

    /// The lines so far.
    pub fn lines(&self) -> &[EpochLine] {
        &self.lines
    }

    /// Refuses a log that lacks one of the first `epochs` epochs of a grasp, or has one twice.
    pub fn check(&self, grasp: usize, epochs: usize) -> Result<(), Failure> {
        let there = self.lines.iter().filter(|line| line.grasp == grasp).map(|line| line.epoch);
        let kept: Vec<usize> = there.take_while(|&epoch| epoch <= epochs).collect();
        if kept.iter().copied().eq(1..=epochs) {
            return Ok(());
        }
        let missing = (1..=epochs).find(|epoch| kept.iter().filter(|there| *there == epoch).count() != 1).unwrap_or(0);
        let count = kept.iter().filter(|&&there| there == missing).count();
        Err(Failure::bad_input(format!(
            "{}: {count} lines of epoch {missing} of grasp {grasp}, expected one of each epoch from 1 to {epochs}, as far as \
             {} was trained; put the log back, or begin anew in another directory",
            self.directory.join(NAME).display(),
            grasp_directory(&self.directory, grasp).display()
        )))
    }

    /// Begins, or goes on with, the lines of a grasp after `epochs` of them.
    pub fn begin(&mut self, grasp: usize, epochs: usize) -> Result<(), Failure> {
        self.check(grasp, epochs)?;
        self.lines.retain(|line| line.grasp != grasp || line.epoch <= epochs);
        self.write_lines()?;
        let (log, events) = (self.directory.join(NAME), grasp_directory(&self.directory, grasp).join(EVENTS));
        let own = self.lines.iter().filter(|line| line.grasp == grasp);
        let bytes: Vec<u8> = header().into_iter().chain(own.flat_map(EpochLine::event)).collect();
        write_whole(&events, |file| file.write_all(&bytes)).with_context(|| events.display().to_string())?;
        let append = |path: &Path| File::options().append(true).open(path).with_context(|| path.display().to_string());
        self.open = Some((append(&log)?, append(&events)?));
        Ok(())
    }

    /// Adds the line of an epoch to both files; once this returns, no crash loses it.
    pub fn add(&mut self, line: EpochLine) -> Result<(), Failure> {
        let Some((log, events)) = &mut self.open else { return Ok(()) };
        {
            let _writing = writing();
            let written = line.json().and_then(|text| log.write_all(text.as_bytes())).and_then(|()| log.sync_data());
            written
                .and_then(|()| events.write_all(&line.event()))
                .with_context(|| self.directory.join(NAME).display().to_string())?;
        }
        self.lines.push(line);
        Ok(())
    }

    /// Ends the lines of a grasp: all of them are in order of grasp and epoch then, whatever was trained again.
    pub fn end(&mut self) -> Result<(), Failure> {
        self.open = None;
        self.lines.sort_by_key(|line| (line.grasp, line.epoch));
        self.write_lines()
    }

    fn write_lines(&self) -> Result<(), Failure> {
        let path = self.directory.join(NAME);
        let all = self.lines.iter().map(EpochLine::json).collect::<io::Result<String>>()?;
        Ok(write_whole(&path, |file| file.write_all(all.as_bytes())).with_context(|| path.display().to_string())?)
    }
}

/// The losses beside a checkpoint; none if there is no `training.jsonl`.
pub fn curves(directory: &Path) -> Result<Vec<EpochLine>, Failure> {
    json_lines(&directory.join(NAME))
}
