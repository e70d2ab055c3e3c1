//! Algorithm 1 on disk: rounds of trials that grow the label set, each kept for good before the next begins.

use crate::acceptance::{Acceptance, AcceptanceSummary, RoundSummary};
use crate::config::Config;
use crate::dataset::{DatasetWriter, Digester, RoundFile, read_round, stored};
use crate::failure::{Failure, OrBadInput};
use crate::interruption::keeps;
use crate::output::{log, progress_bar, write_whole};
use crate::provenance::RunInfo;
use crate::scenes::scenes;
use crate::sharing::{Shards, Share};
use anyhow::Context;
use serde::Serialize;
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use vmao_core::catalogue::InstanceSet;
use vmao_core::record::TrialRecord;
use vmao_sim::{LabelSet, Proposals, Scene, Trial, TrialConfig, explore_round, scene_of_trial};

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
    /// What there was after each round; in the file only.
    #[serde(skip)]
    pub rounds: Vec<RoundSummary>,
}

impl Explored {
    /// Writes `exploration.json` beside the rounds: the answer, and what there was after each round.
    pub fn save(&self, directory: &Path) -> Result<(), Failure> {
        #[derive(Serialize)]
        struct Stored<'a> {
            #[serde(flatten)]
            explored: &'a Explored,
            rounds: &'a [RoundSummary],
        }
        let path = directory.join("exploration.json");
        let text = serde_json::to_string_pretty(&Stored { explored: self, rounds: &self.rounds })?;
        Ok(write_whole(&path, |file| writeln!(file, "{text}")).with_context(|| path.display().to_string())?)
    }
}

/// What earlier trials have taught.
#[derive(Debug)]
pub struct Learned {
    labels: LabelSet,
    acceptance: Acceptance,
}

impl Learned {
    /// Near-duplicates, failures and coverage so far.
    pub fn acceptance(&self) -> AcceptanceSummary {
        self.acceptance.summary()
    }

    /// What it came to; `digest` is that of the records learned from.
    pub fn explored(&self, digest: String) -> Explored {
        let rounds = self.acceptance.rounds().to_vec();
        let (trials, successes) = rounds.last().map_or((0, 0), |round| (round.trials, round.successes));
        let (rate, acceptance) = (successes as f64 / trials.max(1) as f64, self.acceptance.summary());
        Explored { trials, successes, rate, digest, acceptance, rounds }
    }
}

/// What the trials of a run take place in: all that (seed, index, label set) do not decide.
#[derive(Debug)]
pub struct Explorer<'a> {
    config: &'a Config,
    seed: u64,
    scenes: Vec<Scene>,
    trial_config: TrialConfig,
    proposals: Proposals,
}

impl<'a> Explorer<'a> {
    /// The exploration of this configuration and seed.
    pub fn new(config: &'a Config, seed: u64) -> Result<Self, Failure> {
        let proposals = Proposals { radius: config.explore.radius, orders: config.explored_orders() };
        Ok(Self {
            config,
            seed,
            scenes: scenes(config, InstanceSet::Train)?,
            trial_config: config.explored_trial_config(),
            proposals,
        })
    }

    /// Names of the object's parts.
    pub fn part_names(&self) -> Vec<String> {
        let object = self.scenes.first().map(|scene| &scene.object);
        object.map(|object| object.parts.iter().map(|part| part.name.clone()).collect()).unwrap_or_default()
    }

    /// T ← D.
    pub fn demonstrated(&self) -> Learned {
        let acceptance = Acceptance::new(&self.config.explore, &self.scenes);
        Learned { labels: LabelSet::demonstrated(&self.scenes), acceptance }
    }

    /// T ← T ∪ {s′} for the successes of a round, unless s′ is a near-duplicate that is to be left out.
    pub fn learn(&self, learned: &mut Learned, round: &[TrialRecord]) {
        for record in round {
            let scene = scene_of_trial(self.seed, record.index, self.scenes.len());
            if learned.acceptance.add(scene, record) {
                learned.labels.learn(scene, record);
            }
        }
        learned.acceptance.end_round();
    }

    /// Runs these trials of one round in the current rayon pool, as they are stored.
    pub fn run(&self, learned: &Learned, indices: &[u64], done: &(dyn Fn(&Trial) + Sync)) -> Vec<TrialRecord> {
        let (labels, proposals) = (&learned.labels, &self.proposals);
        let trials = explore_round(&self.scenes, &self.trial_config, labels, proposals, (self.seed, indices), done);
        trials.into_iter().map(|trial| stored(trial.record)).collect()
    }

    /// The trials of the round after the first `trials` with `successes` among them; none if the run is over.
    pub fn next_round(&self, trials: u64, successes: u64) -> Option<Range<u64>> {
        next_round(self.config, trials, successes)
    }
}

/// The trials of the round after the first `trials` with `successes` among them; none if the run is over.
pub fn next_round(config: &Config, trials: u64, successes: u64) -> Option<Range<u64>> {
    let settings = &config.explore;
    let over = successes >= settings.successes || trials >= settings.max_trials;
    (!over).then(|| trials..trials.saturating_add(settings.round_size).min(settings.max_trials))
}

/// Explores until there are enough successes or too many trials. Goes on from what is there; what is damaged runs again.
///
/// Runs in the current rayon pool. The records are the same for any number of threads, after any interruption, and for
/// any number of processes that share the work in the directories of one place. Holds one round and the label set in memory, not the data set.
pub fn explore(
    config: &Config,
    info: &RunInfo,
    writer: &DatasetWriter,
    shared: Option<(Share, &Path)>,
) -> Result<Explored, Failure> {
    let explorer = Explorer::new(config, info.seed)?;
    let shards = shared.map(|(share, place)| Shards::new(writer, share, place, info));
    let rounds = Rounds { writer, seed: info.seed, shards };
    if shared.is_none() {
        check_rounds(config, writer)?;
    }
    let mut learned = explorer.demonstrated();
    let (mut trials, mut successes) = (0, 0);
    let bar = progress_bar("explore", config.explore.successes);
    while let Some(indices) = explorer.next_round(trials, successes) {
        keeps(rounds.kept(trials, successes));
        bar.set_position(successes.min(config.explore.successes));
        let (tried, so_far) = (AtomicU64::new(trials), learned.acceptance.words());
        let done = |trial: &Trial| {
            let tried = tried.fetch_add(1, Ordering::Relaxed) + 1;
            if trial.record.outcome.is_success() {
                bar.inc(1);
            }
            bar.set_prefix(format!("{tried} trials, {:.0} % accepted, {so_far}", 100.0 * bar.position() as f64 / tried as f64));
        };
        let round = rounds.obtain(&indices, &|indices| explorer.run(&learned, indices, &done))?;
        explorer.learn(&mut learned, &round);
        successes += round.iter().filter(|record| record.outcome.is_success()).count() as u64;
        trials = indices.end;
    }
    bar.finish();
    let mut digester = Digester::new(trials as usize);
    for first in (0..trials).step_by(config.explore.round_size.min(trials).max(1) as usize) {
        let indices = first..first.saturating_add(config.explore.round_size).min(trials);
        rounds.read(&indices)?.iter().for_each(|record| digester.add(record));
    }
    let explored = learned.explored(digester.finish());
    explored.save(writer.directory())?;
    Ok(explored)
}

/// Where finished rounds are: all in one directory, or each round shared out over several.
struct Rounds<'a> {
    writer: &'a DatasetWriter,
    seed: u64,
    shards: Option<Shards<'a>>,
}

impl Rounds<'_> {
    /// The records of a round: those that were finished before, and the others run and kept.
    fn obtain(&self, indices: &Range<u64>, run: &dyn Fn(&[u64]) -> Vec<TrialRecord>) -> Result<Vec<TrialRecord>, Failure> {
        if let Some(shards) = &self.shards {
            return shards.obtain(indices, run);
        }
        let file = RoundFile::of(self.writer.directory(), indices.start, indices.end - 1);
        if let Some(round) = finished(self.writer, self.seed, &file)? {
            return Ok(round);
        }
        let round = run(&indices.clone().collect::<Vec<u64>>());
        self.writer.write_round(&round)?;
        Ok(round)
    }

    /// The records of a round that was obtained before.
    fn read(&self, indices: &Range<u64>) -> Result<Vec<TrialRecord>, Failure> {
        match &self.shards {
            Some(shards) => shards.read(indices),
            None => Ok(read_round(&RoundFile::of(self.writer.directory(), indices.start, indices.end - 1))?),
        }
    }

    /// What an interruption leaves, and how to go on.
    fn kept(&self, trials: u64, successes: u64) -> String {
        let (directory, seed) = (self.writer.directory().display(), self.seed);
        let config = self.writer.directory().join("config.toml");
        let (out, shard) = match &self.shards {
            Some(shards) => (shards.place().display().to_string(), format!(" --shard {}", shards.share())),
            None => (directory.to_string(), String::new()),
        };
        let go_on = format!("vmao explore --config {} --seed {seed}{shard} --resume --out {out}", config.display());
        format!("{trials} trials with {successes} successes are kept in {out}; `{go_on}` goes on")
    }
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

/// The records of a file that was finished before; a damaged one is named and set aside, and its trials run again.
pub(crate) fn finished(writer: &DatasetWriter, seed: u64, file: &RoundFile) -> Result<Option<Vec<TrialRecord>>, Failure> {
    if !file.path.exists() {
        return Ok(None);
    }
    match read_round(file) {
        Ok(round) => of_seed(round, seed, file).map(Some),
        Err(error) if error.is_damage() => {
            let aside = writer.set_aside(file)?;
            let (first, last) = (file.first, file.last);
            log(&format!("{error}\nrepair: trials {first} to {last} run again; the damaged file is kept as {}", aside.display()));
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// The records, if they are of the run with this seed.
pub(crate) fn of_seed(round: Vec<TrialRecord>, seed: u64, file: &RoundFile) -> Result<Vec<TrialRecord>, Failure> {
    match round.iter().find(|record| record.seed != seed) {
        None => Ok(round),
        Some(other) => {
            Err(Failure::bad_input(format!("{}: trials of seed {}, expected {seed}", file.path.display(), other.seed)))
        }
    }
}
