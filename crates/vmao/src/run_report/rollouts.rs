//! Which motions a report carries: all trials if they fit, else every failure class and a spread of successes.

use crate::evaluation::{Evaluation, TrialLine};
use crate::failure::Failure;
use crate::output::progress_bar;
use crate::report::{FailureClass, RolloutFigure, TrialPlace, explanation};
use crate::rollouts::{PackedRollout, StoredRollouts};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_sim::Recording;

/// Bytes of motions that a page may carry, so that all of it stays under 20 MB.
const BUDGET: usize = 17_500_000;
/// Bytes that a motion's stages, contacts and words take in a page, about.
const WORDS: usize = 350;
/// Trials that are run again for a report at most, where a run kept no motions.
const RUN_AGAIN: usize = 16;

/// The motions of a report, what to say of them, and the failure classes that they are examples of.
#[derive(Debug)]
pub(super) struct Motions {
    pub(super) figures: Vec<RolloutFigure>,
    pub(super) note: String,
    pub(super) classes: Vec<FailureClass>,
}

/// Collects the motions of the table's trials: those that the run keeps, and where it keeps none, some that are run again.
pub(super) fn motions(evaluation: &Evaluation<'_>, stored: &StoredRollouts, lines: &[TrialLine]) -> Result<Motions, Failure> {
    let order = by_interest(lines);
    let mut kept: Vec<Option<PackedRollout>> = lines.par_iter().map(|line| stored.read(line)).collect::<Result<_, Failure>>()?;
    let missing: Vec<usize> = order.iter().copied().filter(|&line| kept[line].is_none()).take(RUN_AGAIN).collect();
    let bar = progress_bar("run again for the report", missing.len() as u64);
    let run = |&line: &usize| {
        let TrialLine { order, method, index, .. } = lines[line];
        let rollout = evaluation.trial(order, method, index, Recording::On).and_then(|trial| trial.rollout);
        bar.inc(1);
        Ok((line, rollout.map(|rollout| PackedRollout::pack(&rollout)).transpose()?))
    };
    let mut run: BTreeMap<usize, Option<PackedRollout>> = missing.par_iter().map(run).collect::<Result<_, Failure>>()?;
    bar.finish();
    let mut shown: BTreeMap<usize, PackedRollout> = BTreeMap::new();
    let (mut bytes, mut things) = (0, BTreeSet::new());
    for line in order {
        let Some(rollout) = kept[line].take().or_else(|| run.remove(&line)?) else { continue };
        bytes += WORDS + rollout.motion.len() + rollout.forces.len();
        if things.insert(rollout.bodies.clone()) {
            bytes += rollout.bodies.len();
        }
        if bytes > BUDGET {
            break;
        }
        shown.insert(line, rollout);
    }
    let places: Vec<usize> = shown.keys().copied().collect();
    let figures = shown.into_iter().map(|(line, rollout)| figure(&lines[line], rollout)).collect();
    Ok(Motions { figures, note: note(places.len(), lines.len()), classes: classes(lines, &places) })
}

fn note(shown: usize, all: usize) -> String {
    if shown == all {
        return format!("All {all} trials of the table can be played.");
    }
    format!(
        "{shown} of the table's {all} trials can be played here: examples of every failure class first, then successes of every row, spread evenly."
    )
}

fn figure(line: &TrialLine, rollout: PackedRollout) -> RolloutFigure {
    let (what, failed) = match line.outcome {
        TrialOutcome::Success => ("Success".to_owned(), None),
        TrialOutcome::Failed(stage) => (format!("Failure: {}", stage.name()), Some(stage)),
    };
    let title = format!("{what} · {} · {} · trial {}", line.order.name(), line.method.title(), line.index);
    let trial = TrialPlace { order: line.order, method: line.method.name().to_owned(), index: line.index, failed };
    RolloutFigure { title, caption: line.detail.clone(), trial: Some(trial), rollout }
}

/// All lines, the most telling first: failure classes in turn, each by how far its trials came; then successes, cells in turn.
fn by_interest(lines: &[TrialLine]) -> Vec<usize> {
    let mut classes: BTreeMap<FailureStage, Vec<usize>> = BTreeMap::new();
    let mut cells: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (place, line) in lines.iter().enumerate() {
        match line.outcome {
            TrialOutcome::Failed(stage) => classes.entry(stage).or_default().push(place),
            TrialOutcome::Success => cells.entry((line.order, line.method)).or_default().push(place),
        }
    }
    for class in classes.values_mut() {
        // One that ended before anything moved has little to play.
        class.sort_by_key(|&place| (std::cmp::Reverse(lines[place].steps), place));
    }
    let successes: Vec<Vec<usize>> = cells.into_values().map(|cell| spread(&cell)).collect();
    let mut all = in_turn(&classes.into_values().collect::<Vec<_>>());
    all.extend(in_turn(&successes));
    all
}

/// The first of each list, the second of each, and so on.
fn in_turn(lists: &[Vec<usize>]) -> Vec<usize> {
    let longest = lists.iter().map(Vec::len).max().unwrap_or(0);
    (0..longest).flat_map(|rank| lists.iter().filter_map(move |list| list.get(rank).copied())).collect()
}

/// The same values so that any number of the first are spread over all: the first, the middle, the quarters, the eighths.
fn spread(values: &[usize]) -> Vec<usize> {
    let (mut order, mut taken) = (Vec::with_capacity(values.len()), BTreeSet::new());
    let mut step = values.len().next_power_of_two();
    while step > 0 {
        for place in (0..values.len()).step_by(step) {
            if taken.insert(place) {
                order.push(values[place]);
            }
        }
        step /= 2;
    }
    order
}

/// The classes that occurred, each with the example that came furthest among the lines at `shown`.
fn classes(lines: &[TrialLine], shown: &[usize]) -> Vec<FailureClass> {
    let failed = |line: &TrialLine, stage| line.outcome == TrialOutcome::Failed(stage);
    let class = |stage: FailureStage| {
        let count = lines.iter().filter(|line| failed(line, stage)).count() as u64;
        let of_class = shown.iter().enumerate().filter(|&(_, &line)| failed(&lines[line], stage));
        let example = of_class.max_by_key(|&(_, &line)| (lines[line].steps, std::cmp::Reverse(line))).map(|(place, _)| place);
        let [meaning, remedy] = explanation(stage);
        FailureClass { stage, count, meaning, remedy, example }
    };
    FailureStage::ALL.map(class).into_iter().filter(|class| class.count > 0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::Method;
    use vmao_core::order::GraspOrder;
    use vmao_sim::GoalReach;

    fn line(method: Method, index: u64, outcome: TrialOutcome, steps: u64) -> TrialLine {
        let (order, detail, final_errors) = (GraspOrder::Sequential, String::new(), [0.0; 4]);
        let (threshold_factor, goal, root) = (None, GoalReach::default(), 0);
        TrialLine { order, method, index, outcome, detail, steps, final_errors, threshold_factor, goal, root }
    }

    #[test]
    fn every_failure_class_comes_before_any_success_and_the_furthest_first() {
        let slip = TrialOutcome::Failed(FailureStage::Slip);
        let plan = TrialOutcome::Failed(FailureStage::NoPlan);
        let lines = [
            line(Method::Vmao, 0, TrialOutcome::Success, 9),
            line(Method::Vmao, 1, slip, 5),
            line(Method::Vmao, 2, slip, 7),
            line(Method::Top1, 0, plan, 1),
            line(Method::Top1, 1, TrialOutcome::Success, 9),
            line(Method::Top1, 2, TrialOutcome::Success, 9),
        ];
        assert_eq!(by_interest(&lines), [3, 2, 1, 0, 4, 5]);
        let found = classes(&lines, &[1, 2, 3]);
        let places: Vec<_> = found.iter().map(|class| (class.stage, class.count, class.example)).collect();
        assert_eq!(places, [(FailureStage::NoPlan, 1, Some(2)), (FailureStage::Slip, 2, Some(1))]);
        assert_eq!(classes(&lines, &[])[0].example, None);
    }

    #[test]
    fn the_first_of_a_spread_cover_it_and_all_come_once() {
        let values: Vec<usize> = (100..113).collect();
        let mut spread = spread(&values);
        assert_eq!(spread[..4], [100, 108, 104, 112]);
        spread.sort_unstable();
        assert_eq!(spread, values);
    }

    #[test]
    fn a_page_says_how_many_of_how_many() {
        assert!(note(40, 40).starts_with("All 40"));
        assert!(note(7, 900).contains("7 of the table's 900"));
    }
}
