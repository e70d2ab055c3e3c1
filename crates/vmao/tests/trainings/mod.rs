//! Small trainings through the real program, on a data set made of toy scenes: no physics is needed to have something to learn.
#![allow(dead_code, reason = "each test binary uses its own share of this module")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[path = "../../../vmao-net/tests/bar_world/mod.rs"]
mod bar_world;

use crate::explorations::vmao;
use bar_world::scenes;
use nalgebra::Point3;
use std::{collections::BTreeMap, fs, path::Path, process::Command};
use vmao::dataset::DatasetWriter;
use vmao_core::{
    contact::{ArmId, Contact, PartId},
    geometry::translation,
    object::{ObjectGoal, ObjectState},
    observation::{Observation, PointLabel},
    order::GraspOrder,
    outcome::{FailureStage, TrialOutcome},
    record::{GraspRecord, TrialRecord},
};

/// Every third trial fails, so that examples and trials are numbered differently.
pub(crate) fn records(count: u64) -> Vec<TrialRecord> {
    let world = translation(0.0, 0.0, 0.0);
    let record = |index: u64| {
        let outcome = if index % 3 == 1 { TrialOutcome::Failed(FailureStage::NoPlan) } else { TrialOutcome::Success };
        let grasp = |part: u16| {
            let seen = scenes(5 + u64::from(part), index + 1).swap_remove(index as usize).example;
            GraspRecord {
                arm: ArmId(part),
                contact: Contact { part: PartId(part), fingers: seen.contacts.map(|p| Point3::from(p.map(f64::from))) },
                observation: Observation {
                    labels: vec![PointLabel::Table; seen.points.len()],
                    points: seen.points,
                    colors: seen.colors,
                },
                world_from_part: world,
                world_from_gripper: None,
            }
        };
        TrialRecord {
            index,
            seed: 4,
            order: GraspOrder::Sequential,
            start: ObjectState { world_from_parts: vec![world; 2], joint_positions: vec![0.5] },
            goal: ObjectGoal { root: PartId(0), world_from_root: world, joint_positions: vec![1.0] },
            grasps: vec![grasp(0), grasp(1)],
            outcome,
            detail: String::new(),
            steps: 1000,
            final_errors: [0.001; 4],
        }
    };
    (0..count).map(record).collect()
}

/// A data set of so many trials in `directory`.
pub(crate) fn data(directory: &Path, trials: u64) {
    DatasetWriter::open(directory).unwrap().write_round(&records(trials)).unwrap();
}

/// `vmao train` on the data set `data` beside `out`, with few points and small batches.
pub(crate) fn train(out: &Path, model: &str, epochs: u32, more: &[&str]) -> Command {
    let mut command = vmao(&["train", "--json", "--workers", "2", "--model", model, "--data"]);
    command.arg(out.parent().unwrap().join("data")).arg("--out").arg(out);
    command.args(["--set", "network.points=200", "--set", "train.batch_size=3", "--set", &format!("train.epochs={epochs}")]);
    command.args(["--set", "train.validation_fraction=0.25"]).args(more);
    command
}

/// What a training left, but for what says when and where it ran: paths and bytes.
pub(crate) fn left(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    fn walk(root: &Path, folder: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
            if path.is_dir() {
                walk(root, &path, files);
            } else if !["run.json", ".lock"].contains(&&*name) {
                files.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    let mut files = BTreeMap::new();
    walk(directory, directory, &mut files);
    files
}
