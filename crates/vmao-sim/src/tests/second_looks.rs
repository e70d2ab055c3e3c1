//! What a trial does when the next hand finds no way to the object, or finds it elsewhere than where it was seen.

use super::support::{SEED, configuration, configuration_with, failed_at, scene, three_sawyers};
use crate::trial::{Recording, Trial, run_trial};
use nalgebra::Point3;
use std::sync::atomic::{AtomicUsize, Ordering};
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints, FixedTuple};
use vmao_core::order::GraspOrder;
use vmao_core::outcome::FailureStage;
use vmao_core::random::Stream;

/// As demonstrated, but for the first `misses` looks for the second grasp, which want points that no arm reaches.
struct FarAtFirst {
    demonstrated: FixedTuple,
    misses: usize,
    looks: AtomicUsize,
}

impl ContactModel for FarAtFirst {
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints> {
        if query.grasp == 1 && self.looks.fetch_add(1, Ordering::Relaxed) < self.misses {
            return vec![[Point3::new(5.0, 0.0, 0.1), Point3::new(5.0, 0.02, 0.1)]];
        }
        self.demonstrated.propose(query, stream)
    }
}

fn events(trial: &Trial, what: &str) -> usize {
    let rollout = trial.rollout.as_ref().expect("a recorded trial");
    rollout.events.iter().filter(|event| event.label.contains(what)).count()
}

/// A pliers trial in sequential order, and how often it looked for its second grasp.
fn pliers(misses: usize) -> (Trial, usize) {
    let (scene, (_, config)) = (scene(0), configuration());
    let demonstrated = FixedTuple(scene.demonstrations[0].clone());
    let model = FarAtFirst { demonstrated, misses, looks: AtomicUsize::new(0) };
    let trial = run_trial(&scene, &config, &model, GraspOrder::Sequential, (SEED, 2), Recording::On);
    (trial, model.looks.into_inner())
}

#[test]
fn an_object_that_the_next_arm_cannot_reach_is_brought_elsewhere_and_looked_at_again() {
    let (plain, looks) = pliers(0);
    assert!(plain.record.outcome.is_success() && looks == 1 && events(&plain, "elsewhere") == 0);
    let (trial, looks) = pliers(2);
    assert!(trial.record.outcome.is_success(), "{}", trial.record.detail);
    assert_eq!((looks, events(&trial, "elsewhere")), (3, 2));
    assert_eq!(trial.record.grasps.len(), 2, "contacts that were not used are not recorded");
    assert_eq!(trial.rollout.as_ref().map(|rollout| rollout.contacts.len()), Some(2));
    let [second, first_look] = [&trial, &plain].map(|trial| &trial.record.grasps[1]);
    assert!((second.contact.fingers[0] - first_look.contact.fingers[0]).norm() < 1e-9);
    assert_ne!(second.world_from_part, first_look.world_from_part, "seen where it was brought");
}

#[test]
fn a_contact_that_is_nowhere_in_reach_is_looked_for_at_every_place_and_fails() {
    let (trial, looks) = pliers(usize::MAX);
    assert_eq!(failed_at(&trial), FailureStage::Unreachable);
    assert_eq!(looks, events(&trial, "elsewhere") + 1, "one look at each place");
    assert!((2..7).contains(&looks), "{looks}");
}

#[test]
fn hands_that_find_a_held_part_elsewhere_plan_again() {
    let settings = [("scene.base_distance", "0.66"), ("grasp.closing_force", "12.0")];
    let (physics, config) = configuration_with(&settings);
    let scene = three_sawyers(&physics);
    let model = FixedTuple(scene.demonstrations[0].clone());
    let run = |index| run_trial(&scene, &config, &model, GraspOrder::Sequential, (SEED, index), Recording::On);
    // The first hand holds its stick firmly in the one trial and lets it turn in the other.
    let [firm, turning] = [0, 5].map(run);
    assert!(firm.record.outcome.is_success() && events(&firm, "plan again") == 0, "{}", firm.record.detail);
    assert!(turning.record.outcome.is_success(), "{}", turning.record.detail);
    // The way that was planned again is gone, too.
    let labels: Vec<&str> =
        turning.rollout.iter().flat_map(|rollout| &rollout.events).map(|event| event.label.as_str()).collect();
    let again = labels.iter().position(|label| label.contains("plan again")).expect("a part that has moved");
    assert_eq!(labels[again - 1], labels[again + 1], "the same arm reaches for the same part: {labels:?}");
    assert!(labels[again + 1].contains("reaches for"));
}
