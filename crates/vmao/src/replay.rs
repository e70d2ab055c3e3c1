//! Recorded trials run again, and compared bit for bit with what was recorded.

use crate::config::Config;
use crate::dataset::{self, digest, stored};
use crate::evaluation::{Evaluation, TrialLine};
use crate::exploration::Explorer;
use crate::failure::{Failure, OrBadInput};
use crate::learning::json_lines;
use crate::provenance::RunInfo;
use crate::scenes::scenes;
use nalgebra::Point3;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use vmao_core::catalogue::InstanceSet;
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints};
use vmao_core::random::Stream;
use vmao_core::record::{GraspRecord, TrialRecord};
use vmao_sim::{Recording, Trial, run_trial, scene_of_trial};

/// Names the stream that draws the trials to be verified.
const VERIFIED: u64 = 1 << 36;
/// Letters of a value that a message shows.
const SHOWN: usize = 80;

/// The contacts of a record, as they were proposed.
///
/// Proposals are points of the cloud, whose coordinates are singles: rounding the recorded point of the part, put back into
/// the world, to single precision gives the very point that was proposed. Of a grasp that was looked for more than once (`vmao_sim`'s
/// `elsewhere`) the last contacts are recorded: wherever the part is elsewhere than recorded, nothing is proposed, so that the arms bring it on.
struct RecordedContacts<'a>(&'a TrialRecord);

impl ContactModel for RecordedContacts<'_> {
    fn propose(&self, query: &ContactQuery<'_>, _stream: &mut Stream) -> Vec<FingerPoints> {
        let proposed = |point: Point3<f64>| (query.world_from_part * point).map(|x| f64::from(x as f32));
        let here = |grasp: &&GraspRecord| grasp.world_from_part == *query.world_from_part;
        let grasp = self.0.grasps.get(query.grasp).filter(here);
        grasp.map(|grasp| grasp.contact.fingers.map(proposed)).into_iter().collect()
    }
}

/// Runs a trial of an exploration again from its record, the configuration and nothing else.
pub fn run_again(config: &Config, record: &TrialRecord, recording: Recording) -> Result<Trial, Failure> {
    let scenes = scenes(config, InstanceSet::Train)?;
    let scene = &scenes[scene_of_trial(record.seed, record.index, scenes.len())];
    let trial = (record.seed, record.index);
    Ok(run_trial(scene, &config.explored_trial_config(), &RecordedContacts(record), record.order, trial, recording))
}

/// The first column in which two records differ, with both values; none if they are equal bit for bit.
pub fn difference(recorded: &TrialRecord, again: &TrialRecord) -> Option<String> {
    let (recorded, again) = (stored(recorded.clone()), stored(again.clone()));
    let (before, now) = (columns(&recorded), columns(&again));
    let named = before.iter().zip(&now).find(|(before, now)| before != now);
    if let Some(((name, before), (_, now))) = named {
        return Some(differs(name, before, now));
    }
    (digest([&recorded]) != digest([&again])).then(|| "the records have different digests".to_owned())
}

fn differs(name: &str, recorded: &str, now: &str) -> String {
    let same = recorded.bytes().zip(now.bytes()).take_while(|(a, b)| a == b).count();
    // Long lists are shown from a little before the place where they part.
    let from = same.saturating_sub(SHOWN / 2);
    let cut = |text: &str| {
        let shown: String = text.chars().skip(from).take(SHOWN).collect();
        let dots = if from > 0 { "…" } else { "" };
        format!("{dots}{shown}")
    };
    format!("{name} was {}, is {} now", cut(recorded), cut(now))
}

/// Every value of a record by its column; the text of a number names its bits.
fn columns(record: &TrialRecord) -> Vec<(String, String)> {
    let TrialRecord { index, seed, order, start, goal, grasps, outcome, detail, steps, final_errors } = record;
    let mut columns: Vec<(String, String)> = Vec::new();
    let mut add = |name: &str, value: &dyn Debug| columns.push((name.to_owned(), format!("{value:?}")));
    add("index", index);
    add("seed", seed);
    add("order", order);
    add("start_parts", &start.world_from_parts);
    add("start_joints", &start.joint_positions);
    add("goal_root", &goal.root.0);
    add("goal_root_pose", &goal.world_from_root);
    add("goal_joints", &goal.joint_positions);
    for (number, grasp) in grasps.iter().enumerate() {
        let mut add = |name: &str, value: &dyn Debug| add(&format!("grasps[{number}].{name}"), value);
        add("part", &grasp.contact.part.0);
        add("fingers", &grasp.contact.fingers);
        add("world_from_part", &grasp.world_from_part);
        add("points", &grasp.observation.points);
        add("colors", &grasp.observation.colors);
        add("labels", &grasp.observation.labels);
        add("arm", &grasp.arm.0);
        add("world_from_gripper", &grasp.world_from_gripper);
    }
    add("grasps", &grasps.len());
    add("outcome", outcome);
    add("detail", detail);
    add("steps", steps);
    add("final_errors", final_errors);
    columns
}

/// How many recorded trials were run again, and how many of them are equal bit for bit.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Verified {
    /// Trials run again.
    pub checked: u64,
    /// Trials equal to their records.
    pub equal: u64,
    /// The first difference, in words.
    #[serde(skip)]
    pub difference: Option<String>,
}

impl Verified {
    fn count(&mut self, what: &str, difference: Option<String>) {
        self.checked += 1;
        match difference {
            None => self.equal += 1,
            Some(difference) => drop(self.difference.get_or_insert(format!("{what}: {difference}"))),
        }
    }
}

/// Runs `count` trials of a run again, drawn with `seed` from all that it recorded: explored, evaluated, or both.
///
/// An explored trial runs as the exploration ran it, its tuple drawn from the successes recorded before it.
pub fn verify(run: &Path, count: u64, seed: u64) -> Result<Verified, Failure> {
    let config = Config::load(Some(&run.join("config.toml")), &[]).or_bad_input()?;
    let info = RunInfo::load(run).or_bad_input()?;
    let data = data_directory(run)?;
    let explored = match &data {
        Some(directory) => dataset::round_files(directory).or_bad_input()?.last().map_or(0, |file| file.last + 1),
        None => 0,
    };
    let lines: Vec<TrialLine> = json_lines(&run.join("trials.jsonl"))?;
    let total = explored as usize + lines.len();
    if total == 0 {
        let message = format!("{}: no recorded trials, expected trials-*.parquet, data/ or trials.jsonl", run.display());
        return Err(Failure::bad_input(message));
    }
    let drawn = Stream::new(seed, &[VERIFIED]).permutation(total);
    let drawn: BTreeSet<usize> = drawn.into_iter().take(usize::try_from(count).unwrap_or(total)).collect();
    let mut verified = Verified { checked: 0, equal: 0, difference: None };
    if let Some(data) = data.filter(|_| drawn.iter().any(|&number| number < explored as usize)) {
        let indices = drawn.iter().map(|&number| number as u64).filter(|&index| index < explored).collect();
        verify_exploration(&config, &info, &data, &indices, &mut verified)?;
    }
    let chosen: Vec<&TrialLine> =
        lines.iter().enumerate().filter(|(i, _)| drawn.contains(&(explored as usize + i))).map(|(_, line)| line).collect();
    if !chosen.is_empty() {
        verify_evaluation(&config, &info, run, &chosen, &mut verified)?;
    }
    Ok(verified)
}

/// The data set of a run: the directory itself, or `data` in it.
pub fn data_directory(run: &Path) -> Result<Option<PathBuf>, Failure> {
    for directory in [run.to_owned(), run.join("data")] {
        if directory.is_dir() && !dataset::found_files(&directory).or_bad_input()?.is_empty() {
            return Ok(Some(directory));
        }
    }
    Ok(None)
}

fn verify_exploration(
    config: &Config,
    info: &RunInfo,
    data: &Path,
    chosen: &BTreeSet<u64>,
    verified: &mut Verified,
) -> Result<(), Failure> {
    let explorer = Explorer::new(config, info.seed)?;
    let mut labels = explorer.demonstrated();
    for round in dataset::rounds(data).or_bad_input()? {
        let round = round.or_bad_input()?;
        let indices: Vec<u64> = round.iter().map(|record| record.index).filter(|index| chosen.contains(index)).collect();
        let again = explorer.run(&labels, &indices, &|_| ());
        for again in again {
            if let Some(record) = round.iter().find(|record| record.index == again.index) {
                verified.count(&format!("{}: trial {}", data.display(), record.index), difference(record, &again));
            }
        }
        if chosen.last().is_none_or(|&last| round.last().is_none_or(|record| record.index >= last)) {
            break;
        }
        explorer.learn(&mut labels, &round);
    }
    Ok(())
}

fn verify_evaluation(
    config: &Config,
    info: &RunInfo,
    run: &Path,
    chosen: &[&TrialLine],
    verified: &mut Verified,
) -> Result<(), Failure> {
    let evaluation = Evaluation::of_run(run, config, info.seed)?;
    for line in chosen {
        let what =
            format!("{}: {} {} trial {}", run.join("trials.jsonl").display(), line.method.name(), line.order.name(), line.index);
        let trial = evaluation.trial(line.order, line.method, line.index, Recording::Off).ok_or_else(|| {
            let models = run.join("models").join(line.method.model().name());
            Failure::bad_input(format!("{what}: no networks in {}, expected those it ran with", models.display()))
        })?;
        let again = TrialLine::new(line.order, line.method, &trial);
        let (before, now) = (serde_json::to_value(line)?, serde_json::to_value(&again)?);
        verified.count(&what, json_difference(&before, &now));
    }
    Ok(())
}

fn json_difference(before: &Value, now: &Value) -> Option<String> {
    let (before, now) = (before.as_object()?, now.as_object()?);
    let text = |value: Option<&Value>| value.map_or_else(|| "nothing".to_owned(), Value::to_string);
    let name = before.keys().find(|name| text(before.get(*name)) != text(now.get(*name)))?;
    Some(differs(name, &text(before.get(name)), &text(now.get(name))))
}
