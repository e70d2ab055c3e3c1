//! Prints the controller's tracking errors for both robots as a Markdown table.

use std::error::Error;
use vmao_core::osc::OscGains;
use vmao_core::robots::{DEFAULT_SLOT, panda, sawyer};
use vmao_sim::tracking::{Posture, standard_moves, track};
use vmao_sim::{CameraConfig, GoalConfig, GraspConfig, MotionConfig, SceneConfig, StartConfig, Thresholds, TrialConfig};

/// The sections of the shipped configuration that a trial needs.
#[derive(serde::Deserialize)]
struct Shipped {
    scene: SceneConfig,
    start: StartConfig,
    goal: GoalConfig,
    thresholds: Thresholds,
    cameras: CameraConfig,
    grasp: GraspConfig,
    motion: MotionConfig,
    osc: OscGains,
}

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let Shipped { scene, start, goal, thresholds, cameras, grasp, motion, osc } =
        toml::from_str(include_str!("../../../configs/demo.toml"))?;
    let trial = TrialConfig { start, goal, thresholds, cameras, grasp, motion, osc };
    println!("| robot | held | posture | motion | RMS position | RMS rotation | settled position | settled rotation | torque |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for robot in [panda(), sawyer(DEFAULT_SLOT)] {
        for load in [0.0, 0.3] {
            for posture in [Posture::Own, Posture::Home] {
                for motion in standard_moves() {
                    let errors = track(&robot, &scene, &trial, load, posture, &motion)?;
                    println!(
                        "| {} | {load} kg | {} | {} | {:.3} mm | {:.3}° | {:.3} mm | {:.3}° | {:.0} % |",
                        robot.name,
                        format!("{posture:?}").to_lowercase(),
                        motion.name,
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
