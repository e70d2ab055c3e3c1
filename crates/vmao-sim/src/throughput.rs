//! How fast arms can be simulated under control: random motions of all hands beside the object, nothing else.

use crate::profile::{Stage, time};
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::task::{StartConfig, sample_start};
use nalgebra::Vector3;
use vmao_core::geometry::{Pose, pose_distance, rotation_exp};
use vmao_core::osc::OscGains;
use vmao_core::random::Stream;

/// What a rollout did.
#[derive(Debug, Clone, PartialEq)]
pub struct Rollout {
    /// Physics steps, each with torques of its own for every arm.
    pub steps: u64,
    /// Contacts, mean over the steps.
    pub contacts: f64,
    /// How far each hand went in all (m).
    pub hand_paths: Vec<f64>,
    /// Mean distance of the hands from their goals at the end of each command: position (m) and rotation (rad).
    pub errors: [f64; 2],
}

/// Commands a second, as in common simulators of manipulation.
const COMMANDS_PER_SECOND: f64 = 20.0;
/// Largest change of a hand's goal by one command along each axis: m and rad.
const STEP: [f64; 2] = [0.015, 0.15];
/// Furthest that a goal strays from the pose at home along each axis: m and rad.
const RANGE: [f64; 2] = [0.12, 0.5];

/// Every arm follows random goals around its home pose for `seconds` of simulated time.
pub fn random_rollout(scene: &Scene, gains: OscGains, start: &StartConfig, seconds: f64, seed: u64) -> Rollout {
    let mut stream = Stream::new(seed, &[0]);
    let (world_from_root, joints) = sample_start(scene, start, &mut stream);
    let mut simulation = Simulation::new(scene, gains, &world_from_root, &joints);
    let arms = scene.arms.len();
    let homes: Vec<Pose> = (0..arms).map(|arm| simulation.tool_pose(arm)).collect();
    let mut offsets = vec![[Vector3::<f64>::zeros(); 2]; arms];
    let ticks = (1.0 / COMMANDS_PER_SECOND / scene.timestep).round() as u64;
    let commands = (seconds * COMMANDS_PER_SECOND).round() as u64;
    let mut rollout = Rollout { steps: 0, contacts: 0.0, hand_paths: vec![0.0; arms], errors: [0.0; 2] };
    for _ in 0..commands {
        for arm in 0..arms {
            for (kind, offset) in offsets[arm].iter_mut().enumerate() {
                let moved = offset.map(|value| (value + stream.range(-STEP[kind], STEP[kind])).clamp(-RANGE[kind], RANGE[kind]));
                *offset = moved;
            }
            let [shift, turn] = offsets[arm];
            simulation.goals[arm].world_from_tool =
                Pose::from_parts((homes[arm].translation.vector + shift).into(), rotation_exp(&turn) * homes[arm].rotation);
        }
        let before: Vec<Pose> = (0..arms).map(|arm| simulation.tool_pose(arm)).collect();
        time(Stage::Control, || {
            for _ in 0..ticks {
                simulation.tick();
                rollout.contacts += simulation.data.contact().len() as f64;
            }
        });
        for arm in 0..arms {
            let (now, goal) = (simulation.tool_pose(arm), simulation.goals[arm].world_from_tool);
            rollout.hand_paths[arm] += (now.translation.vector - before[arm].translation.vector).norm();
            let [position, rotation] = pose_distance(&now, &goal);
            rollout.errors[0] += position;
            rollout.errors[1] += rotation;
        }
    }
    rollout.steps = simulation.steps;
    rollout.contacts /= rollout.steps.max(1) as f64;
    rollout.errors = rollout.errors.map(|sum| sum / (commands.max(1) as f64 * arms as f64));
    rollout
}
