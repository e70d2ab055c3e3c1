//! Algorithm 1: a few demonstrated contact tuples grow into a label set by trying jittered copies in physics.
//!
//! Run in rounds so that the set is the same for any number of workers: freeze the set, run the round's trials in any
//! order, merge their successes in index order.

use crate::scene::Scene;
use crate::trial::{Recording, Trial, TrialConfig, run_trial};
use rayon::prelude::*;
use vmao_core::contact::ContactTuple;
use vmao_core::contact_model::JitteredTuple;
use vmao_core::order::GraspOrder;
use vmao_core::random::Stream;
use vmao_core::record::TrialRecord;

/// Names the streams of this module, apart from those of a trial's stages.
const SCENE: u64 = 1 << 32;
const TUPLE: u64 = SCENE + 1;

/// Which of `count` scenes trial `index` of the run with `seed` takes place in.
pub fn scene_of_trial(seed: u64, index: u64, count: usize) -> usize {
    Stream::new(seed, &[index, SCENE]).index(count)
}

/// The label set T: contact tuples known to succeed on each scene's object.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelSet {
    tuples: Vec<Vec<ContactTuple>>,
}

impl LabelSet {
    /// T ← D: the demonstrations alone.
    pub fn demonstrated(scenes: &[Scene]) -> Self {
        Self { tuples: scenes.iter().map(|scene| scene.demonstrations.clone()).collect() }
    }

    /// T ← T ∪ {s′} if the trial succeeded. `scene` is the one it took place in.
    pub fn learn(&mut self, scene: usize, record: &TrialRecord) {
        if record.outcome.is_success() {
            self.tuples[scene].push(record.grasps.iter().map(|grasp| grasp.contact).collect());
        }
    }

    /// Number of tuples over all scenes.
    pub fn len(&self) -> usize {
        self.tuples.iter().map(Vec::len).sum()
    }

    /// Whether there is nothing to start from.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// s ~ T, uniformly over the tuples of one scene.
    pub fn draw(&self, scene: usize, stream: &mut Stream) -> ContactTuple {
        let known = &self.tuples[scene];
        if known.is_empty() { ContactTuple::new() } else { known[stream.index(known.len())].clone() }
    }
}

/// How new tuples are drawn and tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposals {
    /// Algorithm 1's neighbourhood radius r (m).
    pub radius: f64,
    /// Grasp orders, taken in turn by the trials; not empty.
    pub orders: Vec<GraspOrder>,
}

/// Runs the trials `indices` with the label set frozen, in the current rayon pool; results in the order asked for.
///
/// Trial i draws its scene, its tuple and all else from (`seed`, i).
pub fn explore_round(
    scenes: &[Scene],
    config: &TrialConfig,
    labels: &LabelSet,
    proposals: &Proposals,
    (seed, indices): (u64, &[u64]),
    done: &(dyn Fn(&Trial) + Sync),
) -> Vec<Trial> {
    let run = |&index: &u64| {
        let scene = scene_of_trial(seed, index, scenes.len());
        let tuple = labels.draw(scene, &mut Stream::new(seed, &[index, TUPLE]));
        let Proposals { radius, orders } = proposals;
        let order = orders[(index % orders.len() as u64) as usize];
        let radius = *radius;
        let trial = run_trial(&scenes[scene], config, &JitteredTuple { tuple, radius }, order, (seed, index), Recording::Off);
        done(&trial);
        trial
    };
    indices.par_iter().map(run).collect()
}
