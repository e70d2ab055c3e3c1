//! Reference successes: many tuples tried from one start to one goal, in scenes that no training saw.
//!
//! Each scene has Algorithm 1 for itself. Its trials are a data set of their own, whose `index` counts the tries; start, goal
//! and all else come from the scene's number, so that every try meets the same scene.

use crate::config::Config;
use crate::dataset::{DatasetWriter, RoundFile, read_round, stored};
use crate::exploration::finished;
use crate::failure::{Failure, OrBadInput};
use crate::interruption::keeps;
use crate::output::progress_bar;
use crate::scenes::scenes;
use crate::scoring::PeakRules;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use vmao_core::catalogue::InstanceSet;
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints, JitteredTuple};
use vmao_core::random::Stream;
use vmao_core::record::TrialRecord;
use vmao_sim::{LabelSet, Recording, Scene, Trial, run_trial, scene_of_trial};

/// Names the streams of this module: none of its scenes was explored or evaluated.
const REFERENCE: u64 = 1 << 36;
const TUPLE: u64 = REFERENCE + 1;
const JITTER: u64 = REFERENCE + 2;

/// The sizes that scenes are drawn from, in the order of tables.
pub const SETS: [InstanceSet; 2] = [InstanceSet::Train, InstanceSet::HeldOut];

/// The name of a set of sizes in files and tables.
pub fn set_name(set: InstanceSet) -> &'static str {
    match set {
        InstanceSet::Train => "train",
        InstanceSet::HeldOut => "held-out",
    }
}

/// One scene that was never trained on: which sizes it is from, and its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Sizes explored in training, from a new start; or sizes kept back.
    pub set: InstanceSet,
    /// Number of the scene in its set.
    pub index: u64,
}

impl Place {
    fn directory(self, reference: &Path) -> PathBuf {
        reference.join(format!("{}-{:03}", set_name(self.set), self.index))
    }

    fn stream(self, seed: u64, label: u64, further: &[u64]) -> Stream {
        Stream::new(seed, &[&[label, self.set as u64, self.index], further].concat())
    }

    /// Seed and index of all trials in this scene.
    pub fn trial(self, seed: u64) -> (u64, u64) {
        let mut stream = Stream::new(seed, &[REFERENCE, self.set as u64]);
        (u64::from(stream.bits()) << 32 | u64::from(stream.bits()), self.index)
    }
}

/// The tries of one place, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceScene {
    /// Where.
    pub place: Place,
    /// Successes with what was seen, failures without; `index` counts the tries.
    pub records: Vec<TrialRecord>,
}

/// The compiled scenes that reference trials and the execution of samples take place in.
#[derive(Debug)]
pub struct Grounds<'a> {
    config: &'a Config,
    seed: u64,
    scenes: [Vec<Scene>; 2],
}

impl<'a> Grounds<'a> {
    /// Both sets of sizes of the configured object.
    pub fn new(config: &'a Config, seed: u64) -> Result<Self, Failure> {
        Ok(Self { config, seed, scenes: [scenes(config, SETS[0])?, scenes(config, SETS[1])?] })
    }

    /// The seed of the run.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The configuration of the run.
    pub fn config(&self) -> &Config {
        self.config
    }

    /// What peaks are in a place: any of its grippers spans them.
    pub(crate) fn peak_rules(&self, place: Place) -> PeakRules {
        let spans = self.scene(place).robots.iter().map(|robot| robot.gripper.span());
        let span = spans.fold([f64::INFINITY, 0.0], |[low, high], [least, most]| [least.min(low), most.max(high)]);
        PeakRules { radius: self.config.evaluate.peak_radius, distance: self.config.score.distance, span }
    }

    /// The scene of a place.
    pub fn scene(&self, place: Place) -> &Scene {
        let sizes = &self.scenes[place.set as usize];
        let (seed, index) = place.trial(self.seed);
        &sizes[scene_of_trial(seed, index, sizes.len())]
    }

    /// A trial of `model` from this place's start to its goal.
    pub fn trial(&self, place: Place, model: &dyn ContactModel) -> Trial {
        let (config, order) = (self.config.trial_config(), self.config.trial.order);
        run_trial(self.scene(place), &config, model, order, place.trial(self.seed), Recording::Off)
    }

    fn attempt(&self, place: Place, labels: &LabelSet, attempt: u64) -> TrialRecord {
        let tuple = labels.draw(0, &mut place.stream(self.seed, TUPLE, &[attempt]));
        let jittered = JitteredTuple { tuple, radius: self.config.explore.radius };
        let record = self.trial(place, &Try { jittered, place, seed: self.seed, attempt }).record;
        TrialRecord { index: attempt, ..record }
    }
}

/// A jittered tuple with draws of its own: the trial's would be the same in every try.
struct Try {
    jittered: JitteredTuple,
    place: Place,
    seed: u64,
    attempt: u64,
}

impl ContactModel for Try {
    fn propose(&self, query: &ContactQuery<'_>, _stream: &mut Stream) -> Vec<FingerPoints> {
        self.jittered.propose(query, &mut self.place.stream(self.seed, JITTER, &[self.attempt, query.grasp as u64]))
    }
}

/// The places of a reference with so many scenes of each set.
pub fn places(scenes: u64) -> Vec<Place> {
    SETS.into_iter().flat_map(|set| (0..scenes).map(move |index| Place { set, index })).collect()
}

/// Tries `score.tries` tuples in each of the `score.scenes` scenes of both sets, in the current rayon pool.
///
/// Goes on from the rounds that are in `directory`. The records are the same for any number of threads.
pub fn explore_reference(grounds: &Grounds<'_>, directory: &Path) -> Result<Vec<ReferenceScene>, Failure> {
    let settings = &grounds.config.score;
    let places = places(settings.scenes);
    let bar = progress_bar("reference", places.len() as u64 * settings.tries);
    keeps(format!("finished rounds are kept in {}; the same command with --resume goes on", directory.display()));
    let (tried, accepted) = (AtomicU64::new(0), AtomicU64::new(0));
    let explore = |&place: &Place| {
        let writer = DatasetWriter::open(&place.directory(directory))?;
        let mut labels = LabelSet::demonstrated(std::slice::from_ref(grounds.scene(place)));
        let mut records = Vec::new();
        let size = grounds.config.explore.round_size.min(settings.tries);
        for first in (0..settings.tries).step_by(size as usize) {
            let indices = first..(first + size).min(settings.tries);
            let file = RoundFile::of(writer.directory(), indices.start, indices.end - 1);
            let round = match finished(&writer, place.trial(grounds.seed).0, &file)? {
                Some(round) => round,
                None => {
                    let round: Vec<TrialRecord> =
                        indices.clone().map(|attempt| stored(grounds.attempt(place, &labels, attempt))).collect();
                    writer.write_round(&round)?;
                    round
                }
            };
            let successes = round.iter().filter(|record| record.outcome.is_success()).count() as u64;
            round.iter().for_each(|record| labels.learn(0, record));
            let tried = tried.fetch_add(round.len() as u64, Ordering::Relaxed) + round.len() as u64;
            let accepted = accepted.fetch_add(successes, Ordering::Relaxed) + successes;
            bar.set_prefix(format!("{accepted} of {tried} succeeded"));
            bar.inc(round.len() as u64);
            records.extend(round);
        }
        Ok(ReferenceScene { place, records })
    };
    let found = places.par_iter().map(explore).collect::<Result<Vec<_>, Failure>>()?;
    bar.finish();
    Ok(found)
}

/// The records of a finished reference, by place; a missing round is refused with its name.
pub fn load_reference(grounds: &Grounds<'_>, directory: &Path) -> Result<Vec<ReferenceScene>, Failure> {
    let settings = &grounds.config.score;
    let size = grounds.config.explore.round_size.min(settings.tries);
    let mut found = Vec::new();
    for place in places(settings.scenes) {
        let folder = place.directory(directory);
        let mut records = Vec::new();
        for first in (0..settings.tries).step_by(size as usize) {
            let file = RoundFile::of(&folder, first, (first + size).min(settings.tries) - 1);
            if !file.path.is_file() {
                let message = "missing, expected a round of `vmao reference`; --resume finishes it";
                return Err(Failure::bad_input(format!("{}: {message}", file.path.display())));
            }
            let seed = place.trial(grounds.seed).0;
            records.extend(crate::exploration::of_seed(read_round(&file).or_bad_input()?, seed, &file)?);
        }
        found.push(ReferenceScene { place, records });
    }
    Ok(found)
}
