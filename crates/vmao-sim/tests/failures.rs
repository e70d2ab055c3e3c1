//! Contacts that make no sense end a trial at a named stage: never a panic, never an endless loop.

mod support;

use nalgebra::Point3;
use support::{SEED, WorldPoints, configuration, demonstrated_trial, failed_at, scene};
use vmao_core::contact::{Contact, PartId};
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints, FixedTuple};
use vmao_core::order::GraspOrder;
use vmao_core::outcome::FailureStage;
use vmao_core::random::Stream;
use vmao_sim::{Recording, Trial, TrialConfig, run_trial};

/// Runs a trial with this model in both orders and checks where it fails; returns the last.
#[track_caller]
fn check(model: &dyn ContactModel, stage: FailureStage) -> Trial {
    let scene = scene(0);
    let (_, config) = configuration();
    let trials = [GraspOrder::Parallel, GraspOrder::Sequential].map(|order| {
        let trial = run_trial(&scene, &config, model, order, (SEED, 0), Recording::Off);
        assert_eq!(failed_at(&trial), stage, "{order:?}: {}", trial.record.detail);
        assert!(!trial.record.detail.is_empty(), "a failure says why");
        assert!(trial.threshold_factor.is_infinite(), "a trial that failed early has not come near its goal");
        assert!(trial.record.final_errors.iter().all(|error| error.is_finite()));
        trial
    });
    let [_, last] = trials;
    last
}

#[track_caller]
fn check_points(first: [f64; 3], second: [f64; 3], stage: FailureStage) -> Trial {
    check(&WorldPoints(Some([Point3::from(first), Point3::from(second)])), stage)
}

#[test]
fn nothing_proposed_is_no_contact() {
    let trial = check(&WorldPoints(None), FailureStage::NoContact);
    assert!(trial.record.grasps.is_empty());
}

#[test]
fn a_tuple_without_the_part_is_no_contact() {
    check(&FixedTuple(Vec::new()), FailureStage::NoContact);
}

#[test]
fn points_wider_than_the_gripper_are_unreachable() {
    let trial = check_points([0.0, -0.1, 0.02], [0.0, 0.1, 0.02], FailureStage::Unreachable);
    assert!(trial.record.detail.contains("0.200 m apart"), "{}", trial.record.detail);
}

#[test]
fn points_out_of_reach_are_unreachable() {
    check_points([5.0, -0.01, 0.1], [5.0, 0.01, 0.1], FailureStage::Unreachable);
    check_points([0.0, -0.01, 9.0], [0.0, 0.01, 9.0], FailureStage::Unreachable);
}

#[test]
fn points_below_the_table_are_unreachable() {
    check_points([0.0, -0.01, -0.5], [0.0, 0.01, -0.5], FailureStage::Unreachable);
    check_points([0.0, -0.01, -50.0], [0.0, 0.01, -50.0], FailureStage::Unreachable);
}

#[test]
fn coinciding_points_are_unreachable() {
    check_points([0.0, 0.0, 0.02], [0.0, 0.0, 0.02], FailureStage::Unreachable);
}

#[test]
fn points_one_above_the_other_do_not_panic() {
    // A vertical closing axis: only level approaches exist, and none of them clears the table.
    check_points([0.0, 0.0, 0.0], [0.0, 0.0, 0.02], FailureStage::Unreachable);
}

#[test]
fn points_that_are_not_finite_are_no_contact() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let trial = check_points([bad, 0.0, 0.02], [0.0, 0.01, 0.02], FailureStage::NoContact);
        assert!(trial.record.detail.contains("not finite"), "{}", trial.record.detail);
        check_points([0.0, 0.01, 0.02], [0.0, 0.0, bad], FailureStage::NoContact);
    }
}

#[test]
fn huge_points_do_not_panic() {
    check_points([1e300, 0.0, 0.0], [-1e300, 0.0, 0.0], FailureStage::Unreachable);
    check_points([1e300, 0.0, 0.0], [1e300, 0.0, 0.0], FailureStage::Unreachable);
    check_points([1e9, 0.0, 0.0], [1e9, 0.02, 0.0], FailureStage::Unreachable);
}

#[test]
fn fingers_beside_the_part_close_on_nothing() {
    // Next to the object in the air above it: reachable, but nothing is there.
    let scene = scene(0);
    let (_, config) = configuration();
    let air = |part: u16| Contact { part: PartId(part), fingers: [[0.0, 0.01, 0.12].into(), [0.0, -0.01, 0.12].into()] };
    let model = FixedTuple(vec![air(0), air(1)]);
    let trial = run_trial(&scene, &config, &model, GraspOrder::Sequential, (SEED, 0), Recording::Off);
    let stage = failed_at(&trial);
    assert_eq!(stage, FailureStage::NoContact, "{}", trial.record.detail);
}

/// Two proposals out of reach, then the demonstrated one, then another out of reach.
struct Ranked(FixedTuple);

impl ContactModel for Ranked {
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints> {
        let far = |height: f64| [Point3::new(0.0, -0.01, height), Point3::new(0.0, 0.01, height)];
        let good = self.0.propose(query, stream);
        [vec![far(9.0), far(8.0)], good, vec![far(7.0)]].concat()
    }
}

#[test]
fn the_first_proposal_that_can_be_made_is_taken_and_recorded() {
    let scene = scene(0);
    let (_, config) = configuration();
    let demonstrated = FixedTuple(scene.demonstrations[0].clone());
    for order in [GraspOrder::Parallel, GraspOrder::Sequential] {
        let run = |model: &dyn ContactModel| run_trial(&scene, &config, model, order, (SEED, 0), Recording::On);
        let (alone, ranked) = (run(&demonstrated), run(&Ranked(demonstrated.clone())));
        assert!(alone.record.outcome.is_success(), "{order:?}: {}", alone.record.detail);
        assert_eq!(ranked.record, alone.record, "{order:?}: as if only this had been proposed");
        assert_eq!(ranked.rollout, alone.rollout, "{order:?}");
    }
}

#[test]
fn a_part_that_turned_further_in_its_hand_than_may_be_learned_from_is_a_slip() {
    let scene = scene(0);
    let (_, config) = configuration();
    let [loose, firm] = [f64::INFINITY, 1e-6]
        .map(|most_turn| demonstrated_trial(&scene, &TrialConfig { most_turn, ..config.clone() }, GraspOrder::Sequential, 0));
    assert!(loose.record.outcome.is_success(), "{}", loose.record.detail);
    assert_eq!(failed_at(&firm), FailureStage::Slip);
    assert!(firm.record.detail.contains("turned by"), "{}", firm.record.detail);
    assert_eq!(firm.record.steps, loose.record.steps, "judged at the end: the motion is the same");
}
