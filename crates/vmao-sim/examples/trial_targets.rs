//! Runs trials and writes what their controllers were asked for, so that a peer can be driven in the same way.
//!
//! Arguments: object, robot, order, how many, a folder. Prints one line of JSON a trial; scene.xml and INDEX.bin go to the folder.

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::Vector6;
use std::error::Error;
use std::path::Path;
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::contact_model::JitteredTuple;
use vmao_core::geometry::{Pose, position_quaternion};
use vmao_core::object_centric::part_poses;
use vmao_core::order::GraspOrder;
use vmao_core::osc::{GripperGoal, JointVector, OscGains};
use vmao_core::robots::{panda, sawyer};
use vmao_sim::targets::{Drive, Targets};
use vmao_sim::{Layout, Recording, Scene, SceneConfig, run_trial};

const SEED: u64 = 0;
const RADIUS: f64 = 0.008;

#[expect(clippy::print_stdout, reason = "a measurement is printed")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, object, robot, order, count, folder] = arguments.as_slice() else {
        return Err("expected five arguments: object, panda or sawyer, parallel or sequential, number of trials, folder".into());
    };
    let order = if order == "parallel" { GraspOrder::Parallel } else { GraspOrder::Sequential };
    let (scene, config) = support::configuration();
    let item = item(object, InstanceSet::Train, 0).ok_or("no such object in the catalogue")?;
    let arms = vec![if robot == "sawyer" { sawyer(1) } else { panda() }; item.object.parts.len()];
    let layout = if arms.len() > 2 { Layout::Ring } else { scene.layout };
    let scene = Scene::new(&SceneConfig { layout, ..scene }, arms, item)?;
    std::fs::write(Path::new(folder).join("scene.xml"), &scene.mjcf)?;
    let model = JitteredTuple { tuple: scene.demonstrations[0].clone(), radius: RADIUS };
    let run = |index, recording| run_trial(&scene, &config, &model, order, (SEED, index), recording);
    for index in 0..count.parse()? {
        let before = support::thread_seconds();
        let record = run(index, Recording::Off).record;
        let seconds = support::thread_seconds() - before;
        let trial = run(index, Recording::Targets);
        let targets = trial.targets.ok_or("a trial that was to keep its targets has none")?;
        let commands = targets.ticks.iter().flatten().flat_map(|(goal, drive)| numbers(goal, *drive));
        std::fs::write(Path::new(folder).join(format!("{index}.bin")), commands.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())?;
        let goal = &record.goal;
        let parts = part_poses(&scene.object, &scene.graph, goal.root, &goal.world_from_root, &goal.joint_positions);
        let parts: Vec<String> =
            scene.object.parts.iter().zip(&parts).map(|(part, pose)| format!(r#""{}": {:?}"#, part.name, flat(pose))).collect();
        println!(
            r#"{{"index": {index}, "seconds": {seconds}, "steps": {}, "success": {}, "errors": {:?}, "qpos": {:?}, "goal": {{{}}}, "gains": {}, "velocity": {:?}, "spring": {}}}"#,
            record.steps,
            record.outcome.is_success(),
            record.final_errors,
            targets.qpos,
            parts.join(", "),
            described(&config.osc),
            scene.robots[0].joints.iter().map(|joint| joint.max_velocity).collect::<Vec<_>>(),
            Targets::STIFFNESS,
        );
    }
    Ok(())
}

fn flat(pose: &Pose) -> Vec<f64> {
    let (position, quaternion) = position_quaternion(pose);
    position.into_iter().chain(quaternion).collect()
}

/// Position, quaternion w x y z, twist, posture, then 0 and the fingers' way or 1 and their force.
fn numbers(goal: &GripperGoal, drive: Drive) -> Vec<f64> {
    let (twist, posture): (&Vector6<f64>, &JointVector) = (&goal.twist, &goal.posture);
    let drive = match drive {
        Drive::Open(travel) => [0.0, travel],
        Drive::Close(force) => [1.0, force],
    };
    flat(&goal.world_from_tool).into_iter().chain(twist.iter().copied()).chain(posture.iter().copied()).chain(drive).collect()
}

fn described(gains: &OscGains) -> String {
    format!(
        r#"{{"position": {}, "rotation": {}, "ratio": {}, "posture": {}, "damping": {}, "onset": {}, "far": {}, "turned": {}}}"#,
        gains.position_stiffness,
        gains.rotation_stiffness,
        gains.damping_ratio,
        gains.posture_stiffness,
        gains.singularity_damping,
        gains.singularity_onset,
        gains.max_position_error,
        gains.max_rotation_error,
    )
}
