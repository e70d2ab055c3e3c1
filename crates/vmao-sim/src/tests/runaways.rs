//! A trial ends when its steps are spent, and when the simulator has gone astray, whatever the configuration.

use super::{settled, support};
use crate::simulation::Simulation;
use std::path::Path;
use support::{configuration, demonstrated_trial, failed_at, scene};
use vmao_core::{order::GraspOrder, outcome::FailureStage};

#[test]
fn a_motion_that_would_take_years_ends_with_its_steps() {
    let scene = scene(0);
    let (_, mut config) = configuration();
    config.motion.object_speed = 1e-9;
    config.motion.max_steps = 6000;
    let trial = demonstrated_trial(&scene, &config, GraspOrder::Sequential, 0);
    assert_eq!(failed_at(&trial), FailureStage::Timeout, "{}", trial.record.detail);
    assert_eq!(trial.record.detail, "not done after 6000 steps, the most that a trial may take");
    assert_eq!((trial.record.steps, trial.record.grasps.len()), (6000, 1), "it was carrying the object when it ended");
    assert!(trial.threshold_factor.is_infinite());
}

#[test]
fn a_trial_that_may_not_even_settle_fails_before_it_looks() {
    let scene = scene(0);
    let (_, mut config) = configuration();
    config.motion.max_steps = 3;
    let trial = demonstrated_trial(&scene, &config, GraspOrder::Sequential, 0);
    assert_eq!((failed_at(&trial), trial.record.steps), (FailureStage::Timeout, 3));
    assert!(trial.record.grasps.is_empty());
}

#[test]
fn a_simulator_that_has_gone_astray_is_believed_no_more() {
    let scene = scene(0);
    let far = 1e11;
    type Spoil = fn(&mut Simulation<'_>, f64);
    let spoils: [(&str, Spoil); 4] = [
        ("a position", |simulation, far| simulation.data.qpos_mut()[3] = far),
        ("a position", |simulation, _| simulation.data.qpos_mut()[3] = f64::NAN),
        ("a velocity", |simulation, far| simulation.data.qvel_mut()[8] = far),
        ("an acceleration", |simulation, far| simulation.data.qfrc_applied_mut()[8] = far * far),
    ];
    for (what, spoil) in spoils {
        let mut simulation = settled(&scene, 0);
        simulation.advance().unwrap();
        spoil(&mut simulation, far);
        let failure = simulation.advance().unwrap_err();
        assert_eq!(failure.stage, FailureStage::Timeout);
        assert!(failure.why.starts_with(&format!("the simulation went astray: {what} that is not finite")), "{}", failure.why);
        // The simulator has put its state back and would go on as if nothing had happened.
        assert!(simulation.data.qpos().iter().all(|value| value.is_finite()));
        simulation.advance().unwrap_err();
    }
    assert!(!Path::new("MUJOCO_LOG.TXT").exists(), "warnings are outcomes, not files");
}
