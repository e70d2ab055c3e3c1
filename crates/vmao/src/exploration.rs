//! Algorithm 1 on disk: rounds of trials that grow the label set, each kept for good before the next begins.

use crate::acceptance::{Acceptance, AcceptanceSummary};
use crate::config::Config;
use crate::dataset::{DatasetWriter, digest, read_shard};
use crate::failure::Failure;
use crate::output::progress_bar;
use crate::scenes::scenes;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use vmao_core::catalogue::InstanceSet;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_core::record::TrialRecord;
use vmao_sim::{LabelSet, Proposals, explore_round, scene_of_trial};

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
    /// Near-duplicates, failures and coverage.
    #[serde(flatten)]
    pub acceptance: AcceptanceSummary,
}

/// Explores into `directory` until there are enough successes or too many trials; goes on from what is there.
///
/// Runs in the current rayon pool. The records are the same for any number of threads and after any interruption.
pub fn explore(config: &Config, seed: u64, directory: &Path) -> Result<(Explored, Vec<TrialRecord>), Failure> {
    let scenes = scenes(config, InstanceSet::Train)?;
    let writer = DatasetWriter::open(directory)?;
    let (trial_config, settings) = (config.trial_config(), &config.explore);
    let proposals = Proposals { radius: settings.radius, orders: config.explored_orders() };
    let mut labels = LabelSet::demonstrated(&scenes);
    let mut acceptance = Acceptance::new(settings, &scenes);
    let learn = |acceptance: &mut Acceptance, labels: &mut LabelSet, round: &[TrialRecord]| {
        for record in round {
            let scene = scene_of_trial(seed, record.index, scenes.len());
            if acceptance.add(scene, record) {
                labels.learn(scene, record);
            }
        }
    };
    let mut records: Vec<TrialRecord> = Vec::new();
    for shard in writer.shards()? {
        let round = read_shard(&shard)?;
        learn(&mut acceptance, &mut labels, &round);
        records.extend(round);
    }
    let bar = progress_bar("explore", settings.successes);
    let found = |records: &[TrialRecord]| records.iter().filter(|record| record.outcome.is_success()).count() as u64;
    while found(&records) < settings.successes && (records.len() as u64) < settings.max_trials {
        let first = records.len() as u64;
        let last = (first + settings.round_size).min(settings.max_trials);
        let so_far = acceptance.words();
        let (before, tried) = (found(&records), AtomicU64::new(first));
        bar.set_position(before.min(settings.successes));
        let done = |trial: &vmao_sim::Trial| {
            let tried = tried.fetch_add(1, Ordering::Relaxed) + 1;
            if trial.record.outcome.is_success() {
                bar.inc(1);
            }
            bar.set_prefix(format!("{tried} trials, {:.0} % accepted, {so_far}", 100.0 * bar.position() as f64 / tried as f64));
        };
        let trials = explore_round(&scenes, &trial_config, &labels, &proposals, (seed, first..last), &done);
        let round: Vec<TrialRecord> = trials.into_iter().map(|trial| crate::dataset::stored(trial.record)).collect();
        writer.write_round(&round)?;
        learn(&mut acceptance, &mut labels, &round);
        records.extend(round);
    }
    bar.finish();
    let (trials, successes) = (records.len() as u64, found(&records));
    let explored = Explored {
        trials,
        successes,
        rate: successes as f64 / trials.max(1) as f64,
        digest: digest(&records),
        acceptance: acceptance.summary(),
    };
    Ok((explored, records))
}

/// Failed trials by the stage that failed first.
pub fn failures(records: &[TrialRecord]) -> BTreeMap<FailureStage, u64> {
    let mut counts: BTreeMap<FailureStage, u64> = FailureStage::ALL.into_iter().map(|stage| (stage, 0)).collect();
    for record in records {
        if let TrialOutcome::Failed(stage) = record.outcome {
            *counts.entry(stage).or_default() += 1;
        }
    }
    counts
}
