//! The one trial loop. Exploration, evaluation, baselines, demo and figures differ in the contact model only.

use crate::attempt::Attempt;
use crate::cameras::CameraConfig;
use crate::execution::MotionConfig;
use crate::failure::Failure;
use crate::grasping::GraspConfig;
use crate::measures::MotionMeasures;
use crate::profile::{self, Stage};
use crate::scene::Scene;
use crate::targets::Targets;
use crate::task::{GoalConfig, GoalReach, StartConfig, Thresholds};
use serde::{Deserialize, Serialize};
use vmao_core::contact_model::ContactModel;
use vmao_core::order::GraspOrder;
use vmao_core::osc::OscGains;
use vmao_core::record::TrialRecord;
use vmao_core::rollout::Rollout;

/// Everything that decides a trial besides the scene, the contact model, the order, the seed and the index.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialConfig {
    /// Where objects start.
    pub start: StartConfig,
    /// Where they shall go.
    pub goal: GoalConfig,
    /// When a goal counts as met.
    pub thresholds: Thresholds,
    /// The cameras.
    pub cameras: CameraConfig,
    /// How grasps are chosen.
    pub grasp: GraspConfig,
    /// How fast things move.
    pub motion: MotionConfig,
    /// The controller's gains.
    pub osc: OscGains,
    /// A trial in which a part turns further in a hand that holds it is no success (rad).
    pub most_turn: f64,
}

/// Whether a trial's motion is kept for the viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recording {
    /// Only the record.
    Off,
    /// The motion too.
    On,
    /// What the controllers were asked for too.
    Targets,
}

/// What a trial leaves behind.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What is stored.
    pub record: TrialRecord,
    /// Smallest factor on all thresholds at which the trial would have succeeded; infinite if it failed before its end.
    pub threshold_factor: f64,
    /// How the motions of the object went with all parts held; zeros if it never came to that.
    pub motion: MotionMeasures,
    /// What was known of its goal before anything moved.
    pub reach: GoalReach,
    /// Its motion, if asked for.
    pub rollout: Option<Rollout>,
    /// What the controllers were asked for, if it was to be kept.
    pub targets: Option<Targets>,
}

/// Runs trial `index` of the run with `seed`: look, choose contacts, grasp, plan, move, until all parts are at the goal.
///
/// A pure function of its arguments. Failures are outcomes: the record says at which stage and why.
pub fn run_trial(
    scene: &Scene,
    config: &TrialConfig,
    model: &dyn ContactModel,
    order: GraspOrder,
    (seed, index): (u64, u64),
    recording: Recording,
) -> Trial {
    profile::time(Stage::Rest, || {
        let mut attempt = Attempt::begin(scene, config, order, (seed, index), recording);
        let outcome = manipulate(&mut attempt, model, order);
        attempt.finish(outcome)
    })
}

fn manipulate(attempt: &mut Attempt<'_>, model: &dyn ContactModel, order: GraspOrder) -> Result<(), Failure> {
    attempt.settled()?;
    for step in order.steps(attempt.part_count()) {
        let (grasps, approach) = attempt.find_grasps(model, step)?;
        let grasps = attempt.approach(grasps, approach)?;
        attempt.take_hold(&grasps)?;
        attempt.move_object()?;
    }
    attempt.goal_held()
}
