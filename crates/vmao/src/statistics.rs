//! What is in a data set: outcomes, contacts of each part, and how the accepted trials are spread.

use crate::acceptance::AcceptanceSummary;
use crate::config::Config;
use crate::dataset;
use crate::exploration::{Explorer, Learned};
use crate::failure::{Failure, OrBadInput};
use crate::provenance::RunInfo;
use crate::results::{aligned, wilson95};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;
use vmao_core::catalogue::INSTANCES;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_core::record::TrialRecord;
use vmao_sim::scene_of_trial;

/// Trials and how many were accepted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Share {
    /// Trials.
    pub trials: u64,
    /// Accepted ones.
    pub successes: u64,
}

/// How a number is spread over trials.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Smallest.
    pub min: f64,
    /// Half are below.
    pub median: f64,
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// Of finite values; none if there are none.
    fn of(mut values: Vec<f64>) -> Option<Self> {
        values.retain(|value| value.is_finite());
        values.sort_by(f64::total_cmp);
        let (min, max) = (*values.first()?, *values.last()?);
        let middle = values.len() / 2;
        let median = if values.len() % 2 == 1 { values[middle] } else { (values[middle - 1] + values[middle]) / 2.0 };
        Some(Self { min, median, mean: values.iter().sum::<f64>() / values.len() as f64, max })
    }
}

/// The contacts of one part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartContacts {
    /// Its index.
    pub part: u16,
    /// Its name, where the configuration is beside the data.
    pub name: Option<String>,
    /// Contacts tried.
    pub tried: u64,
    /// Contacts of accepted trials.
    pub accepted: u64,
    /// Accepted contacts by the arm that made them.
    pub by_arm: BTreeMap<u16, u64>,
    /// Distance of the two points of accepted contacts (m).
    pub width: Option<Spread>,
    /// Middle of the two points of accepted contacts: x, y, z in the part's frame (m).
    pub middle: [Option<Spread>; 3],
}

/// What `vmao dataset stats` answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistics {
    /// Trials.
    pub trials: u64,
    /// Accepted ones.
    pub successes: u64,
    /// Acceptance rate.
    pub rate: f64,
    /// Its score interval at 95 %.
    pub wilson95: [f64; 2],
    /// SHA-256 of the records.
    pub digest: String,
    /// Failed trials by the first stage that failed.
    pub failures: BTreeMap<FailureStage, u64>,
    /// Near-duplicates and how much of each part's surface accepted contacts touch, where the configuration is beside the data.
    pub acceptance: Option<AcceptanceSummary>,
    /// By grasp order.
    pub orders: BTreeMap<&'static str, Share>,
    /// By size of the object.
    pub sizes: Vec<Share>,
    /// By tenth of the trials, in order: whether acceptance changes as the label set grows.
    pub tenths: Vec<Share>,
    /// By part.
    pub parts: Vec<PartContacts>,
    /// Simulated steps of accepted trials.
    pub steps: Option<Spread>,
    /// Simulated steps of failed trials.
    pub failed_steps: Option<Spread>,
    /// Largest errors at the end of accepted trials: position (m), angle (rad), turning joint (rad), sliding joint (m).
    pub final_errors: [Option<Spread>; 4],
}

#[derive(Default)]
struct PartValues {
    tried: u64,
    by_arm: BTreeMap<u16, u64>,
    width: Vec<f64>,
    middle: [Vec<f64>; 3],
}

#[derive(Default)]
struct Values {
    steps: Vec<f64>,
    failed_steps: Vec<f64>,
    errors: [Vec<f64>; 4],
    parts: BTreeMap<u16, PartValues>,
    successes: Vec<bool>,
    failures: BTreeMap<FailureStage, u64>,
    orders: BTreeMap<&'static str, Share>,
    sizes: Vec<Share>,
}

impl Share {
    fn count(&mut self, success: bool) {
        self.trials += 1;
        self.successes += u64::from(success);
    }
}

impl Values {
    fn add(&mut self, record: &TrialRecord) {
        let success = record.outcome.is_success();
        self.successes.push(success);
        if let TrialOutcome::Failed(stage) = record.outcome {
            *self.failures.entry(stage).or_default() += 1;
        }
        self.orders.entry(record.order.name()).or_default().count(success);
        self.sizes[scene_of_trial(record.seed, record.index, usize::from(INSTANCES))].count(success);
        let steps = if success { &mut self.steps } else { &mut self.failed_steps };
        steps.push(record.steps as f64);
        for grasp in &record.grasps {
            let part = self.parts.entry(grasp.contact.part.0).or_default();
            part.tried += 1;
            if success {
                *part.by_arm.entry(grasp.arm.0).or_default() += 1;
                let [a, b] = grasp.contact.fingers;
                part.width.push((a - b).norm());
                let middle = nalgebra::center(&a, &b);
                part.middle.iter_mut().zip(middle.iter()).for_each(|(values, &value)| values.push(value));
            }
        }
        if success {
            self.errors.iter_mut().zip(record.final_errors).for_each(|(values, error)| values.push(error));
        }
    }
}

/// The statistics of a data set, read one round at a time.
pub fn statistics(directory: &Path) -> Result<Statistics, Failure> {
    let mut values = Values { sizes: vec![Share::default(); usize::from(INSTANCES)], ..Values::default() };
    let config = Config::load(Some(&directory.join("config.toml")), &[]).ok();
    let seed = RunInfo::load(directory).ok().map(|info| info.seed);
    let explorer = config.as_ref().zip(seed).and_then(|(config, seed)| Explorer::new(config, seed).ok());
    let mut learned = explorer.as_ref().map(Explorer::demonstrated);
    for round in dataset::rounds(directory).or_bad_input()? {
        let round = round.or_bad_input()?;
        round.iter().for_each(|record| values.add(record));
        if let Some((explorer, learned)) = explorer.as_ref().zip(learned.as_mut()) {
            explorer.learn(learned, &round);
        }
    }
    if values.successes.is_empty() {
        return Err(Failure::bad_input(format!("{}: no trials, expected a data set", directory.display())));
    }
    let names = explorer.as_ref().map(Explorer::part_names).unwrap_or_default();
    let parts = values.parts.into_iter().map(|(part, PartValues { tried, by_arm, width, middle })| PartContacts {
        part,
        name: names.get(usize::from(part)).cloned(),
        tried,
        accepted: width.len() as u64,
        by_arm,
        width: Spread::of(width),
        middle: middle.map(Spread::of),
    });
    let (trials, successes) = (values.successes.len() as u64, values.successes.iter().filter(|&&success| success).count() as u64);
    let mut tenths = vec![Share::default(); values.successes.len().min(10)];
    for (number, &success) in values.successes.iter().enumerate() {
        let count = tenths.len();
        tenths[number * count / values.successes.len()].count(success);
    }
    Ok(Statistics {
        trials,
        successes,
        rate: successes as f64 / trials as f64,
        wilson95: wilson95(successes, trials),
        digest: dataset::digest_of(directory).or_bad_input()?,
        failures: values.failures,
        acceptance: learned.as_ref().map(Learned::acceptance),
        orders: values.orders,
        sizes: values.sizes,
        tenths,
        parts: parts.collect(),
        steps: Spread::of(values.steps),
        failed_steps: Spread::of(values.failed_steps),
        final_errors: values.errors.map(Spread::of),
    })
}

impl Statistics {
    /// For people.
    pub fn table(&self) -> String {
        let [low, high] = self.wilson95.map(|bound| 100.0 * bound);
        let share = |share: &Share| format!("{}/{}", share.successes, share.trials);
        let mut text = format!(
            "{} trials, {} accepted: {:.1} % (95 % interval {low:.1} to {high:.1})\ndigest {}\n",
            self.trials,
            self.successes,
            100.0 * self.rate,
            self.digest
        );
        let list = |pairs: Vec<String>| if pairs.is_empty() { "none".to_owned() } else { pairs.join(", ") };
        text += &format!(
            "failures: {}\n",
            list(self.failures.iter().map(|(stage, count)| format!("{count} {}", stage.name())).collect())
        );
        if let Some(acceptance) = &self.acceptance {
            let covered = acceptance.coverage.iter().map(|(part, share)| format!("{part} {:.0} %", 100.0 * share));
            text += &format!("surface touched: {}\nnear-duplicates: {}\n", list(covered.collect()), acceptance.near_duplicates);
        }
        text += &format!("by order: {}\n", list(self.orders.iter().map(|(name, of)| format!("{name} {}", share(of))).collect()));
        text += &format!("by size:  {}\n", list(self.sizes.iter().map(share).collect()));
        text += &format!("by tenth: {}\n\n", list(self.tenths.iter().map(share).collect()));
        let mut rows = vec![["part", "name", "tried", "accepted", "by arm"].map(str::to_owned).to_vec()];
        for part in &self.parts {
            let arms = part.by_arm.iter().map(|(arm, count)| format!("{arm}: {count}")).collect();
            let name = part.name.clone().unwrap_or_default();
            rows.push(vec![part.part.to_string(), name, part.tried.to_string(), part.accepted.to_string(), list(arms)]);
        }
        text += &aligned(&rows, 2);
        text.push('\n');
        let mut rows = vec![["", "min", "median", "mean", "max"].map(str::to_owned).to_vec()];
        let mut row = |name: String, spread: Option<Spread>, unit: f64| {
            let Some(Spread { min, median, mean, max }) = spread else { return };
            rows.push(std::iter::once(name).chain([min, median, mean, max].map(|x| format!("{:.2}", x * unit))).collect());
        };
        row("steps, accepted".to_owned(), self.steps, 1.0);
        row("steps, failed".to_owned(), self.failed_steps, 1.0);
        for (name, spread, unit) in [
            ("end position (mm)", self.final_errors[0], 1e3),
            ("end angle (°)", self.final_errors[1], 1f64.to_degrees()),
            ("end joint (°)", self.final_errors[2], 1f64.to_degrees()),
            ("end joint (mm)", self.final_errors[3], 1e3),
        ] {
            row(name.to_owned(), spread, unit);
        }
        for part in &self.parts {
            row(format!("part {} width (mm)", part.part), part.width, 1e3);
            for (axis, spread) in ["x", "y", "z"].into_iter().zip(part.middle) {
                row(format!("part {} middle {axis} (mm)", part.part), spread, 1e3);
            }
        }
        text + &aligned(&rows, 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_that_of_the_finite_values() {
        let spread = Spread::of(vec![4.0, f64::INFINITY, 1.0, 2.0, 9.0]).unwrap();
        assert_eq!(spread, Spread { min: 1.0, median: 3.0, mean: 4.0, max: 9.0 });
        assert_eq!(Spread::of(vec![f64::NAN]), None);
        assert_eq!(Spread::of(vec![7.0]).unwrap().median, 7.0);
    }
}
