//! What all tests of this crate run on: one configuration, the pliers, two Pandas, and contact models of their own.
#![allow(dead_code, reason = "each test binary uses its own share of this module")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

use nalgebra::Point3;
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::contact_model::{ContactModel, ContactQuery, FixedTuple};
use vmao_core::order::GraspOrder;
use vmao_core::osc::OscGains;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_core::random::Stream;
use vmao_core::robots::panda;
use vmao_sim::{
    CameraConfig, Friction, GoalConfig, GraspConfig, Layout, MotionConfig, Recording, Scene, SceneConfig, StartConfig,
    Thresholds, Trial, TrialConfig, run_trial,
};

/// Seed of all trials of these tests.
pub(crate) const SEED: u64 = 1;

/// The scene's and the trials' configuration.
pub(crate) fn configuration() -> (SceneConfig, TrialConfig) {
    let friction = |sliding| Friction { sliding, torsional: 0.003, rolling: 0.0001 };
    let scene = SceneConfig {
        layout: Layout::Opposed,
        base_distance: 0.58,
        base_spacing: 0.7,
        timestep: 0.002,
        friction_impedance_ratio: 100.0,
        noslip_iterations: 3,
        pad_friction: friction(1.0),
        object_friction: friction(0.5),
        table_friction: friction(0.5),
        link_friction: friction(0.3),
    };
    let trial = TrialConfig {
        start: StartConfig { half_width: 0.06 },
        goal: GoalConfig {
            lift: [0.08, 0.20],
            sideways: 0.15,
            yaw_deg: 45.0,
            tilt_deg: 15.0,
            joint_change_share: 0.25,
            joint_change_deg: 15.0,
        },
        thresholds: Thresholds { position: 0.02, rotation_deg: 10.0, joint_deg: 5.0, joint_m: 0.01, hold_seconds: 0.5 },
        cameras: CameraConfig {
            count: 4,
            width: 240,
            height: 180,
            field_of_view_deg: 40.0,
            distance: 0.7,
            elevations: vec![0.6, 0.08],
            workspace_half_width: 0.25,
            workspace_height: 0.5,
            points: 1024,
            table_share: 0.15,
            robot_share: 0.15,
        },
        grasp: GraspConfig {
            approaches: 24,
            standoff: 0.08,
            opening_margin: 0.02,
            table_clearance: 0.004,
            max_retreat: 0.009,
            plan_margin: 0.005,
            lean_forward: 0.4,
            lean_inward: 0.4,
            carry_margin: 0.012,
            approach_cost: 1.0,
            squaring_deg: 50.0,
            shortlist: 80,
            ik_candidates: 5,
            ik_restarts: 6,
            // 7 N a pad: four pads carry the lightest pliers only above a friction of 0.06, so that ice must drop them.
            closing_share: 0.2,
            closing_seconds: 0.5,
            hold_force: 5.0,
        },
        motion: MotionConfig {
            velocity_share: 0.5,
            acceleration_share: 0.3,
            approach_share: 0.4,
            object_speed: 0.12,
            object_turning_speed: 0.6,
            shortest_motion: 1.0,
            collision_force: 15.0,
            waypoints: 12,
        },
        osc: OscGains {
            position_stiffness: 400.0,
            rotation_stiffness: 400.0,
            damping_ratio: 1.0,
            posture_stiffness: 100.0,
            singularity_damping: 1e-3,
            max_position_error: 0.05,
            max_rotation_error: 0.3,
        },
    };
    (scene, trial)
}

/// Two Pandas and the pliers in their `instance`-th training size.
pub(crate) fn scene_with(config: &SceneConfig, instance: u16) -> Scene {
    Scene::new(config, vec![panda(), panda()], item("pliers", InstanceSet::Train, instance).unwrap()).unwrap()
}

pub(crate) fn scene(instance: u16) -> Scene {
    scene_with(&configuration().0, instance)
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
pub(crate) struct WorldPoints(pub(crate) Option<[Point3<f64>; 2]>);

impl ContactModel for WorldPoints {
    fn propose(&self, _query: &ContactQuery<'_>, _stream: &mut Stream) -> Option<[Point3<f64>; 2]> {
        self.0
    }
}

/// Cameras that hardly look: for trials that end before anything is grasped.
pub(crate) fn with_tiny_cameras(config: &TrialConfig) -> TrialConfig {
    TrialConfig { cameras: CameraConfig { width: 8, height: 6, ..config.cameras.clone() }, ..config.clone() }
}
