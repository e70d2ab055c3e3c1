//! What is kept of a trial: enough to learn from it and to run it again bit for bit.

use crate::{
    contact::{ArmId, Contact},
    geometry::Pose,
    object::{ObjectGoal, ObjectState},
    observation::Observation,
    order::GraspOrder,
    outcome::TrialOutcome,
};
use serde::{Deserialize, Serialize};

/// One grasp of a trial, recorded as it was about to be made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GraspRecord {
    /// Which arm.
    pub arm: ArmId,
    /// Where the fingers were asked to touch, part frame.
    pub contact: Contact,
    /// The scene before this grasp, world frame.
    pub observation: Observation,
    /// World pose of the part before this grasp.
    pub world_from_part: Pose,
    /// World pose of the gripper's tool frame at the grasp, once chosen.
    pub world_from_gripper: Option<Pose>,
}

/// One trial. (configuration, seed, `index`) and the contacts decide everything else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrialRecord {
    /// Number of the trial in its run.
    pub index: u64,
    /// Seed of the run.
    pub seed: u64,
    /// The grasp order.
    pub order: GraspOrder,
    /// The object after it settled on the table.
    pub start: ObjectState,
    /// Where it was to go.
    pub goal: ObjectGoal,
    /// The grasps that were tried, in order; shorter than the number of arms if the trial failed early.
    pub grasps: Vec<GraspRecord>,
    /// How it ended.
    pub outcome: TrialOutcome,
    /// Why, in words; empty for a success.
    pub detail: String,
    /// Simulated physics steps taken.
    pub steps: u64,
    /// The largest errors at the end: of part positions (m), part angles (rad), joints that turn (rad) and that slide (m).
    pub final_errors: [f64; 4],
}
