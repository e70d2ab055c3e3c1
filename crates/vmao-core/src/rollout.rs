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

/// Where an arm is asked to touch a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RolloutContact {
    /// Simulated time at which it was asked (s).
    pub time: f64,
    /// The arm.
    pub arm: u16,
    /// The part.
    pub part: u16,
    /// Points for finger 1 and finger 2, world frame at that time (m).
    pub fingers: [[f64; 3]; 2],
}

/// What one pad of a gripper does to the object, mean over the time since the frame before.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PadForce {
    /// Middle of the contact, weighted by force, world frame (m); zeros without contact.
    pub point: [f64; 3],
    /// Force on the object, friction included, world frame (N).
    pub force: [f64; 3],
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
    /// Where fingers were asked to touch.
    pub contacts: Vec<RolloutContact>,
    /// The forces of both pads of every arm on the object: `forces[frame][arm][pad]`; as long as `frames`.
    pub forces: Vec<Vec<[PadForce; 2]>>,
    /// The outcome in words: "success", or the failed stage and why.
    pub outcome: String,
}
