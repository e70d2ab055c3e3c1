//! What is said of a goal's reach: the same for everyone, never a refutation of what was reached, and a reason to draw anew only
//! where the configuration asks.

use super::support::{SEED, WorldPoints, configuration, demonstrated_trial, scene, with_tiny_cameras};
use crate::layout::Layout;
use crate::reachability::reachability;
use crate::scene::{Scene, SceneConfig};
use crate::task::{GoalConfig, GoalReach, draw_goal, sample_start};
use crate::trial::{Recording, TrialConfig, run_trial};
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::contact::PartId;
use vmao_core::contact_model::FixedTuple;
use vmao_core::geometry::Pose;
use vmao_core::object::{ObjectGoal, ObjectState};
use vmao_core::object_centric::part_poses;
use vmao_core::order::GraspOrder;
use vmao_core::outcome::Reachability;
use vmao_core::random::Stream;
use vmao_core::robots::panda;

/// The goal of draw `index` from a start as it is before settling.
fn drawn(scene: &Scene, config: &TrialConfig, goal: &GoalConfig, index: u64) -> (ObjectState, ObjectGoal, GoalReach) {
    let (world_from_root, joint_positions) = sample_start(scene, &config.start, &mut Stream::new(SEED, &[index]));
    let world_from_parts = part_poses(&scene.object, &scene.graph, PartId(0), &world_from_root, &joint_positions);
    let start = ObjectState { world_from_parts, joint_positions };
    let (goal, _, reach) = draw_goal(scene, (goal, &config.grasp), &start, &mut Stream::new(SEED, &[index, 1]));
    (start, goal, reach)
}

fn lifted(lift: [f64; 2], reject_unreachable: bool) -> TrialConfig {
    let config = with_tiny_cameras(&configuration().1);
    TrialConfig { goal: GoalConfig { lift, reject_unreachable, ..config.goal.clone() }, ..config }
}

#[test]
fn goals_near_the_table_are_within_reach_and_those_far_above_are_proven_not_to_be() {
    let scene = scene(0);
    let count = |lift: [f64; 2], said: Reachability| {
        let config = lifted(lift, false);
        (0..40).filter(|&index| drawn(&scene, &config, &config.goal, index).2.reachability == said).count()
    };
    assert!(count([0.08, 0.20], Reachability::Reachable) >= 38);
    assert_eq!(count([1.6, 2.0], Reachability::Unreachable), 40);
}

#[test]
fn what_is_said_of_a_goal_depends_on_no_contact_and_no_order() {
    let scene = scene(0);
    let config = lifted([0.5, 1.0], false);
    let mut said = Vec::new();
    for index in 0..6 {
        let trials = [GraspOrder::Parallel, GraspOrder::Sequential].map(|order| {
            let far = WorldPoints(Some([[3.0, 0.0, 0.1].into(), [3.0, 0.02, 0.1].into()]));
            run_trial(&scene, &config, &far, order, (SEED, index), Recording::Off).reach
        });
        let none = run_trial(&scene, &config, &FixedTuple(Vec::new()), GraspOrder::Parallel, (SEED, index), Recording::Off);
        assert_eq!(trials, [none.reach; 2]);
        assert_eq!(none.reach.redraws, 0, "a goal was drawn anew and nobody asked for it");
        said.push(none.reach.reachability);
    }
    assert!(said.contains(&Reachability::Reachable) && said.iter().any(|said| *said != Reachability::Reachable), "{said:?}");
}

#[test]
fn what_was_reached_is_never_called_unreachable() {
    let scene = scene(0);
    let config = TrialConfig { cameras: configuration().1.cameras, ..lifted([0.3, 0.75], false) };
    let trials: Vec<_> = (0..12).map(|index| demonstrated_trial(&scene, &config, GraspOrder::Parallel, index)).collect();
    let (successes, failures): (Vec<_>, Vec<_>) = trials.iter().partition(|trial| trial.record.outcome.is_success());
    assert!(successes.len() >= 3 && !failures.is_empty(), "{} of 12 succeed: nothing is tested", successes.len());
    for trial in successes {
        assert_ne!(trial.reach.reachability, Reachability::Unreachable, "trial {} succeeded", trial.record.index);
    }
}

#[test]
fn goals_are_drawn_anew_until_they_are_within_reach_and_not_for_ever() {
    let scene = scene(0);
    let [kept, redrawn] = [false, true].map(|reject| lifted([0.5, 1.0], reject));
    let mut redraws = 0;
    for index in 0..20 {
        let (start, first, reach) = drawn(&scene, &kept, &kept.goal, index);
        let (_, goal, after) = drawn(&scene, &redrawn, &redrawn.goal, index);
        assert_eq!(after.reachability, Reachability::Reachable);
        assert_eq!(after.redraws == 0, reach.reachability == Reachability::Reachable);
        assert_eq!(after.redraws == 0, goal == first, "a goal within reach was drawn anew");
        let parts = part_poses(&scene.object, &scene.graph, goal.root, &goal.world_from_root, &goal.joint_positions);
        assert_eq!(reachability(&scene, &kept.grasp, &start.world_from_parts, &parts), after.reachability);
        assert_eq!(drawn(&scene, &redrawn, &redrawn.goal, index), (start, goal, after), "drawn twice, two goals");
        redraws += after.redraws;
    }
    assert!(redraws > 5, "{redraws} goals drawn anew: nothing is tested");
    let hopeless = lifted([2.0, 2.0], true);
    let (_, _, reach) = drawn(&scene, &hopeless, &hopeless.goal, 0);
    assert_eq!(reach, GoalReach { reachability: Reachability::Unreachable, redraws: 100 });
}

#[test]
fn every_part_needs_an_arm_of_its_own() {
    let bases = |x: [f64; 2]| {
        x.map(|x| crate::layout::BasePlacement { position: [x, 0.0, 0.0], yaw_deg: if x > 0.0 { 180.0 } else { 0.0 } }).to_vec()
    };
    let said = |x: [f64; 2]| {
        let physics = SceneConfig { layout: Layout::Explicit, bases: bases(x), ..configuration().0 };
        let scene = Scene::new(&physics, vec![panda(); 2], item("pliers", InstanceSet::Train, 0).unwrap()).unwrap();
        let place = |lift: f64, joint: f64| {
            part_poses(&scene.object, &scene.graph, PartId(0), &Pose::translation(0.0, 0.0, lift), &[joint])
        };
        reachability(&scene, &configuration().1.grasp, &place(0.012, 0.2), &place(0.15, 0.6))
    };
    assert_eq!(said([-0.58, 0.58]), Reachability::Reachable);
    assert_eq!(said([-0.58, 3.0]), Reachability::Unreachable, "one arm for two parts");
    assert_eq!(said([-0.58, 0.58]), said([0.58, -0.58]), "who stands where makes no difference");
}
