//! Prints, as Markdown tables, how well the controller tracks and how hard arms that hold one object work against each other.

#[path = "../tests/support/mod.rs"]
mod support;

use std::error::Error;
use vmao_core::catalogue::{self, InstanceSet};
use vmao_core::contact_model::FixedTuple;
use vmao_core::order::GraspOrder;
use vmao_core::robots::{DEFAULT_SLOT, panda, sawyer};
use vmao_sim::tracking::{Posture, standard_moves, track};
use vmao_sim::{Layout, MotionMeasures, Recording, Scene, SceneConfig, TrialConfig, run_trial};

fn main() -> Result<(), Box<dyn Error>> {
    let (scene, trial) = support::configuration();
    tracking_errors(&scene, &trial)?;
    internal_forces(&scene, &trial)
}

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn tracking_errors(scene: &SceneConfig, trial: &TrialConfig) -> Result<(), Box<dyn Error>> {
    println!("| robot | held | posture | motion | RMS position | RMS rotation | settled position | settled rotation | torque |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for robot in [panda(), sawyer(DEFAULT_SLOT)] {
        for load in [0.0, 0.3] {
            for posture in [Posture::Own, Posture::Home] {
                for motion in standard_moves() {
                    let errors = track(&robot, scene, trial, load, posture, &motion)?;
                    let name = format!("{} | {load} kg | {posture:?} | {}", robot.name, motion.name).to_lowercase();
                    println!(
                        "| {name} | {:.3} mm | {:.3}° | {:.3} mm | {:.3}° | {:.0} % |",
                        errors.rms[0] * 1e3,
                        errors.rms[1].to_degrees(),
                        errors.settled[0] * 1e3,
                        errors.settled[1].to_degrees(),
                        errors.torque_share * 100.0,
                    );
                }
            }
        }
    }
    Ok(())
}

/// Demonstrated trials in parallel order: all arms hold the object while it moves.
#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn internal_forces(scene: &SceneConfig, trial: &TrialConfig) -> Result<(), Box<dyn Error>> {
    const TRIALS: u64 = 20;
    println!("\n| object | arms | succeeded | mean internal force | peak, median trial | peak, worst trial | part error RMS |");
    println!("|---|---|---|---|---|---|---|");
    for (object, robot, layout) in [
        ("pliers", panda(), Layout::Opposed),
        ("pliers", sawyer(1), Layout::Opposed),
        ("three-sticks", panda(), Layout::Ring),
        ("three-sticks", sawyer(1), Layout::TwoParallelOneOpposite),
    ] {
        let item = catalogue::item(object, InstanceSet::Train, 0).ok_or("no such object")?;
        let arms = item.object.parts.len();
        let scene = Scene::new(&SceneConfig { layout, ..scene.clone() }, vec![robot.clone(); arms], item)?;
        let model = FixedTuple(scene.demonstrations[0].clone());
        let run = |index| run_trial(&scene, trial, &model, GraspOrder::Parallel, (0, index), Recording::Off);
        let trials: Vec<_> = (0..TRIALS).map(run).filter(|trial| trial.record.outcome.is_success()).collect();
        let mut peaks: Vec<f64> = trials.iter().map(|trial| trial.motion.peak_internal_force).collect();
        peaks.sort_by(f64::total_cmp);
        let mean = |of: fn(&MotionMeasures) -> f64| trials.iter().map(|t| of(&t.motion)).sum::<f64>() / trials.len() as f64;
        println!(
            "| {object} | {arms} x {} | {} of {TRIALS} | {:.1} N | {:.1} N | {:.1} N | {:.2} mm |",
            robot.name,
            trials.len(),
            mean(|motion| motion.mean_internal_force),
            peaks[peaks.len() / 2],
            peaks[peaks.len() - 1],
            mean(|motion| motion.part_error) * 1e3,
        );
    }
    Ok(())
}
