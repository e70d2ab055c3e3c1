//! Arms that hold one object together: their forces add up to its weight, and hardly anything beyond that.

use super::observed;
use super::support::{configuration, demonstrated_trial};
use crate::layout::Layout;
use crate::scene::{Scene, SceneConfig};
use nalgebra::Vector3;
use std::cell::RefCell;
use std::rc::Rc;
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::order::GraspOrder;
use vmao_core::robots::{RobotModel, panda, sawyer};

/// Most that an arm may push against the others while the object is moved, mean over 50 ms (N).
const BOUND: f64 = 15.0;
/// Ticks at the end of a trial over which forces are averaged; the object is held at its goal then.
const LAST: usize = 150;

#[track_caller]
fn check(object: &str, robot: RobotModel, layout: Layout) {
    let (physics, config) = configuration();
    let item = item(object, InstanceSet::Train, 0).unwrap();
    let arms = item.object.parts.len();
    let scene = Scene::new(&SceneConfig { layout, ..physics }, vec![robot; arms], item).unwrap();
    let weight = 9.81 * scene.object.parts.iter().map(|part| part.mass).sum::<f64>();
    let mut successes = 0;
    for index in 0..3 {
        let sums: Rc<RefCell<Vec<Vector3<f64>>>> = Rc::default();
        let seen = Rc::clone(&sums);
        let look = move |simulation: &crate::simulation::Simulation<'_>| {
            seen.borrow_mut().push(simulation.arm_forces().iter().sum());
        };
        let trial = observed(look, || demonstrated_trial(&scene, &config, GraspOrder::Parallel, index));
        if !trial.record.outcome.is_success() {
            continue;
        }
        successes += 1;
        let sums = sums.take();
        let carried = sums[sums.len() - LAST..].iter().sum::<Vector3<f64>>() / LAST as f64;
        assert!((carried - Vector3::z() * weight).norm() < 0.1 * weight, "{arms} arms carry {carried} N, it weighs {weight} N");
        let motion = &trial.motion;
        assert!(motion.peak_internal_force < BOUND && motion.peak_internal_force > 0.0, "{object}, {arms} arms: {motion:?}");
        assert!(motion.mean_internal_force <= motion.peak_internal_force && motion.part_error < 5e-3, "{motion:?}");
        assert!(motion.hand_path > 0.05 * arms as f64, "{motion:?}");
    }
    assert!(successes >= 2, "{object}: {successes} of 3 trials with {arms} arms succeed: the bound is hardly tested");
}

#[test]
fn two_arms_on_one_object_hardly_work_against_each_other() {
    check("pliers", panda(), Layout::Opposed);
    check("pliers", sawyer(1), Layout::Opposed);
}

#[test]
fn three_arms_on_one_object_hardly_work_against_each_other() {
    check("three-sticks", panda(), Layout::Ring);
    check("three-sticks", sawyer(1), Layout::TwoParallelOneOpposite);
}
