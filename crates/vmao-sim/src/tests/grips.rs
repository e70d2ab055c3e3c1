//! Hands that carry one object together keep their parts still in them.

use super::observed;
use super::support::{configuration, demonstrated_trial, three_sawyers};
use crate::simulation::Simulation;
use std::cell::RefCell;
use std::rc::Rc;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::order::GraspOrder;

/// Turns in the hand are looked at over this many ticks at the end of a trial: the motion and the rest at its goal.
const LAST: usize = 1000;

/// The most that any part turned in its hand while three Sawyers carried three sticks (rad), by trial.
fn turns(grip_memory: f64, trials: std::ops::Range<u64>) -> Vec<f64> {
    let (physics, mut config) = configuration();
    config.motion.grip_memory = grip_memory;
    let scene = three_sawyers(&physics);
    let turn = |index| {
        let seen: Rc<RefCell<Vec<Vec<Pose>>>> = Rc::default();
        let noted = Rc::clone(&seen);
        let look = move |simulation: &Simulation<'_>| {
            let parts = simulation.object_state().world_from_parts;
            noted.borrow_mut().push((0..9).map(|pair| simulation.tool_pose(pair / 3).inverse() * parts[pair % 3]).collect());
        };
        let trial = observed(look, || demonstrated_trial(&scene, &config, GraspOrder::Parallel, index));
        let seen = seen.take();
        let carried = &seen[seen.len().saturating_sub(LAST)..];
        let turned = |arm: u16, part: u16| {
            let pair = usize::from(3 * arm + part);
            carried.iter().map(|poses| rotation_distance(&carried[0][pair].rotation, &poses[pair].rotation)).fold(0.0, f64::max)
        };
        trial.record.grasps.iter().map(|grasp| turned(grasp.arm.0, grasp.contact.part.0)).fold(0.0, f64::max)
    };
    trials.map(turn).collect()
}

#[test]
fn three_narrow_hands_do_not_turn_on_what_they_hold() {
    let kept = turns(1.0, 0..5);
    let let_go = turns(0.0, 0..5);
    let worst = |turns: &[f64]| turns.iter().copied().fold(0.0, f64::max).to_degrees();
    assert!(worst(&kept) < 5.0, "{kept:.2?}");
    assert!(worst(&let_go) > 2.0 * worst(&kept), "without memory the same trials are no test: {let_go:.2?}");
}
