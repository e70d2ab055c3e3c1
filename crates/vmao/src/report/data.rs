//! What a report holds. Every section may be empty; numbers that are not finite arrive in the page as gaps.

use super::pack;
use crate::results::GoalCounts;
use crate::rollouts::PackedRollout;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vmao_core::{observation::PointLabel, order::GraspOrder, outcome::FailureStage};

/// Everything that report.html shows, in the order of the page.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ReportData {
    /// The page's title.
    pub title: String,
    /// One sentence on what was done and what came out.
    pub summary: String,
    /// The success table.
    pub cells: Vec<Cell>,
    /// Contact maps of one scene each, for several latent codes.
    pub contact_maps: Vec<ContactMapFigure>,
    /// Recorded motions to play.
    pub rollouts: Vec<RolloutFigure>,
    /// What to say before the motions: how many are here of how many, and which.
    pub rollouts_note: String,
    /// The failure classes that occurred, and what would help.
    pub failure_classes: Vec<FailureClass>,
    /// Loss curves, one entry for each model.
    pub training: Vec<TrainingCurve>,
    /// How the label set grew.
    pub exploration: Option<ExplorationSummary>,
    /// What it takes to make the report again.
    pub provenance: Provenance,
}

/// One row of the success table: a cell of `results.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Catalogue name of the object.
    pub object: String,
    /// Names of the robots, by arm.
    pub robots: Vec<String>,
    /// The grasp order.
    pub order: GraspOrder,
    /// The contact model: `vmao`, `top1`, ….
    pub method: String,
    /// Trials run.
    pub trials: u64,
    /// Trials that met the goal.
    pub successes: u64,
    /// `successes / trials`.
    pub rate: f64,
    /// Wilson score interval of the rate at 95 %.
    pub wilson95: [f64; 2],
    /// Failed trials by the first stage that failed; absent stages count as zero.
    pub failures: BTreeMap<FailureStage, u64>,
    /// What was known of the goals of its trials; none in files of older versions.
    #[serde(default)]
    pub goals: Option<GoalCounts>,
    /// Success rate with every threshold scaled; empty if it was not computed.
    #[serde(default)]
    pub threshold_curve: Vec<ThresholdPoint>,
}

/// One point of the success-against-threshold curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ThresholdPoint {
    /// Factor on the position, angle and joint thresholds.
    pub scale: f64,
    /// Share of trials that succeed with these thresholds.
    pub rate: f64,
}

/// A scene's cloud and the contact maps that several latent codes give on it. The lists over points have equal length.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ContactMapFigure {
    /// A heading: which grasp of which scene.
    pub title: String,
    /// What to say before the standing caption.
    pub caption: String,
    /// Positions, world frame (m).
    #[serde(serialize_with = "pack::triples")]
    pub points: Vec<[f32; 3]>,
    /// Red, green, blue in [0, 1].
    #[serde(serialize_with = "pack::colors")]
    pub colors: Vec<[f32; 3]>,
    /// What each point lies on.
    #[serde(serialize_with = "pack::labels")]
    pub labels: Vec<PointLabel>,
    /// The maps; five for the figure of the paper.
    pub maps: Vec<LatentMap>,
}

/// One latent code and its contact map; the two channels are as long as the cloud.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct LatentMap {
    /// The latent code.
    pub latent: Vec<f32>,
    /// Probability of each point for finger 1.
    #[serde(serialize_with = "pack::floats")]
    pub finger1: Vec<f32>,
    /// Probability of each point for finger 2.
    #[serde(serialize_with = "pack::floats")]
    pub finger2: Vec<f32>,
    /// The points about which most probability lies, of those that the gripper spans: finger 1's and finger 2's.
    pub peaks: [usize; 2],
    /// The trial in which these points were grasped, if it was run.
    pub executed: Option<RolloutFigure>,
}

/// A motion to play.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct RolloutFigure {
    /// A heading.
    pub title: String,
    /// What to say before the standing caption.
    pub caption: String,
    /// Where the motion stands in the table, if it does; the page lists by it.
    pub trial: Option<TrialPlace>,
    /// The motion.
    pub rollout: PackedRollout,
}

/// Which trial of the table a motion is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TrialPlace {
    /// The grasp order.
    pub order: GraspOrder,
    /// The contact model.
    pub method: String,
    /// Number of the trial.
    pub index: u64,
    /// The first stage that failed; none for a success.
    pub failed: Option<FailureStage>,
}

/// A way in which trials of this run failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailureClass {
    /// The first stage that failed.
    pub stage: FailureStage,
    /// Trials of the table that failed so.
    pub count: u64,
    /// What it means.
    pub meaning: String,
    /// What would help.
    pub remedy: String,
    /// Position in `rollouts` of a trial that failed so, if one is there.
    pub example: Option<usize>,
}

/// The losses of one model.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct TrainingCurve {
    /// `vmao`, `top1`, ….
    pub model: String,
    /// One entry for each epoch, from the first.
    pub epochs: Vec<TrainingEpoch>,
}

/// The losses of one epoch; NaN where a model has no such loss.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrainingEpoch {
    /// Reconstruction loss on the training scenes.
    pub train_reconstruction: f64,
    /// Reconstruction loss on the validation scenes.
    pub validation_reconstruction: f64,
    /// Kullback-Leibler divergence of the posterior from the prior (nats).
    pub kl: f64,
    /// Weight of the divergence in the objective.
    pub beta: f64,
}

/// What exploration did.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ExplorationSummary {
    /// Trials run.
    pub trials: u64,
    /// Trials that succeeded and were kept.
    pub successes: u64,
    /// Demonstrated contact tuples that exploration began with.
    pub demonstrations: u64,
    /// Failed trials by the first stage that failed.
    pub failures: BTreeMap<FailureStage, u64>,
    /// The rounds, in order.
    pub rounds: Vec<ExplorationRound>,
}

/// One round of exploration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ExplorationRound {
    /// Trials of this round.
    pub trials: u64,
    /// Its successes.
    pub successes: u64,
}

/// Where a report comes from; empty strings are left out of the page.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Provenance {
    /// The command that made it.
    pub command: String,
    /// The program's version.
    pub version: String,
    /// The commit it was built from.
    pub commit: String,
    /// The run's seed.
    #[serde(serialize_with = "pack::whole")]
    pub seed: u64,
    /// SHA-256 of the explored data set.
    pub digest: String,
    /// The resolved configuration, TOML.
    pub config: String,
}
