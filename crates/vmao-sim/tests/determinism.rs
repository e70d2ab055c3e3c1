//! A trial is a function of configuration, scene, contacts, seed and index: not of threads, repetition or recording.

mod support;

use support::{SEED, WorldPoints, configuration, scene};
use vmao_core::contact_model::JitteredTuple;
use vmao_core::observation::PointLabel;
use vmao_core::order::GraspOrder;
use vmao_sim::{Recording, Scene, Trial, run_trial};

fn trial(scene: &Scene, order: GraspOrder, index: u64, recording: Recording) -> Trial {
    let (_, config) = configuration();
    let model = JitteredTuple { tuple: scene.demonstrations[0].clone(), radius: 0.02 };
    run_trial(scene, &config, &model, order, (SEED, index), recording)
}

/// Every number of a record with all its digits: `Debug` writes floats so that they read back bit for bit.
fn digits(trial: &Trial) -> String {
    format!("{:?} {:?}", trial.record, trial.threshold_factor)
}

#[test]
fn repeated_and_simultaneous_trials_are_equal_to_the_bit() {
    let scene = scene(2);
    let run = || {
        let orders = [GraspOrder::Parallel, GraspOrder::Sequential];
        orders.map(|order| digits(&trial(&scene, order, 3, Recording::Off)))
    };
    let alone = run();
    let (left, right) = std::thread::scope(|scope| {
        let (left, right) = (scope.spawn(run), scope.spawn(run));
        (left.join().unwrap(), right.join().unwrap())
    });
    assert!(alone == left, "a second run differs");
    assert!(alone == right, "another thread's run differs");
    assert!(alone[0] != alone[1], "the order has no effect");
}

#[test]
fn a_scene_compiled_again_gives_the_same_trial() {
    let fresh = || digits(&trial(&scene(1), GraspOrder::Parallel, 0, Recording::Off));
    assert!(fresh() == fresh());
}

#[test]
fn indices_and_seeds_differ() {
    let scene = scene(0);
    let (_, config) = configuration();
    let start = |seed, index| {
        let nothing = WorldPoints(None);
        run_trial(&scene, &support::with_tiny_cameras(&config), &nothing, GraspOrder::Parallel, (seed, index), Recording::Off)
    };
    let starts: Vec<_> = [(1, 0), (1, 1), (2, 0), (2, 1)].into_iter().map(|(seed, index)| start(seed, index).record).collect();
    for (i, a) in starts.iter().enumerate() {
        for b in &starts[i + 1..] {
            assert_ne!(a.start.joint_positions, b.start.joint_positions);
            assert_ne!(a.start.world_from_parts, b.start.world_from_parts);
            assert_ne!(a.goal.world_from_root, b.goal.world_from_root);
        }
    }
}

#[test]
fn recording_only_watches() {
    let scene = scene(0);
    for index in 0..2 {
        let off = trial(&scene, GraspOrder::Sequential, index, Recording::Off);
        let on = trial(&scene, GraspOrder::Sequential, index, Recording::On);
        assert!(digits(&off) == digits(&on), "trial {index} changes when it is recorded");
        assert!(off.rollout.is_none());
        let rollout = on.rollout.unwrap();
        assert!(!rollout.frames.is_empty() && rollout.frames.iter().all(|frame| frame.len() == rollout.bodies.len()));
        let parts = rollout.bodies.iter().filter(|body| matches!(body.label, PointLabel::Part(_))).count();
        assert_eq!((parts, rollout.goal.len()), (2, 2));
        assert_eq!(rollout.frames[0][rollout.bodies.len() - 2..], on.record.start.world_from_parts, "begins with the start");
        let length = rollout.frames.len() as f64 * rollout.frame_seconds;
        assert!(length <= on.record.steps as f64 * scene.timestep);
        assert!(rollout.events.is_sorted_by(|a, b| a.time <= b.time));
        // Nothing moves before the first grasp is asked for: it is the first thing that happens.
        assert_eq!(rollout.contacts[0].time, 0.0, "times count from the first frame");
        assert!(rollout.events.iter().all(|event| (0.0..=length).contains(&event.time)), "{:?} of {length}", rollout.events);
        assert!(rollout.frames.iter().flatten().all(|pose| pose.translation.vector.iter().all(|x| x.is_finite())));
    }
}
