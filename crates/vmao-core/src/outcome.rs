//! Outcomes of a trial: values that are recorded and counted, never errors.

use serde::{Deserialize, Serialize};

/// The first stage at which a trial failed; the names of `results.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailureStage {
    /// The fingers closed on nothing, or not with both pads on the asked part.
    NoContact,
    /// No gripper pose on these contacts has joint positions for grasp and goal.
    Unreachable,
    /// Gripper poses exist, but no collision-free way to them was found.
    NoPlan,
    /// An arm touched something it must not touch.
    Collision,
    /// The part was lost from the fingers after a hold.
    Slip,
    /// Everything held, but the object ended outside the thresholds.
    Threshold,
    /// The simulation did not come to its end: its steps were spent, or the simulator went astray.
    Timeout,
}

impl FailureStage {
    /// All stages, in the order of tables.
    pub const ALL: [Self; 7] =
        [Self::NoContact, Self::Unreachable, Self::NoPlan, Self::Collision, Self::Slip, Self::Threshold, Self::Timeout];

    /// The name used in `results.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoContact => "no-contact",
            Self::Unreachable => "unreachable",
            Self::NoPlan => "no-plan",
            Self::Collision => "collision",
            Self::Slip => "slip",
            Self::Threshold => "threshold",
            Self::Timeout => "timeout",
        }
    }
}

/// Whether the arms can hold all parts at the start of a trial and at its goal, whoever chooses the contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reachability {
    /// Every part has an arm of its own with joint positions for one grasp at the start and at the goal.
    Reachable,
    /// It is proven for every grasp looked at that no choice of arms has joint positions for all parts.
    Unreachable,
    /// Neither was found.
    #[default]
    Unknown,
}

/// How a trial ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrialOutcome {
    /// Every part and joint was within its threshold for the asked time.
    Success,
    /// It failed first at this stage.
    Failed(FailureStage),
}

impl TrialOutcome {
    /// Whether the goal was met.
    pub fn is_success(self) -> bool {
        self == Self::Success
    }

    /// `success`, or the name of the stage at which it failed.
    pub fn name(self) -> &'static str {
        match self {
            Self::Success => "success",
            Self::Failed(stage) => stage.name(),
        }
    }
}
