//! The data set: one Parquet file for each exploration round, and a digest that does not depend on how it was made.
//!
//! A file is there whole or not at all. Failed trials are kept without their observations. `docs/dataset.md` has the columns.

mod check;
mod columns;
mod digest;
mod read;
mod write;
mod writer;

pub use digest::{Digester, digest};
pub use read::read_round;
pub use writer::DatasetWriter;

use std::{
    fs, io,
    path::{Path, PathBuf},
};
use vmao_core::record::TrialRecord;

/// A data set that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The disk refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Another process writes there.
    #[error("{}: another process is writing this data set, expected to be alone", directory.display())]
    Locked {
        /// The data set.
        directory: PathBuf,
    },
    /// No Parquet file, or one whose bytes have changed.
    #[error("{}: {message}", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// What was found and expected.
        message: String,
    },
    /// A value that no trial can have.
    #[error("{}: row {row}, column {column}: {message}", file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Row, from zero.
        row: usize,
        /// Name of the column.
        column: &'static str,
        /// What was found and expected.
        message: String,
    },
    /// Rounds that do not follow one another, or files that are no rounds.
    #[error("{}: {message}", directory.display())]
    Rounds {
        /// The data set.
        directory: PathBuf,
        /// What was found and expected.
        message: String,
    },
}

/// A file of finished trials: `first..=last`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RoundFile {
    /// Index of its first trial.
    pub first: u64,
    /// Index of its last trial.
    pub last: u64,
    /// Its file.
    pub path: PathBuf,
}

impl RoundFile {
    /// The file of the trials `first..=last` in a data set; it need not be there.
    pub fn of(directory: &Path, first: u64, last: u64) -> Self {
        Self { first, last, path: directory.join(round_name(first, last)) }
    }
}

impl DatasetError {
    /// Whether what is wrong is the file's content, which running its trials again would mend.
    pub fn is_damage(&self) -> bool {
        matches!(self, Self::Damaged { .. } | Self::Value { .. })
    }
}

/// A record as it is stored: a failed trial keeps its contacts and poses, not what was seen.
pub fn stored(mut record: TrialRecord) -> TrialRecord {
    if !record.outcome.is_success() {
        for grasp in &mut record.grasps {
            grasp.observation = vmao_core::observation::Observation::default();
        }
    }
    record
}

/// The files of finished trials in a directory, in trial order; refuses overlaps and stray names.
pub fn found_files(directory: &Path) -> Result<Vec<RoundFile>, DatasetError> {
    let refuse = |message: String| DatasetError::Rounds { directory: directory.to_owned(), message };
    let mut files = Vec::new();
    for entry in fs::read_dir(directory).map_err(|source| io_error(directory, source))? {
        let path = entry.map_err(|source| io_error(directory, source))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !name.starts_with("trials-") || name == "trials.jsonl" {
            continue;
        }
        let range =
            name.strip_prefix("trials-").and_then(|name| name.strip_suffix(".parquet")).and_then(|name| name.split_once('-'));
        let numbers = range.and_then(|(first, last)| Some((first.parse().ok()?, last.parse().ok()?)));
        match numbers {
            Some((first, last)) if first <= last && name == round_name(first, last) => {
                files.push(RoundFile { first, last, path });
            }
            _ => return Err(refuse(format!("file `{}`, expected names like {}", name.escape_debug(), round_name(0, 15)))),
        }
    }
    files.sort_by_key(|file| file.first);
    for pair in files.windows(2) {
        if pair[1].first <= pair[0].last {
            let (before, after) = (round_name(pair[0].first, pair[0].last), round_name(pair[1].first, pair[1].last));
            return Err(refuse(format!("{before} and {after} overlap, expected each trial once")));
        }
    }
    Ok(files)
}

/// The rounds of a data set, in trial order from trial 0; refuses gaps, overlaps and stray names.
pub fn round_files(directory: &Path) -> Result<Vec<RoundFile>, DatasetError> {
    let files = found_files(directory)?;
    let mut next = 0;
    for file in &files {
        if file.first != next {
            let message = format!("trials {next} to {} are missing; `vmao explore --resume` runs them again", file.first - 1);
            return Err(DatasetError::Rounds { directory: directory.to_owned(), message });
        }
        next = file.last.saturating_add(1);
    }
    Ok(files)
}

fn round_name(first: u64, last: u64) -> String {
    format!("trials-{first:08}-{last:08}.parquet")
}

/// The rounds of a data set one by one, from one run: no more than one is held at a time.
pub fn rounds(directory: &Path) -> Result<impl Iterator<Item = Result<Vec<TrialRecord>, DatasetError>>, DatasetError> {
    let mut run_seed = None;
    Ok(round_files(directory)?.into_iter().map(move |file| {
        let round = read_round(&file)?;
        let seed = round.first().map(|record| record.seed);
        if let (Some(before), Some(after)) = (run_seed, seed)
            && before != after
        {
            let message = format!("seed {after}, expected {before} as in the files before");
            return Err(DatasetError::Damaged { file: file.path, message });
        }
        run_seed = run_seed.or(seed);
        Ok(round)
    }))
}

/// All records of a data set in trial order, from one run; empty if there are none.
pub fn load(directory: &Path) -> Result<Vec<TrialRecord>, DatasetError> {
    let mut records = Vec::new();
    for round in rounds(directory)? {
        records.extend(round?);
    }
    Ok(records)
}

/// The digest of a data set, read one round at a time.
pub fn digest_of(directory: &Path) -> Result<String, DatasetError> {
    let trials = round_files(directory)?.last().map_or(0, |file| file.last + 1);
    let mut digester = Digester::new(trials as usize);
    for round in rounds(directory)? {
        round?.iter().for_each(|record| digester.add(record));
    }
    Ok(digester.finish())
}

fn io_error(path: &Path, source: io::Error) -> DatasetError {
    DatasetError::Io { path: path.to_owned(), source }
}
