//! Explores objects with both robots and prints, as a Markdown table, what is accepted and what failed trials cost.
//!
//! Arguments: trials a cell, then objects (all of the catalogue if none). CPU time is that of the thread that runs the trials.

#[path = "../tests/support/mod.rs"]
mod support;

use std::error::Error;
use std::sync::Mutex;
use vmao_core::catalogue::{INSTANCES, InstanceSet, NAMES, item};
use vmao_core::order::GraspOrder;
use vmao_core::outcome::TrialOutcome;
use vmao_core::robots::{RobotModel, panda, sawyer};
use vmao_sim::{LabelSet, Layout, Proposals, Scene, SceneConfig, TrialConfig, explore_round, scene_of_trial};

const SEED: u64 = 0;
/// Algorithm 1 as shipped.
const ROUND: u64 = 16;
const RADIUS: f64 = 0.008;

/// One trial: its outcome, its CPU time (s) and its simulated steps.
type Cost = (TrialOutcome, f64, u64);

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let trials: u64 = arguments.next().ok_or("expected the number of trials, then objects")?.parse()?;
    let mut objects: Vec<String> = arguments.collect();
    if objects.is_empty() {
        objects = NAMES.iter().map(|&name| name.to_owned()).collect();
    }
    println!(
        "| object | robots | order | accepted | rate | tuples per core-minute | CPU s a success | CPU s a failure | \
         failure / success, CPU | failure / success, steps | failures |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for object in &objects {
        for robot in [panda(), sawyer(1)] {
            for order in [GraspOrder::Parallel, GraspOrder::Sequential] {
                println!("{}", row(object, &robot, order, &explore(object, &robot, order, trials)?));
            }
        }
    }
    Ok(())
}

/// Runs the trials of one cell as Algorithm 1 does, on one worker.
fn explore(object: &str, robot: &RobotModel, order: GraspOrder, trials: u64) -> Result<Vec<Cost>, Box<dyn Error>> {
    let (scene, config): (SceneConfig, TrialConfig) = support::configuration();
    let mut scenes = Vec::new();
    for instance in 0..INSTANCES {
        let item = item(object, InstanceSet::Train, instance).ok_or("no such object in the catalogue")?;
        let arms = item.object.parts.len();
        let layout = if arms > 2 { Layout::Ring } else { scene.layout };
        scenes.push(Scene::new(&SceneConfig { layout, ..scene.clone() }, vec![robot.clone(); arms], item)?);
    }
    let mut labels = LabelSet::demonstrated(&scenes);
    let proposals = Proposals { radius: RADIUS, orders: vec![order] };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let costs = Mutex::new(Vec::new());
    let mut first = 0;
    while first < trials {
        let last = (first + ROUND).min(trials);
        let round = pool.install(|| {
            let before = Mutex::new(thread_seconds());
            let done = |trial: &vmao_sim::Trial| {
                let now = thread_seconds();
                if let (Ok(mut before), Ok(mut costs)) = (before.lock(), costs.lock()) {
                    costs.push((trial.record.outcome, now - *before, trial.record.steps));
                    *before = now;
                }
            };
            explore_round(&scenes, &config, &labels, &proposals, (SEED, first..last), &done)
        });
        round.iter().for_each(|trial| labels.learn(scene_of_trial(SEED, trial.record.index, scenes.len()), &trial.record));
        first = last;
    }
    Ok(costs.into_inner()?)
}

/// CPU time of the calling thread (s), as Linux counts it.
fn thread_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|nanoseconds| nanoseconds.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-9
}

fn row(object: &str, robot: &RobotModel, order: GraspOrder, costs: &[Cost]) -> String {
    let (successes, failures): (Vec<&Cost>, Vec<&Cost>) = costs.iter().partition(|(outcome, ..)| outcome.is_success());
    let mean = |of: &[&Cost], value: fn(&Cost) -> f64| of.iter().map(|cost| value(cost)).sum::<f64>() / of.len() as f64;
    let (cpu, steps): (fn(&Cost) -> f64, fn(&Cost) -> f64) = (|cost| cost.1, |cost| cost.2 as f64);
    let shown = |value: f64| if value.is_finite() { format!("{value:.2}") } else { "–".to_owned() };
    let mut stages: Vec<(&str, usize)> = Vec::new();
    for (outcome, ..) in costs {
        if let TrialOutcome::Failed(stage) = outcome {
            match stages.iter_mut().find(|(name, _)| *name == stage.name()) {
                Some((_, count)) => *count += 1,
                None => stages.push((stage.name(), 1)),
            }
        }
    }
    stages.sort_by_key(|&(name, count)| (std::cmp::Reverse(count), name));
    let stages: Vec<String> = stages.iter().map(|(name, count)| format!("{count} {name}")).collect();
    let minutes = costs.iter().map(cpu).sum::<f64>() / 60.0;
    format!(
        "| `{object}` | {} | {} | {} of {} | {:.0} % | {:.0} | {} | {} | {} | {} | {} |",
        robot.name,
        format!("{order:?}").to_lowercase(),
        successes.len(),
        costs.len(),
        100.0 * successes.len() as f64 / costs.len() as f64,
        successes.len() as f64 / minutes,
        shown(mean(&successes, cpu)),
        shown(mean(&failures, cpu)),
        shown(mean(&failures, cpu) / mean(&successes, cpu)),
        shown(mean(&failures, steps) / mean(&successes, steps)),
        stages.join(", "),
    )
}
