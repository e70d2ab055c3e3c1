//! The data set: one Parquet file ("shard") for each exploration round, and a digest that does not depend on how it was made.
//!
//! A shard is there whole or not at all. Failed trials are kept without their observations. `docs/dataset.md` has the columns.

mod check;
mod columns;
mod digest;
mod read;
mod write;

pub use digest::digest;
pub use read::read_shard;

use crate::output::write_whole;
use std::{
    fs::{self, File, TryLockError},
    io,
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
        /// The shard.
        file: PathBuf,
        /// What was found and expected.
        message: String,
    },
    /// A value that no trial can have.
    #[error("{}: row {row}, column {column}: {message}", file.display())]
    Value {
        /// The shard.
        file: PathBuf,
        /// Row, from zero.
        row: usize,
        /// Name of the column.
        column: &'static str,
        /// What was found and expected.
        message: String,
    },
    /// Shards that do not follow one another, or files that are no shards.
    #[error("{}: {message}", directory.display())]
    Shards {
        /// The data set.
        directory: PathBuf,
        /// What was found and expected.
        message: String,
    },
}

/// A finished round: the trials `first..=last` and their file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shard {
    /// Index of its first trial.
    pub first: u64,
    /// Index of its last trial.
    pub last: u64,
    /// Its file.
    pub path: PathBuf,
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

/// The finished shards of a data set, in trial order; refuses gaps, overlaps and stray names.
pub fn shards(directory: &Path) -> Result<Vec<Shard>, DatasetError> {
    let refuse = |message: String| DatasetError::Shards { directory: directory.to_owned(), message };
    let mut shards = Vec::new();
    for entry in fs::read_dir(directory).map_err(|source| io_error(directory, source))? {
        let path = entry.map_err(|source| io_error(directory, source))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !name.starts_with("trials-") {
            continue;
        }
        let range =
            name.strip_prefix("trials-").and_then(|name| name.strip_suffix(".parquet")).and_then(|name| name.split_once('-'));
        let numbers = range.and_then(|(first, last)| Some((first.parse().ok()?, last.parse().ok()?)));
        match numbers {
            Some((first, last)) if first <= last && name == shard_name(first, last) => shards.push(Shard { first, last, path }),
            _ => return Err(refuse(format!("file `{}`, expected names like {}", name.escape_debug(), shard_name(0, 15)))),
        }
    }
    shards.sort_by_key(|shard| shard.first);
    for pair in shards.windows(2) {
        if pair[1].first <= pair[0].last {
            let (before, after) = (shard_name(pair[0].first, pair[0].last), shard_name(pair[1].first, pair[1].last));
            return Err(refuse(format!("{before} and {after} overlap, expected each trial once")));
        }
        if pair[1].first - 1 > pair[0].last {
            return Err(refuse(format!("trials {} to {} are missing", pair[0].last + 1, pair[1].first - 1)));
        }
    }
    Ok(shards)
}

fn shard_name(first: u64, last: u64) -> String {
    format!("trials-{first:08}-{last:08}.parquet")
}

/// All records of a data set in trial order, from one run; empty if there are none.
pub fn load(directory: &Path) -> Result<Vec<TrialRecord>, DatasetError> {
    let mut records: Vec<TrialRecord> = Vec::new();
    for shard in shards(directory)? {
        let more = read_shard(&shard)?;
        if let (Some(before), Some(after)) = (records.last(), more.first())
            && before.seed != after.seed
        {
            let message = format!("seed {}, expected {} as in the shards before", after.seed, before.seed);
            return Err(DatasetError::Damaged { file: shard.path, message });
        }
        records.extend(more);
    }
    Ok(records)
}

/// A data set that this process alone writes, for as long as the value lives.
#[derive(Debug)]
pub struct DatasetWriter {
    directory: PathBuf,
    /// Held for its lock, which the system releases however the process ends.
    _lock: File,
}

impl DatasetWriter {
    /// Opens a data set for writing, made if need be; unfinished shards of a killed run are removed.
    pub fn open(directory: &Path) -> Result<Self, DatasetError> {
        fs::create_dir_all(directory).map_err(|source| io_error(directory, source))?;
        let path = directory.join(".lock");
        let lock = File::options().create(true).append(true).open(&path).map_err(|source| io_error(&path, source))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => DatasetError::Locked { directory: directory.to_owned() },
            TryLockError::Error(source) => io_error(&path, source),
        })?;
        for entry in fs::read_dir(directory).map_err(|source| io_error(directory, source))? {
            let path = entry.map_err(|source| io_error(directory, source))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with(".trials-") && name.ends_with(".parquet.partial") {
                fs::remove_file(&path).map_err(|source| io_error(&path, source))?;
            }
        }
        Ok(Self { directory: directory.to_owned(), _lock: lock })
    }

    /// The finished rounds, for a resumed run to go on from.
    pub fn shards(&self) -> Result<Vec<Shard>, DatasetError> {
        shards(&self.directory)
    }

    /// Writes one round: consecutive trials of one seed. Once this returns, no crash loses them.
    pub fn write_round(&self, records: &[TrialRecord]) -> Result<Shard, DatasetError> {
        let refuse = |message: String| DatasetError::Shards { directory: self.directory.clone(), message };
        let (Some(head), Some(tail)) = (records.first(), records.last()) else {
            return Err(refuse("a round of no trials, expected at least one".to_owned()));
        };
        let (first, last) = (head.index, tail.index);
        let path = self.directory.join(shard_name(first, last));
        if path.exists() {
            return Err(refuse(format!("{} is there already, expected a new round", shard_name(first, last))));
        }
        for (row, record) in records.iter().enumerate() {
            if Some(record.index) != first.checked_add(row as u64) || record.seed != head.seed {
                let message = format!("trial {} of seed {} in the round of {first} to {last}", record.index, record.seed);
                return Err(refuse(format!("{message}, expected consecutive trials of seed {}", head.seed)));
            }
            check::record(record).map_err(|invalid| invalid.at(&path, row))?;
        }
        let stored: Vec<TrialRecord> = records.iter().cloned().map(stored).collect();
        write_whole(&path, |file| write::shard(file, &stored).map_err(io::Error::other))
            .map_err(|source| io_error(&path, source))?;
        Ok(Shard { first, last, path })
    }
}

fn io_error(path: &Path, source: io::Error) -> DatasetError {
    DatasetError::Io { path: path.to_owned(), source }
}
