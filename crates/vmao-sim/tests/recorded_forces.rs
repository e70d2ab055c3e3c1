//! The forces that a rollout records are those of the simulated world: together the hands carry the object's weight.

mod support;

use nalgebra::Vector3;
use support::{SEED, configuration, scene};
use vmao_core::contact_model::JitteredTuple;
use vmao_core::order::GraspOrder;
use vmao_sim::{Recording, run_trial};

const GRAVITY: f64 = 9.81;

#[test]
fn at_the_goal_the_hands_carry_the_weight_and_squeeze() {
    let scene = scene(2);
    let (_, config) = configuration();
    let model = JitteredTuple { tuple: scene.demonstrations[0].clone(), radius: 0.005 };
    let solved = |index| {
        let trial = run_trial(&scene, &config, &model, GraspOrder::Sequential, (SEED, index), Recording::On);
        trial.record.outcome.is_success().then_some(trial)
    };
    let rollout = (0..6).find_map(solved).and_then(|trial| trial.rollout).expect("demonstrated contacts succeed at times");
    assert_eq!(rollout.forces.len(), rollout.frames.len());
    assert!(rollout.forces[0].iter().flatten().all(|pad| pad.force == [0.0; 3]), "nothing is touched at the start");
    // The goal is held for half a second at the end: twelve frames.
    let held = &rollout.forces[rollout.forces.len() - 10..];
    let sum: Vector3<f64> = held.iter().flatten().flatten().map(|pad| Vector3::from(pad.force)).sum();
    let carried = sum / held.len() as f64;
    let weight = GRAVITY * scene.object.parts.iter().map(|part| part.mass).sum::<f64>();
    assert!((carried - Vector3::z() * weight).norm() < 0.05 * weight, "{carried:?} N, expected {weight} N upward");
    for pad in held.iter().flatten().flatten() {
        assert!(Vector3::from(pad.force).norm() > config.grasp.hold_force, "a hand that holds presses: {pad:?}");
        let near = rollout.frames[rollout.frames.len() - 1]
            .iter()
            .map(|pose| (pose.translation.vector - Vector3::from(pad.point)).norm());
        assert!(near.fold(f64::INFINITY, f64::min) < 0.2, "a contact lies near some body: {pad:?}");
    }
}
