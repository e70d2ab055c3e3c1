//! What exploration has come to so far: near-duplicates, failures by stage, and how much of each part was touched.

use crate::config::{ExploreConfig, NearDuplicates};
use serde::Serialize;
use std::collections::BTreeMap;
use vmao_core::contact::{Contact, ContactTuple};
use vmao_core::coverage::Coverage;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_core::record::TrialRecord;
use vmao_sim::Scene;

/// Counts over the records so far; a pure function of them in their order.
#[derive(Debug)]
pub struct Acceptance {
    distance: f64,
    handling: NearDuplicates,
    parts: Vec<String>,
    sizes: Vec<Size>,
    near_duplicates: u64,
    failures: BTreeMap<FailureStage, u64>,
    trials: u64,
    successes: u64,
    rounds: Vec<RoundSummary>,
}

/// What exploration had come to after a round; a line of `exploration.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoundSummary {
    /// Trials so far.
    pub trials: u64,
    /// Accepted ones so far.
    pub successes: u64,
    /// Near-duplicates so far.
    pub near_duplicates: u64,
    /// Share of the surfaces touched so far, the mean over parts.
    pub coverage: f64,
}

#[derive(Debug)]
struct Size {
    accepted: Vec<ContactTuple>,
    coverage: Vec<Coverage>,
}

/// The same, for documents.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AcceptanceSummary {
    /// Proposals within `explore.near_distance` of a tuple accepted before.
    pub near_duplicates: u64,
    /// Failed trials by the stage that failed first.
    pub failures: BTreeMap<FailureStage, u64>,
    /// By part, the share of its surface's cells of a centimetre that accepted contacts touch, over all sizes explored.
    pub coverage: BTreeMap<String, f64>,
}

impl Acceptance {
    /// Nothing so far.
    pub fn new(config: &ExploreConfig, scenes: &[Scene]) -> Self {
        let size = |scene: &Scene| Size { accepted: Vec::new(), coverage: scene.object.parts.iter().map(Coverage::of).collect() };
        let parts = scenes.first().map(|scene| scene.object.parts.iter().map(|part| part.name.clone()).collect());
        Self {
            distance: config.near_distance,
            handling: config.near_duplicates,
            parts: parts.unwrap_or_default(),
            sizes: scenes.iter().map(size).collect(),
            near_duplicates: 0,
            failures: FailureStage::ALL.into_iter().map(|stage| (stage, 0)).collect(),
            trials: 0,
            successes: 0,
            rounds: Vec::new(),
        }
    }

    /// Counts a record of the `scene`-th size; whether the label set shall learn from it.
    pub fn add(&mut self, scene: usize, record: &TrialRecord) -> bool {
        self.trials += 1;
        if let TrialOutcome::Failed(stage) = record.outcome {
            *self.failures.entry(stage).or_default() += 1;
        }
        let size = &mut self.sizes[scene];
        let tuple: ContactTuple = record.grasps.iter().map(|grasp| grasp.contact).collect();
        let near = size.accepted.iter().any(|accepted| near(accepted, &tuple, self.distance));
        self.near_duplicates += u64::from(near);
        if !record.outcome.is_success() {
            return false;
        }
        self.successes += 1;
        for contact in &tuple {
            // A file may name a part that the configuration beside it does not have.
            let Some(coverage) = size.coverage.get_mut(usize::from(contact.part.0)) else { continue };
            contact.fingers.iter().for_each(|finger| coverage.touch(finger));
        }
        size.accepted.push(tuple);
        !near || self.handling == NearDuplicates::Keep
    }

    /// The counts.
    pub fn summary(&self) -> AcceptanceSummary {
        let share = |part: usize| {
            let of_part = || self.sizes.iter().map(|size| &size.coverage[part]);
            let cells: usize = of_part().map(Coverage::cells).sum();
            of_part().map(Coverage::touched).sum::<usize>() as f64 / cells.max(1) as f64
        };
        let coverage = self.parts.iter().enumerate().map(|(part, name)| (name.clone(), share(part))).collect();
        AcceptanceSummary { near_duplicates: self.near_duplicates, failures: self.failures.clone(), coverage }
    }

    /// Notes what there is at the end of a round.
    pub fn end_round(&mut self) {
        let AcceptanceSummary { near_duplicates, coverage, .. } = self.summary();
        let coverage = coverage.values().sum::<f64>() / coverage.len().max(1) as f64;
        let Self { trials, successes, .. } = *self;
        self.rounds.push(RoundSummary { trials, successes, near_duplicates, coverage });
    }

    /// The rounds so far.
    pub fn rounds(&self) -> &[RoundSummary] {
        &self.rounds
    }

    /// The counts at the end of the last round in a few words, for the progress line.
    pub fn words(&self) -> String {
        let covered = 100.0 * self.rounds.last().map_or(0.0, |round| round.coverage);
        let worst = self.failures.iter().max_by_key(|(_, count)| **count).filter(|(_, count)| **count > 0);
        let worst = worst.map_or_else(String::new, |(stage, count)| format!(", {count} {}", stage.name()));
        format!("{covered:.0} % of surfaces touched, {} near-duplicates{worst}", self.near_duplicates)
    }
}

/// Whether each contact of one tuple has one of the other on its part, both fingers within `distance` (m) in either fingering.
fn near(one: &ContactTuple, other: &ContactTuple, distance: f64) -> bool {
    let close = |a: &Contact, b: &Contact| {
        let apart = |i: usize, j: usize| (a.fingers[0] - b.fingers[i]).norm().max((a.fingers[1] - b.fingers[j]).norm());
        a.part == b.part && apart(0, 1).min(apart(1, 0)) < distance
    };
    one.len() == other.len() && one.iter().all(|a| other.iter().any(|b| close(a, b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use vmao_core::contact::PartId;

    #[test]
    fn tuples_are_near_in_either_fingering_and_only_on_the_same_parts() {
        let contact = |part: u16, x: f64, side: f64| Contact {
            part: PartId(part),
            fingers: [Point3::new(x, side * 0.01, 0.0), Point3::new(x, side * -0.01, 0.0)],
        };
        let tuple = vec![contact(0, 0.1, 1.0), contact(1, 0.2, 1.0)];
        assert!(near(&tuple, &vec![contact(1, 0.201, -1.0), contact(0, 0.1, 1.0)], 0.002));
        assert!(!near(&tuple, &vec![contact(1, 0.203, -1.0), contact(0, 0.1, 1.0)], 0.002));
        assert!(!near(&tuple, &vec![contact(0, 0.2, 1.0), contact(1, 0.1, 1.0)], 0.002));
        assert!(!near(&tuple, &vec![contact(0, 0.1, 1.0)], 0.002), "a trial that ended before the second grasp");
    }
}
