//! How well the controller tracks: one arm moves its gripper by 20 cm and 90° in 2 s, free or with a bar in its pads.

use crate::error::Error;
use crate::scene::{Scene, SceneConfig};
use crate::simulation::{Grip, Simulation};
use crate::trial::TrialConfig;
use nalgebra::{Vector3, Vector6};
use std::f64::consts::FRAC_PI_2;
use vmao_core::catalogue::CatalogueItem;
use vmao_core::geometry::{Pose, interpolate, minimum_jerk, pose_distance, rotation_exp, rotation_log};
use vmao_core::object::{ArticulatedObject, Part};
use vmao_core::robots::RobotModel;
use vmao_core::shape::{Shape, Solid};

/// A motion of the gripper, world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// What it is called in tables.
    pub name: &'static str,
    /// Displacement (m).
    pub shift: Vector3<f64>,
    /// Rotation vector (rad).
    pub turn: Vector3<f64>,
    /// Duration (s).
    pub seconds: f64,
}

/// What the null space is drawn to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Posture {
    /// Where the arm is: to nothing.
    Own,
    /// Home, away from where the motion leads.
    Home,
}

/// How far the tool was from where it should have been.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingErrors {
    /// Root mean square over motion and rest: position (m) and rotation (rad).
    pub rms: [f64; 2],
    /// At the end of half a second of rest: position (m) and rotation (rad).
    pub settled: [f64; 2],
    /// Largest share of a joint's torque limit that was used (–).
    pub torque_share: f64,
    /// Whether the bar is between the pads at the end.
    pub held: bool,
}

/// Three motions of 20 cm and 90° in 2 s: level and about the vertical, down and back, up and about a slanted axis.
pub fn standard_moves() -> [Move; 3] {
    let quarter = Vector3::z() * FRAC_PI_2;
    [
        Move { name: "level", shift: Vector3::new(0.12, 0.16, 0.0), turn: quarter, seconds: 2.0 },
        Move { name: "down", shift: Vector3::new(0.12, -0.12, -0.106), turn: -quarter, seconds: 2.0 },
        Move {
            name: "slanted",
            shift: Vector3::new(0.0, 0.12, 0.16),
            turn: Vector3::new(0.6, 0.0, 0.8) * FRAC_PI_2,
            seconds: 2.0,
        },
    ]
}

/// Tracking errors of `robot` on `motion`, with a bar of `load` kg held in the pads, or nothing if that is zero.
///
/// The bar is grasped from the table and lifted first. Fails if the simulator refuses the scene.
pub fn track(
    robot: &RobotModel,
    scene: &SceneConfig,
    trial: &TrialConfig,
    load: f64,
    posture: Posture,
    motion: &Move,
) -> Result<TrackingErrors, Error> {
    let scene = Scene::new(scene, vec![robot.clone()], bar(load))?;
    let world_from_home = scene.world_from_bases[0] * robot.tool_chain().tool_pose(&robot.home);
    let mut world_from_bar = Pose::translation(world_from_home.translation.x, world_from_home.translation.y, BAR[2]);
    world_from_bar.rotation = across(&world_from_home);
    let mut simulation = Simulation::new(&scene, trial.osc, &world_from_bar, &[]);
    simulation.wait(0.3);
    if load > 0.0 {
        pick_up(&mut simulation, robot, trial, &world_from_home);
    }
    Ok(follow_tool_path(&mut simulation, posture, motion))
}

/// Half extents of the bar (m): thick enough for every gripper, long across the pads.
const BAR: [f64; 3] = [0.08, 0.01, 0.012];

fn bar(mass: f64) -> CatalogueItem {
    let solid = Solid { shape: Shape::Box { half_extents: BAR }, carrier_from_solid: Pose::identity(), color: [0.7, 0.5, 0.2] };
    let part = Part { name: "bar".to_owned(), solids: vec![solid], mass: if mass > 0.0 { mass } else { 0.1 } };
    let object = ArticulatedObject { name: "bar".to_owned(), parts: vec![part], joints: Vec::new() };
    CatalogueItem { object, demonstrations: Vec::new() }
}

/// The turn about the vertical that lays the bar square to the closing axis of a tool that points down.
fn across(world_from_tool: &Pose) -> nalgebra::UnitQuaternion<f64> {
    let closing = world_from_tool.rotation * Vector3::y();
    rotation_exp(&(Vector3::z() * (closing.y.atan2(closing.x) - FRAC_PI_2)))
}

/// Down to the bar, close, and up again to the pose that the arm has at home, each along a straight line.
fn pick_up(simulation: &mut Simulation<'_>, robot: &RobotModel, trial: &TrialConfig, world_from_home: &Pose) {
    let opening = robot.gripper.max_opening();
    let clearance = trial.grasp.table_clearance;
    let mut at_bar = *world_from_home;
    at_bar.translation.z = BAR[2];
    at_bar.translation.z += (clearance - robot.lowest_gripper_point(&at_bar, opening)).max(0.0);
    let down = Move {
        name: "down",
        shift: at_bar.translation.vector - world_from_home.translation.vector,
        turn: Vector3::zeros(),
        seconds: 3.0,
    };
    follow_tool_path(simulation, Posture::Home, &down);
    simulation.grips[0] = Grip::Close(trial.grasp.closing_force);
    simulation.wait(trial.grasp.closing_seconds);
    follow_tool_path(simulation, Posture::Home, &Move { name: "up", shift: -down.shift, ..down });
}

/// Moves the tool from where it is by `motion` in minimum jerk, then rests for half a second.
fn follow_tool_path(simulation: &mut Simulation<'_>, posture: Posture, motion: &Move) -> TrackingErrors {
    let start = simulation.goals[0].world_from_tool;
    let end = Pose::from_parts((start.translation.vector + motion.shift).into(), rotation_exp(&motion.turn) * start.rotation);
    let dt = simulation.scene.timestep;
    let at = |time: f64| interpolate(&start, &end, minimum_jerk(time, motion.seconds));
    let ticks = ((motion.seconds + 0.5) / dt).round() as usize;
    let (mut squares, mut settled, mut torque_share) = ([0.0; 2], [0.0; 2], 0.0_f64);
    for tick in 1..=ticks {
        let time = tick as f64 * dt;
        let (before, now) = (at(time - dt), at(time));
        let linear = (now.translation.vector - before.translation.vector) / dt;
        let angular = rotation_log(&(now.rotation * before.rotation.inverse())) / dt;
        simulation.goals[0].world_from_tool = now;
        simulation.goals[0].twist = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
        if posture == Posture::Own {
            simulation.goals[0].posture = simulation.joint_positions(0);
        }
        simulation.tick();
        let is = simulation.tool_pose(0);
        // Body poses are those at the start of the tick, where the goal before this one applied.
        settled = pose_distance(&is, &before);
        for (sum, error) in squares.iter_mut().zip(settled) {
            *sum += error * error;
        }
        let arm = &simulation.scene.arms[0];
        for (joint, limit) in arm.limits.torque.iter().enumerate() {
            torque_share = torque_share.max(simulation.data.ctrl()[arm.ctrl + joint].abs() / limit);
        }
    }
    let bar = simulation.object_state().world_from_parts[0].translation.vector;
    let held = (bar - simulation.tool_pose(0).translation.vector).norm() < 0.02;
    TrackingErrors { rms: squares.map(|sum| (sum / ticks as f64).sqrt()), settled, torque_share, held }
}
