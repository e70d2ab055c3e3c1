//! Algorithm 1 on disk: rounds of trials that grow the label set, each kept for good before the next begins.

use crate::config::Config;
use crate::dataset::{DatasetWriter, RoundFile, digest_of, read_round, stored};
use crate::failure::{Failure, OrBadInput};
use crate::output::{log, progress_bar};
use crate::scenes::scenes;
use serde::Serialize;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use vmao_core::catalogue::InstanceSet;
use vmao_core::record::TrialRecord;
use vmao_sim::{LabelSet, Proposals, Trial, explore_round, scene_of_trial};

/// What an exploration came to; the JSON answer of `explore`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Explored {
    /// Trials run.
    pub trials: u64,
    /// Trials that succeeded: new members of the label set.
    pub successes: u64,
    /// Successes over trials.
    pub rate: f64,
    /// SHA-256 of the records in canonical order.
    pub digest: String,
}

/// Explores until there are enough successes or too many trials. Goes on from what is there; what is damaged runs again.
///
/// Runs in the current rayon pool. The records are the same for any number of threads and after any interruption.
/// Holds one round and the label set in memory, not the data set.
pub fn explore(config: &Config, seed: u64, writer: &DatasetWriter) -> Result<Explored, Failure> {
    let scenes = scenes(config, InstanceSet::Train)?;
    let (trial_config, settings) = (config.trial_config(), &config.explore);
    let proposals = Proposals { radius: settings.radius, orders: config.explored_orders() };
    check_rounds(config, writer)?;
    let mut labels = LabelSet::demonstrated(&scenes);
    let (mut trials, mut successes) = (0, 0);
    let bar = progress_bar("explore", settings.successes);
    while let Some(indices) = next_round(config, trials, successes) {
        let tried = AtomicU64::new(trials);
        bar.set_position(successes.min(settings.successes));
        let done = |trial: &Trial| {
            let tried = tried.fetch_add(1, Ordering::Relaxed) + 1;
            if trial.record.outcome.is_success() {
                bar.inc(1);
            }
            bar.set_prefix(format!("{tried} trials, {:.0} % accepted", 100.0 * bar.position() as f64 / tried as f64));
        };
        let round = match finished(writer, seed, &indices)? {
            Some(round) => round,
            None => {
                let trials = explore_round(&scenes, &trial_config, &labels, &proposals, (seed, indices.clone()), &done);
                let round: Vec<TrialRecord> = trials.into_iter().map(|trial| stored(trial.record)).collect();
                writer.write_round(&round)?;
                round
            }
        };
        for record in &round {
            labels.learn(scene_of_trial(seed, record.index, scenes.len()), record);
            successes += u64::from(record.outcome.is_success());
        }
        trials = indices.end;
    }
    bar.finish();
    let digest = digest_of(writer.directory())?;
    Ok(Explored { trials, successes, rate: successes as f64 / trials.max(1) as f64, digest })
}

/// The trials of the round after the first `trials` with `successes` among them; none if the run is over.
pub fn next_round(config: &Config, trials: u64, successes: u64) -> Option<Range<u64>> {
    let settings = &config.explore;
    let over = successes >= settings.successes || trials >= settings.max_trials;
    (!over).then(|| trials..trials.saturating_add(settings.round_size).min(settings.max_trials))
}

/// Refuses files that are no rounds of this run: another program or another run has written here.
fn check_rounds(config: &Config, writer: &DatasetWriter) -> Result<(), Failure> {
    let size = config.explore.round_size;
    for file in writer.found_files().or_bad_input()? {
        let first = file.first / size * size;
        let last = first.saturating_add(size).min(config.explore.max_trials).saturating_sub(1);
        if (file.first, file.last) != (first, last) {
            let message = format!("{}: expected a round of this run, such as trials {first} to {last}", file.path.display());
            return Err(Failure::bad_input(message));
        }
    }
    Ok(())
}

/// The records of a round that was finished before; a damaged file is named and set aside, and its trials run again.
fn finished(writer: &DatasetWriter, seed: u64, indices: &Range<u64>) -> Result<Option<Vec<TrialRecord>>, Failure> {
    let file = RoundFile::of(writer.directory(), indices.start, indices.end - 1);
    if !file.path.exists() {
        return Ok(None);
    }
    match read_round(&file) {
        Ok(round) => match round.iter().find(|record| record.seed != seed) {
            None => Ok(Some(round)),
            Some(other) => {
                let message = format!("{}: trials of seed {}, expected {seed}", file.path.display(), other.seed);
                Err(Failure::bad_input(message))
            }
        },
        Err(error) if error.is_damage() => {
            let aside = writer.set_aside(&file)?;
            let (first, last) = (file.first, file.last);
            log(&format!("{error}\nrepair: trials {first} to {last} run again; the damaged file is kept as {}", aside.display()));
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}
