//! `vmao dataset merge`: what the shards of one exploration kept, as the data set of a single run.

use crate::config::Config;
use crate::dataset::{DatasetWriter, Digester, RoundFile, digest, found_files, read_round};
use crate::exploration::{Explored, Explorer, finished, next_round, of_seed};
use crate::failure::{Failure, OrBadInput};
use crate::output::log;
use crate::provenance::RunInfo;
use crate::sharing::Share;
use anyhow::Context;
use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use vmao_core::record::TrialRecord;

/// Missing stretches of trials that a message lists.
const LISTED: usize = 8;

/// Files with trials of one run, from any number of directories.
#[derive(Debug)]
pub struct Pieces {
    /// The run's configuration.
    pub config: Config,
    /// The run.
    pub info: RunInfo,
    files: Vec<RoundFile>,
    shards: Vec<Share>,
    trials: u64,
}

impl Pieces {
    /// What is in these directories, each that of a shard or one with shards in it. Refuses what belongs to another run.
    pub fn find(directories: &[PathBuf]) -> Result<Self, Failure> {
        let mut places = Vec::new();
        for directory in directories {
            let inside = shard_directories(directory)?;
            places.extend(if inside.is_empty() { vec![directory.clone()] } else { inside });
        }
        let Some(first) = places.first() else { return Err(Failure::bad_input("no directories, expected data sets to merge")) };
        let info = RunInfo::load(first).or_bad_input()?;
        let config = Config::load(Some(&first.join("config.toml")), &[]).or_bad_input()?;
        if config.sha256()? != info.config_sha256 {
            let message = format!("{}: not the configuration that run.json names", first.join("config.toml").display());
            return Err(Failure::bad_input(message));
        }
        let (mut files, mut shards) = (Vec::new(), Vec::new());
        for place in &places {
            info.check_same_run(place).or_bad_input()?;
            let commit = RunInfo::load(place).or_bad_input()?.commit;
            if commit != info.commit {
                let place = place.display();
                log(&format!("warning: {place}: from commit {commit}, {} from {}", first.display(), info.commit));
            }
            files.extend(found_files(place).or_bad_input()?);
            shards.extend(Share::of_directory(place));
        }
        let trials = files.iter().map(|file| file.last.saturating_add(1)).max().unwrap_or(0);
        Ok(Self { config, info, files, shards, trials })
    }

    /// Writes the rounds of the single run. Every trial must be there, and the run must have come to its end.
    pub fn merge(&self, writer: &DatasetWriter) -> Result<Explored, Failure> {
        let explorer = Explorer::new(&self.config, self.info.seed)?;
        let mut learned = explorer.demonstrated();
        let mut kept = Vec::new();
        let (mut trials, mut successes) = (0, 0);
        while let Some(indices) = explorer.next_round(trials, successes) {
            let round = self.round(&indices)?;
            let file = RoundFile::of(writer.directory(), indices.start, indices.end - 1);
            match finished(writer, self.info.seed, &file)? {
                None => drop(writer.write_round(&round)?),
                Some(there) if digest(&there) == digest(&round) => {}
                Some(_) => return Err(Failure::bad_input(format!("{}: holds other trials", file.path.display()))),
            }
            successes += round.iter().filter(|record| record.outcome.is_success()).count() as u64;
            trials = indices.end;
            explorer.learn(&mut learned, &round);
            kept.push(file);
        }
        let mut digester = Digester::new(trials as usize);
        for file in &kept {
            read_round(file)?.iter().for_each(|record| digester.add(record));
        }
        let explored = learned.explored(digester.finish());
        explored.save(writer.directory())?;
        Ok(explored)
    }

    /// The records of a round; trials that several shards ran must be the same.
    fn round(&self, indices: &Range<u64>) -> Result<Vec<TrialRecord>, Failure> {
        let mut pieces: BTreeMap<u64, (TrialRecord, &Path)> = BTreeMap::new();
        for file in self.files.iter().filter(|file| file.first < indices.end && file.last >= indices.start) {
            let records = of_seed(read_round(file).map_err(|error| self.damaged(error, file))?, self.info.seed, file)?;
            for record in records.into_iter().filter(|record| indices.contains(&record.index)) {
                let index = record.index;
                match pieces.get(&index) {
                    Some((other, _)) if digest([other]) == digest([&record]) => {}
                    Some((_, other)) => {
                        let (here, other) = (file.path.display(), other.display());
                        return Err(Failure::bad_input(format!("{here}: trial {index} differs from that of {other}")));
                    }
                    None => drop(pieces.insert(index, (record, &file.path))),
                }
            }
        }
        if pieces.len() as u64 == indices.end - indices.start {
            return Ok(pieces.into_values().map(|(record, _)| record).collect());
        }
        Err(self.missing(indices))
    }

    fn damaged(&self, error: crate::dataset::DatasetError, file: &RoundFile) -> Failure {
        let owner = file.path.parent().and_then(Share::of_directory);
        let who = owner.map_or_else(String::new, |share| format!(" --shard {share}"));
        match error.is_damage() {
            true => Failure::bad_input(format!("{error}; `vmao explore{who} --resume` repairs it")),
            false => error.into(),
        }
    }

    /// Which trials are missing, and whose they are.
    fn missing(&self, round: &Range<u64>) -> Failure {
        let Some(share) = self.shards.first() else {
            let message =
                format!("trials {} to {} are not all there; `vmao explore --resume` runs them", round.start, round.end - 1);
            return Failure::bad_input(message);
        };
        let there = |index: u64| self.files.iter().any(|file| (file.first..=file.last).contains(&index));
        let mut stretches = Vec::new();
        // Later rounds count too, so that one look says all; at least the round that cannot be put together.
        let mut round = round.clone();
        while stretches.len() < LISTED && (stretches.is_empty() || round.start < self.trials) {
            for share in share.all() {
                let part = share.part(&round);
                let missing: Vec<u64> = part.filter(|&index| !there(index)).collect();
                if let (Some(first), Some(last)) = (missing.first(), missing.last()) {
                    stretches.push((share, *first, *last));
                }
            }
            match next_round(&self.config, round.end, 0) {
                Some(next) => round = next,
                None => break,
            }
        }
        let text = stretches.iter().map(|(share, first, last)| format!("trials {first} to {last} of shard {share}"));
        let text = text.collect::<Vec<_>>().join(", ");
        let more = if stretches.len() >= LISTED { " and others" } else { "" };
        Failure::bad_input(format!("missing: {text}{more}; `vmao explore --shard I/N --resume` goes on with one or all of them"))
    }
}

/// The directories of shards in `place`, in order.
fn shard_directories(place: &Path) -> Result<Vec<PathBuf>, Failure> {
    let context = || place.display().to_string();
    let mut found = Vec::new();
    for entry in fs::read_dir(place).with_context(context).or_bad_input()? {
        let path = entry.with_context(context)?.path();
        if path.is_dir() && Share::of_directory(&path).is_some() {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
