//! One object, robot and order explored by Algorithm 1 as shipped, with what every trial cost.

use crate::support;
use std::error::Error;
use std::sync::Mutex;
use vmao_core::catalogue::{INSTANCES, InstanceSet, item};
use vmao_core::order::GraspOrder;
use vmao_core::outcome::TrialOutcome;
use vmao_core::robots::RobotModel;
use vmao_sim::{LabelSet, Layout, Proposals, Scene, SceneConfig, explore_round, scene_of_trial};

const SEED: u64 = 0;
/// `[explore]` of configs/demo.toml.
const ROUND: u64 = 16;
const RADIUS: f64 = 0.008;

/// One trial: its outcome, its CPU time (s) and its simulated steps.
#[derive(Clone, Copy)]
pub(crate) struct Cost {
    pub(crate) outcome: TrialOutcome,
    pub(crate) seconds: f64,
    pub(crate) steps: u64,
}

/// Whether successes of a round are drawn from in the next.
#[derive(Clone, Copy, PartialEq, Eq)]
#[allow(dead_code, reason = "each example uses its own share of this module")]
pub(crate) enum Labels {
    Grow,
    /// Demonstrations only: the same contacts whatever the outcomes.
    Frozen,
}

/// Runs `trials` trials on one worker, the shipped configuration changed by `settings`; in the order of their numbers.
pub(crate) fn explore(
    object: &str,
    robot: &RobotModel,
    order: GraspOrder,
    trials: u64,
    growth: Labels,
    settings: &[(&str, &str)],
) -> Result<Vec<Cost>, Box<dyn Error>> {
    let (scene, config) = support::configuration_with(settings);
    let mut scenes = Vec::new();
    for instance in 0..INSTANCES {
        let item = item(object, InstanceSet::Train, instance).ok_or("no such object in the catalogue")?;
        let arms = item.object.parts.len();
        let layout = if arms > 2 { Layout::Ring } else { scene.layout };
        scenes.push(Scene::new(&SceneConfig { layout, ..scene.clone() }, vec![robot.clone(); arms], item)?);
    }
    let mut labels = LabelSet::demonstrated(&scenes);
    let proposals = Proposals { radius: RADIUS, orders: vec![order] };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut costs: Vec<Cost> = Vec::new();
    for first in (0..trials).step_by(ROUND as usize) {
        let seconds = Mutex::new(Vec::new());
        let round = pool.install(|| {
            let before = Mutex::new(support::thread_seconds());
            let done = |trial: &vmao_sim::Trial| {
                let now = support::thread_seconds();
                if let (Ok(mut before), Ok(mut seconds)) = (before.lock(), seconds.lock()) {
                    seconds.push((trial.record.index, now - *before));
                    *before = now;
                }
            };
            let indices: Vec<u64> = (first..(first + ROUND).min(trials)).collect();
            explore_round(&scenes, &config, &labels, &proposals, (SEED, &indices), &done)
        });
        let mut seconds = seconds.into_inner()?;
        seconds.sort_by_key(|&(index, _)| index);
        for (trial, (_, seconds)) in round.iter().zip(seconds) {
            if growth == Labels::Grow {
                labels.learn(scene_of_trial(SEED, trial.record.index, scenes.len()), &trial.record);
            }
            costs.push(Cost { outcome: trial.record.outcome, seconds, steps: trial.record.steps });
        }
    }
    Ok(costs)
}
