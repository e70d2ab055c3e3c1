//! What the trials of a cell say: each root by itself and beside the best, and what `auto` would have chosen.

use crate::cells::Cell;
use crate::run::{Line, file_of, lines, seed};
use crate::support;
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::error::Error;
use vmao_core::catalogue::InstanceSet;
use vmao_core::contact::PartId;
use vmao_core::object_centric::part_poses;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_sim::{MotionMeasures, Scene, choose_root, predict, scene_of_trial};

/// One root's trials, or those that `auto` chose among them.
pub(crate) struct Choice {
    pub(crate) name: String,
    pub(crate) trials: BTreeMap<u64, Line>,
    /// Of how many trials each root is the one chosen.
    pub(crate) chosen: Vec<usize>,
}

/// A cell's trials on one set of sizes; the last choice is `auto`.
pub(crate) struct Study {
    pub(crate) choices: Vec<Choice>,
    /// The trials in which all roots succeed that succeed at least half as often as the best.
    pub(crate) common: Vec<u64>,
    /// Predicted and measured length of the hands' ways (m), of all trials that succeeded.
    pub(crate) predicted: Vec<(usize, f64, f64)>,
    /// Predicted moments on the grippers (N·m), by root.
    pub(crate) moments: Vec<Vec<f64>>,
    /// Of each root: distance from its own place to hold to the farthest other one, joints in the middle (m).
    pub(crate) levers: Vec<f64>,
}

impl Choice {
    pub(crate) fn successes(&self) -> usize {
        self.trials.values().filter(|line| line.outcome.is_success()).count()
    }

    pub(crate) fn failures(&self, stage: FailureStage) -> usize {
        self.trials.values().filter(|line| line.outcome == TrialOutcome::Failed(stage)).count()
    }

    fn succeeds(&self, index: u64) -> bool {
        self.trials.get(&index).is_some_and(|line| line.outcome.is_success())
    }

    /// Mean of a measure over those of `common` that succeeded, and how many these are.
    pub(crate) fn mean(&self, common: &[u64], of: fn(&MotionMeasures) -> f64) -> (f64, usize) {
        let values: Vec<f64> =
            common.iter().filter(|&&index| self.succeeds(index)).map(|index| of(&self.trials[index].motion)).collect();
        (values.iter().sum::<f64>() / values.len() as f64, values.len())
    }

    /// The two-sided exact p-value of McNemar's test that this choice and `other` succeed equally often.
    pub(crate) fn mcnemar(&self, other: &Self) -> ([usize; 2], f64) {
        let only = |a: &Self, b: &Self| a.trials.keys().filter(|&&index| a.succeeds(index) && !b.succeeds(index)).count();
        let discordant = [only(self, other), only(other, self)];
        let (fewer, all) = (discordant[0].min(discordant[1]), discordant[0] + discordant[1]);
        // Σ C(n, k) / 2ⁿ for k up to the smaller count, on both sides.
        let mut term = 0.5_f64.powi(all as i32);
        let mut sum = 0.0;
        for k in 0..=fewer {
            sum += term;
            term *= (all - k) as f64 / (k + 1) as f64;
        }
        (discordant, (2.0 * sum).min(1.0))
    }
}

/// Ratio of means with its 95 % interval from the spread of paired ratios; none where there are too few pairs.
pub(crate) fn paired_ratio(choice: &Choice, first: &Choice, common: &[u64], of: fn(&MotionMeasures) -> f64) -> Option<[f64; 3]> {
    let pairs = common.iter().filter(|&&index| choice.succeeds(index) && first.succeeds(index));
    let logs: Vec<f64> = pairs.map(|index| (of(&choice.trials[index].motion) / of(&first.trials[index].motion)).ln()).collect();
    let n = logs.len() as f64;
    if logs.len() < 8 {
        return None;
    }
    let mean = logs.iter().sum::<f64>() / n;
    let variance = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let half = 1.96 * (variance / n).sqrt();
    Some([mean - half, mean, mean + half].map(f64::exp))
}

impl Study {
    /// Reads what was run of this cell; none if nothing was.
    /// Trials before number `first` are left out.
    pub(crate) fn read(directory: &str, cell: &Cell, set: InstanceSet, first: u64) -> Result<Option<Self>, Box<dyn Error>> {
        let mut by_root: Vec<BTreeMap<u64, Line>> = vec![BTreeMap::new(); cell.roots()?.len()];
        for line in lines(&file_of(directory, cell, set))? {
            if line.index >= first {
                by_root[usize::from(line.root)].insert(line.index, line);
            }
        }
        // A run that was cut short has trials that not all roots met.
        let everywhere: Vec<u64> =
            by_root[0].keys().copied().filter(|index| by_root.iter().all(|lines| lines.contains_key(index))).collect();
        by_root.iter_mut().for_each(|lines| lines.retain(|index, _| everywhere.contains(index)));
        if everywhere.is_empty() {
            return Ok(None);
        }
        let (physics, config) = support::configuration();
        let scenes = cell.scenes(&physics, set, "auto")?;
        let (mut auto, mut chosen, mut predicted) = (BTreeMap::new(), vec![0; by_root.len()], Vec::new());
        let mut moments = vec![Vec::new(); by_root.len()];
        for &index in &everywhere {
            let scene = &scenes[scene_of_trial(seed(set), index, scenes.len())];
            for (root, lines) in by_root.iter().enumerate() {
                let line = &lines[&index];
                let motion = predict(scene, &config.motion, cell.order, &line.start, &line.goal);
                moments[root].push(motion.moment);
                if line.outcome.is_success() {
                    predicted.push((root, motion.hand_path, line.motion.hand_path));
                }
            }
            let line = &by_root[0][&index];
            let root = usize::from(choose_root(scene, &config, cell.order, &line.start, &line.goal).0);
            chosen[root] += 1;
            auto.insert(index, by_root[root][&index].clone());
        }
        let mut choices: Vec<Choice> =
            cell.roots()?.into_iter().zip(by_root).map(|(name, trials)| Choice { name, trials, chosen: Vec::new() }).collect();
        let best = choices.iter().map(Choice::successes).max().unwrap_or(0);
        let sound: Vec<&Choice> = choices.iter().filter(|choice| 2 * choice.successes() >= best).collect();
        let common = everywhere.iter().copied().filter(|&index| sound.iter().all(|choice| choice.succeeds(index))).collect();
        choices.push(Choice { name: "auto".to_owned(), trials: auto, chosen });
        Ok(Some(Self { choices, common, predicted, moments, levers: levers(&scenes[0]) }))
    }

    pub(crate) fn trials(&self) -> usize {
        self.choices[0].trials.len()
    }

    /// The fixed root that succeeds most often; the first among equals.
    pub(crate) fn best(&self) -> usize {
        let fixed = 0..self.choices.len() - 1;
        fixed.rev().max_by_key(|&root| self.choices[root].successes()).unwrap_or(0)
    }
}

fn levers(scene: &Scene) -> Vec<f64> {
    let middle = |joint: &vmao_core::object::Joint| joint.limits.map_or(0.0, |[low, high]| (low + high) / 2.0);
    let joints: Vec<f64> = scene.object.joints.iter().map(middle).collect();
    let poses = part_poses(&scene.object, &scene.graph, PartId(0), &vmao_core::geometry::Pose::identity(), &joints);
    let held = |part: usize| -> Point3<f64> {
        let contacts = scene.demonstrations.iter().flatten().filter(|contact| usize::from(contact.part.0) == part);
        let middles: Vec<_> = contacts.map(|contact| nalgebra::center(&contact.fingers[0], &contact.fingers[1]).coords).collect();
        poses[part] * Point3::from(middles.iter().sum::<nalgebra::Vector3<f64>>() / middles.len() as f64)
    };
    let places: Vec<Point3<f64>> = (0..poses.len()).map(held).collect();
    places.iter().map(|root| places.iter().map(|place| (place - root).norm()).fold(0.0, f64::max)).collect()
}
