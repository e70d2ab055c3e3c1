//! What all tests of this crate run on: one configuration, the pliers, two Pandas, and contact models of their own.
#![allow(dead_code, reason = "each test binary uses its own share of this module")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints, FixedTuple};
use vmao_core::order::GraspOrder;
use vmao_core::osc::OscGains;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_core::random::Stream;
use vmao_core::robots::{DEFAULT_SLOT, panda, sawyer};
use vmao_sim::{
    CameraConfig, Friction, GoalConfig, GraspConfig, Layout, MotionConfig, Recording, Scene, SceneConfig, StartConfig,
    Thresholds, Trial, TrialConfig, run_trial,
};

/// Seed of all trials of these tests.
pub(crate) const SEED: u64 = 1;

/// The sections of the shipped configuration that a trial needs.
#[derive(serde::Deserialize)]
struct Shipped {
    scene: SceneConfig,
    start: StartConfig,
    goal: GoalConfig,
    thresholds: Thresholds,
    cameras: CameraConfig,
    grasp: GraspConfig,
    motion: MotionConfig,
    osc: OscGains,
}

/// The scene's and the trials' configuration: the shipped one.
pub(crate) fn configuration() -> (SceneConfig, TrialConfig) {
    configuration_with(&[])
}

/// The same with some keys (`section.key`) set to other values, as TOML writes them.
pub(crate) fn configuration_with(settings: &[(&str, &str)]) -> (SceneConfig, TrialConfig) {
    let mut shipped: toml::Table = include_str!("../../../../configs/demo.toml").parse().unwrap();
    for (path, value) in settings {
        let (section, key) = path.split_once('.').unwrap();
        let value: toml::Table = format!("{key} = {value}").parse().unwrap();
        shipped[section].as_table_mut().unwrap().extend(value);
    }
    let Shipped { scene, start, goal, thresholds, cameras, grasp, motion, osc } = shipped.try_into().unwrap();
    (scene, TrialConfig { start, goal, thresholds, cameras, grasp, motion, osc, most_turn: f64::INFINITY })
}

/// Two Pandas and the pliers in their `instance`-th training size.
pub(crate) fn scene_with(config: &SceneConfig, instance: u16) -> Scene {
    Scene::new(config, vec![panda(), panda()], item("pliers", InstanceSet::Train, instance).unwrap()).unwrap()
}

pub(crate) fn scene(instance: u16) -> Scene {
    scene_with(&configuration().0, instance)
}

/// A Panda and a Sawyer opposite each other, and the pliers in their first training size.
pub(crate) fn mixed_scene() -> Scene {
    Scene::new(&configuration().0, vec![panda(), sawyer(DEFAULT_SLOT)], item("pliers", InstanceSet::Train, 0).unwrap()).unwrap()
}

/// Three Sawyers, two in parallel and one opposite, and the three sticks in their first training size.
pub(crate) fn three_sawyers(config: &SceneConfig) -> Scene {
    let config = SceneConfig { layout: Layout::TwoParallelOneOpposite, ..config.clone() };
    Scene::new(&config, vec![sawyer(DEFAULT_SLOT); 3], item("three-sticks", InstanceSet::Train, 0).unwrap()).unwrap()
}

/// All sliding friction of the scene at `sliding`.
pub(crate) fn slippery(config: &SceneConfig, sliding: f64) -> SceneConfig {
    let with = |friction: Friction| Friction { sliding, ..friction };
    SceneConfig {
        pad_friction: with(config.pad_friction),
        object_friction: with(config.object_friction),
        table_friction: with(config.table_friction),
        link_friction: with(config.link_friction),
        ..config.clone()
    }
}

/// A trial whose fingers go where the first demonstration says.
pub(crate) fn demonstrated_trial(scene: &Scene, config: &TrialConfig, order: GraspOrder, index: u64) -> Trial {
    let model = FixedTuple(scene.demonstrations[0].clone());
    run_trial(scene, config, &model, order, (SEED, index), Recording::Off)
}

/// The first `count` demonstrated trials that succeed; failing that, how the others ended.
pub(crate) fn first_successes(scene: &Scene, config: &TrialConfig, order: GraspOrder, count: usize) -> Vec<Trial> {
    let (mut successes, mut ends) = (Vec::new(), Vec::new());
    for index in 0..20 {
        let trial = demonstrated_trial(scene, config, order, index);
        if !trial.record.outcome.is_success() {
            ends.push(format!("{:?} {}", trial.record.outcome, trial.record.detail));
            continue;
        }
        successes.push(trial);
        if successes.len() == count {
            return successes;
        }
    }
    panic!("fewer than {count} trials of 20 succeed: {ends:#?}");
}

/// The stage at which a trial failed.
#[track_caller]
pub(crate) fn failed_at(trial: &Trial) -> FailureStage {
    match trial.record.outcome {
        TrialOutcome::Failed(stage) => stage,
        TrialOutcome::Success => panic!("the trial succeeds"),
    }
}

/// Proposes the same world points for the grasps of all parts, or nothing.
pub(crate) struct WorldPoints(pub(crate) Option<FingerPoints>);

impl ContactModel for WorldPoints {
    fn propose(&self, _query: &ContactQuery<'_>, _stream: &mut Stream) -> Vec<FingerPoints> {
        self.0.into_iter().collect()
    }
}

/// Cameras that hardly look: for trials that end before anything is grasped.
pub(crate) fn with_tiny_cameras(config: &TrialConfig) -> TrialConfig {
    TrialConfig { cameras: CameraConfig { width: 8, height: 6, ..config.cameras.clone() }, ..config.clone() }
}

/// CPU time of the calling thread (s), as Linux counts it.
pub(crate) fn thread_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|nanoseconds| nanoseconds.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-9
}
