//! Runs the trials of the study and appends them to a file, in an order that no number of workers changes.

use crate::cells::Cell;
use crate::support;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::fs::{self, OpenOptions};
use std::io::Write;
use vmao_core::catalogue::InstanceSet;
use vmao_core::contact_model::FixedTuple;
use vmao_core::object::{ObjectGoal, ObjectState};
use vmao_core::outcome::TrialOutcome;
use vmao_sim::{MotionMeasures, Recording, run_trial, scene_of_trial};

/// Trials that are written together.
const CHUNK: u64 = 20;
/// The seed of the trials on sizes that criteria are chosen on; that of the others is one more.
const SEED: u64 = 40;

/// One trial with one root.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Line {
    pub(crate) index: u64,
    pub(crate) root: u16,
    pub(crate) outcome: TrialOutcome,
    pub(crate) detail: String,
    pub(crate) steps: u64,
    pub(crate) final_errors: [f64; 4],
    pub(crate) motion: MotionMeasures,
    pub(crate) start: ObjectState,
    pub(crate) goal: ObjectGoal,
}

/// The seed of the trials on these sizes.
pub(crate) fn seed(set: InstanceSet) -> u64 {
    match set {
        InstanceSet::Train => SEED,
        InstanceSet::HeldOut => SEED + 1,
    }
}

/// The lines of a file of trials; none if there is no such file. A last line that was not finished is left out.
pub(crate) fn lines(path: &str) -> Result<Vec<Line>, Box<dyn Error>> {
    let text = if fs::exists(path)? { fs::read_to_string(path)? } else { String::new() };
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    whole.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
}

/// The file of a cell's trials on these sizes.
pub(crate) fn file_of(directory: &str, cell: &Cell, set: InstanceSet) -> String {
    let set = match set {
        InstanceSet::Train => "train",
        InstanceSet::HeldOut => "held-out",
    };
    format!("{directory}/{}-{set}.jsonl", cell.name())
}

/// Runs what is missing of the first `trials` of this cell with every root.
pub(crate) fn run(directory: &str, cell: &Cell, set: InstanceSet, trials: u64) -> Result<(), Box<dyn Error>> {
    let (physics, config) = support::configuration();
    let path = file_of(directory, cell, set);
    fs::create_dir_all(directory)?;
    let mut file = OpenOptions::new().create(true).append(true).open(&path)?;
    // What a killed run left half written goes.
    let written = fs::read(&path)?;
    file.set_len(written.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end as u64 + 1))?;
    let done = lines(&path)?;
    let scenes = cell.roots()?.iter().map(|root| cell.scenes(&physics, set, root)).collect::<Result<Vec<_>, _>>()?;
    for first in (0..trials).step_by(CHUNK as usize) {
        let indices = first..trials.min(first + CHUNK);
        let mut jobs: Vec<(usize, u64)> = indices.flat_map(|index| (0..scenes.len()).map(move |root| (root, index))).collect();
        jobs.retain(|&(root, index)| !done.iter().any(|line| (usize::from(line.root), line.index) == (root, index)));
        let line = |&(root, index): &(usize, u64)| {
            let scene = &scenes[root][scene_of_trial(seed(set), index, scenes[root].len())];
            let tuple = scene.demonstrations[index as usize % scene.demonstrations.len()].clone();
            let trial = run_trial(scene, &config, &FixedTuple(tuple), cell.order, (seed(set), index), Recording::Off);
            let (record, motion, root) = (trial.record, trial.motion, root as u16);
            let (outcome, detail, steps, final_errors) = (record.outcome, record.detail, record.steps, record.final_errors);
            Line { index, root, outcome, detail, steps, final_errors, motion, start: record.start, goal: record.goal }
        };
        let new: Vec<Line> = jobs.par_iter().map(line).collect();
        file.write_all(new.iter().map(text).collect::<Result<String, _>>()?.as_bytes())?;
    }
    Ok(())
}

fn text(line: &Line) -> Result<String, serde_json::Error> {
    serde_json::to_string(line).map(|line| line + "\n")
}
