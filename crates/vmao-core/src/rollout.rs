//! A recorded motion: what a viewer needs to play a trial back.

use crate::{geometry::Pose, observation::PointLabel, shape::Solid};
use serde::{Deserialize, Serialize};

/// One rigid thing that moves as a whole: a link, a finger, a part, the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RolloutBody {
    /// Its name in the scene.
    pub name: String,
    /// What it belongs to.
    pub label: PointLabel,
    /// Its solids, each in the body's own frame.
    pub solids: Vec<Solid>,
}

/// A stage of the algorithm that began at `time`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RolloutEvent {
    /// Simulated time (s).
    pub time: f64,
    /// What began, in words a person reads: "grasp handle-a with arm 0".
    pub label: String,
}

/// A trial's motion, sampled at a fixed interval.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Rollout {
    /// What moves.
    pub bodies: Vec<RolloutBody>,
    /// Simulated time between frames (s).
    pub frame_seconds: f64,
    /// World pose of every body: `frames[frame][body]`.
    pub frames: Vec<Vec<Pose>>,
    /// The parts at the goal, for the green ghost: a pose for each body whose label is a part, in the order of `bodies`.
    pub goal: Vec<Pose>,
    /// The stages, in time order.
    pub events: Vec<RolloutEvent>,
    /// Points where fingers were asked to touch, world frame at the moment of the grasp: (time, arm, finger 1, finger 2).
    pub contacts: Vec<(f64, u16, [f64; 3], [f64; 3])>,
    /// The outcome in words: "success", or the failed stage and why.
    pub outcome: String,
}
