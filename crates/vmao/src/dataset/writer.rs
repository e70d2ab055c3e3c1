//! Rounds to disk: one process at a time, each round for good.

use super::{DatasetError, RoundFile, check, found_files, io_error, stored, write};
use crate::output::{hold, write_whole};
use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};
use vmao_core::record::TrialRecord;

/// A data set that this process alone writes, for as long as the value lives.
#[derive(Debug)]
pub struct DatasetWriter {
    directory: PathBuf,
    /// Held for its lock, which the system releases however the process ends.
    _lock: File,
}

impl DatasetWriter {
    /// Opens a data set for writing, made if need be; unfinished files of a killed run are removed.
    pub fn open(directory: &Path) -> Result<Self, DatasetError> {
        let held = hold(directory).map_err(|source| io_error(directory, source))?;
        let lock = held.ok_or_else(|| DatasetError::Locked { directory: directory.to_owned() })?;
        for entry in fs::read_dir(directory).map_err(|source| io_error(directory, source))? {
            let path = entry.map_err(|source| io_error(directory, source))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with(".trials-") && name.ends_with(".parquet.partial") {
                fs::remove_file(&path).map_err(|source| io_error(&path, source))?;
            }
        }
        Ok(Self { directory: directory.to_owned(), _lock: lock })
    }

    /// Where it writes.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// The files of finished trials, for a resumed run to go on from; there may be gaps.
    pub fn found_files(&self) -> Result<Vec<RoundFile>, DatasetError> {
        found_files(&self.directory)
    }

    /// Takes a damaged file out of the data set: renamed, so that nothing is lost that someone may want to look at.
    pub fn set_aside(&self, file: &RoundFile) -> Result<PathBuf, DatasetError> {
        let name = file.path.file_name().unwrap_or_default().to_string_lossy();
        let aside = file.path.with_file_name(format!(".{name}.damaged"));
        fs::rename(&file.path, &aside).map_err(|source| io_error(&file.path, source))?;
        Ok(aside)
    }

    /// Writes one round: consecutive trials of one seed. Once this returns, no crash loses them.
    pub fn write_round(&self, records: &[TrialRecord]) -> Result<RoundFile, DatasetError> {
        let refuse = |message: String| DatasetError::Rounds { directory: self.directory.clone(), message };
        let (Some(head), Some(tail)) = (records.first(), records.last()) else {
            return Err(refuse("a round of no trials, expected at least one".to_owned()));
        };
        let file = RoundFile::of(&self.directory, head.index, tail.index);
        if file.path.exists() {
            return Err(refuse(format!("{} is there already, expected a new round", file.path.display())));
        }
        for (row, record) in records.iter().enumerate() {
            if Some(record.index) != head.index.checked_add(row as u64) || record.seed != head.seed {
                let message =
                    format!("trial {} of seed {} in the round of {} to {}", record.index, record.seed, file.first, file.last);
                return Err(refuse(format!("{message}, expected consecutive trials of seed {}", head.seed)));
            }
            check::record(record).map_err(|invalid| invalid.at(&file.path, row))?;
        }
        let stored: Vec<TrialRecord> = records.iter().cloned().map(stored).collect();
        write_whole(&file.path, |out| write::round(out, &stored).map_err(io::Error::other))
            .map_err(|source| io_error(&file.path, source))?;
        Ok(file)
    }
}
