//! One exploration shared by several processes that see one file system: `vmao explore --shard i/n`.
//!
//! Every round is cut into n parts. A shard runs its own part, keeps it in a directory of its own, and reads the parts of the
//! others from theirs, because the label set of the next round needs them all. A part that does not come is run by those who
//! wait for it: any process gets the same records. Waiting decides who runs a trial, never how it ends.

use crate::dataset::{DatasetError, DatasetWriter, RoundFile, read_round};
use crate::exploration::{finished, of_seed};
use crate::failure::{Failure, OrBadInput};
use crate::output::log;
use crate::provenance::RunInfo;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Display};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::thread;
use std::time::{Duration, Instant};
use vmao_core::random::Stream;
use vmao_core::record::TrialRecord;

/// Most shards of one run.
const MAX_SHARDS: u64 = 4096;
/// Time between two looks at the others' directories.
const GLANCE: Duration = Duration::from_millis(50);
/// Others are waited for this many times as long as one's own part took, and at least for the time of some glances.
const PATIENCE: u32 = 2;

/// Which part of every round a process runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    index: u64,
    count: u64,
}

impl FromStr for Share {
    type Err = String;

    /// `i/n`; i counts from 0 or from 1, as job arrays do: n/n is 0/n.
    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || format!("expected i/n with 0 ≤ i ≤ n and 1 ≤ n ≤ {MAX_SHARDS}, such as 0/4");
        let (index, count) = text.split_once('/').ok_or_else(expected)?;
        match (index.parse::<u64>(), count.parse::<u64>()) {
            (Ok(index), Ok(count)) if (1..=MAX_SHARDS).contains(&count) && index <= count => {
                Ok(Self { index: index % count, count })
            }
            _ => Err(expected()),
        }
    }
}

impl Display for Share {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.index, self.count)
    }
}

impl Share {
    /// Where this shard keeps its trials, within the directory that all shards are given.
    pub fn directory(self, place: &Path) -> PathBuf {
        place.join(format!("shard-{}-of-{}", self.index, self.count))
    }

    /// The shard whose directory this is, by its name.
    pub fn of_directory(directory: &Path) -> Option<Self> {
        let name = directory.file_name()?.to_str()?;
        let (index, count) = name.strip_prefix("shard-")?.split_once("-of-")?;
        let share: Self = format!("{index}/{count}").parse().ok()?;
        (share.directory(Path::new("")).to_str() == Some(name)).then_some(share)
    }

    /// All shards of the same run.
    pub fn all(self) -> impl Iterator<Item = Self> {
        (0..self.count).map(move |index| Self { index, ..self })
    }

    /// Its part of a round; empty for some if there are more shards than trials.
    pub fn part(self, round: &Range<u64>) -> Range<u64> {
        let length = u128::from(round.end - round.start);
        let cut = |index: u64| round.start + (length * u128::from(index) / u128::from(self.count)) as u64;
        cut(self.index)..cut(self.index + 1)
    }
}

/// The rounds of a run as one of its shards sees them.
pub(crate) struct Shards<'a> {
    writer: &'a DatasetWriter,
    share: Share,
    place: PathBuf,
    info: RunInfo,
    /// Shards whose run was found to be this run.
    known: RefCell<BTreeSet<u64>>,
    /// Shards that are not waited for until they deliver again.
    absent: RefCell<BTreeSet<u64>>,
}

impl<'a> Shards<'a> {
    /// The shard `share` of the run `info`, all of whose shards are in `place`.
    pub(crate) fn new(writer: &'a DatasetWriter, share: Share, place: &Path, info: &RunInfo) -> Self {
        let (known, absent) = (RefCell::default(), RefCell::default());
        Self { writer, share, place: place.to_owned(), info: info.clone(), known, absent }
    }

    /// The directory of all shards.
    pub(crate) fn place(&self) -> &Path {
        &self.place
    }

    /// Which shard this is.
    pub(crate) fn share(&self) -> Share {
        self.share
    }

    /// The records of a round: this shard's part is run, the others' are waited for, what does not come is run too.
    pub(crate) fn obtain(
        &self,
        round: &Range<u64>,
        run: &dyn Fn(&[u64]) -> Vec<TrialRecord>,
    ) -> Result<Vec<TrialRecord>, Failure> {
        let mut pieces = BTreeMap::new();
        self.gather(round, &mut pieces)?;
        let own = self.share.part(round);
        let begun = Instant::now();
        let missing: Vec<u64> = own.clone().filter(|index| !pieces.contains_key(index)).collect();
        if !missing.is_empty() {
            self.keep(run(&missing), own.clone().count(), &mut pieces)?;
        }
        let patience = (begun.elapsed() * PATIENCE).max(GLANCE * 4);
        let waiting = Instant::now();
        loop {
            self.gather(round, &mut pieces)?;
            let missing: Vec<u64> = round.clone().filter(|index| !pieces.contains_key(index)).collect();
            if missing.is_empty() {
                return Ok(pieces.into_values().collect());
            }
            let overdue = waiting.elapsed() >= patience;
            let mut mine: Vec<u64> = missing.into_iter().filter(|&index| overdue || self.is_absent(round, index)).collect();
            if mine.is_empty() {
                thread::sleep(GLANCE);
                continue;
            }
            self.note_absent(round, &mine);
            // Those who wait take the trials in orders of their own, so that few run the same one.
            mine.sort_by_key(|&index| Stream::new(self.share.index, &[index]).bits());
            mine.truncate(rayon::current_num_threads());
            mine.sort_unstable();
            self.keep(run(&mine), 0, &mut pieces)?;
        }
    }

    /// The records of a round that was obtained before.
    pub(crate) fn read(&self, round: &Range<u64>) -> Result<Vec<TrialRecord>, Failure> {
        let mut pieces = BTreeMap::new();
        self.gather(round, &mut pieces)?;
        if pieces.len() as u64 == round.end - round.start {
            return Ok(pieces.into_values().collect());
        }
        let (place, last) = (self.place.display(), round.end - 1);
        Err(Failure::Work(anyhow::anyhow!("{place}: trials {} to {last} were there and are not any more", round.start)))
    }

    /// Keeps records: in one file if they are a whole part of `whole` trials, else each in its own, where others look for it.
    fn keep(&self, records: Vec<TrialRecord>, whole: usize, pieces: &mut BTreeMap<u64, TrialRecord>) -> Result<(), Failure> {
        for file in records.chunks(if records.len() == whole { whole } else { 1 }) {
            self.writer.write_round(file)?;
        }
        pieces.extend(records.into_iter().map(|record| (record.index, record)));
        Ok(())
    }

    /// Adds to `pieces` what any shard has of a round.
    fn gather(&self, round: &Range<u64>, pieces: &mut BTreeMap<u64, TrialRecord>) -> Result<(), Failure> {
        for share in self.share.all() {
            let part = share.part(round);
            if part.is_empty() || part.clone().all(|index| pieces.contains_key(&index)) {
                continue;
            }
            if let Some(records) = self.look(share, part.start, part.end - 1)? {
                self.absent.borrow_mut().remove(&share.index);
                pieces.extend(records.into_iter().map(|record| (record.index, record)));
            }
        }
        for index in round.clone() {
            for share in self.share.all() {
                if !pieces.contains_key(&index)
                    && let Some(records) = self.look(share, index, index)?
                {
                    pieces.extend(records.into_iter().map(|record| (record.index, record)));
                }
            }
        }
        Ok(())
    }

    /// The trials `first..=last` from the directory of `share`, if they are there.
    fn look(&self, share: Share, first: u64, last: u64) -> Result<Option<Vec<TrialRecord>>, Failure> {
        let directory = share.directory(&self.place);
        let file = RoundFile::of(&directory, first, last);
        if share == self.share {
            return finished(self.writer, self.info.seed, &file);
        }
        if !file.path.exists() {
            return Ok(None);
        }
        if !self.known.borrow().contains(&share.index) {
            self.info.check_same_run(&directory).or_bad_input()?;
            self.known.borrow_mut().insert(share.index);
        }
        match read_round(&file) {
            Ok(records) => of_seed(records, self.info.seed, &file).map(Some),
            Err(error) if error.is_damage() => Err(DamagedShard { error, share }.into()),
            Err(error) => Err(error.into()),
        }
    }

    /// Whether trial `index` belongs to a shard that is not waited for.
    fn is_absent(&self, round: &Range<u64>, index: u64) -> bool {
        self.owner(round, index).is_some_and(|owner| self.absent.borrow().contains(&owner))
    }

    fn owner(&self, round: &Range<u64>, index: u64) -> Option<u64> {
        self.share.all().find(|share| share.part(round).contains(&index)).map(|share| share.index)
    }

    fn note_absent(&self, round: &Range<u64>, indices: &[u64]) {
        for owner in indices.iter().filter_map(|&index| self.owner(round, index)) {
            if self.absent.borrow_mut().insert(owner) {
                let share = Share { index: owner, ..self.share };
                log(&format!(
                    "shard {share} has not delivered its part of trials {} to {}: run here",
                    round.start,
                    round.end - 1
                ));
            }
        }
    }
}

/// A damaged file of another shard, which only that shard may mend.
#[derive(Debug, thiserror::Error)]
#[error("{error}; `vmao explore --shard {share} --resume` repairs it")]
struct DamagedShard {
    error: DatasetError,
    share: Share,
}
