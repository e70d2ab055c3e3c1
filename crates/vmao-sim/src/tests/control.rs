//! The controller on simulated arms: precision, and what happens where there is none to be had.

use super::settled;
use super::support::{configuration, mixed_scene};
use crate::simulation::Simulation;
use crate::tracking::{Posture, TrackingErrors, standard_moves, track};
use nalgebra::{Vector3, Vector6};
use vmao_core::geometry::{Pose, rotation_exp};
use vmao_core::osc::pose_error;
use vmao_core::robots::{DEFAULT_SLOT, panda, sawyer};

fn all_moves(load: f64, mut check: impl FnMut(&TrackingErrors, &str)) {
    let (scene, trial) = configuration();
    for robot in [panda(), sawyer(DEFAULT_SLOT)] {
        for posture in [Posture::Own, Posture::Home] {
            for motion in standard_moves() {
                assert!(motion.shift.norm() > 0.199 && motion.turn.norm() > 1.57 && motion.seconds <= 2.0, "{motion:?}");
                let errors = track(&robot, &scene, &trial, load, posture, &motion).unwrap();
                check(&errors, &format!("{}, {load} kg, {posture:?}, {}: {errors:?}", robot.name, motion.name));
            }
        }
    }
}

#[test]
fn a_free_hand_follows_20_cm_and_90_degrees_in_2_s_and_settles() {
    all_moves(0.0, |errors, what| {
        assert!(errors.rms[0] < 2e-3 && errors.rms[1].to_degrees() < 1.0, "{what}");
        assert!(errors.settled[0] < 0.05e-3 && errors.settled[1].to_degrees() < 0.05, "{what}");
        assert!(errors.torque_share < 0.8 && !errors.held, "{what}");
    });
}

#[test]
fn a_hand_that_holds_300_g_follows_nearly_as_well() {
    all_moves(0.3, |errors, what| {
        assert!(errors.held, "{what}");
        assert!(errors.rms[0] < 4e-3 && errors.rms[1].to_degrees() < 2.0, "{what}");
        assert!(errors.torque_share < 0.8, "{what}");
    });
}

/// What an arm did on a way that it cannot follow.
#[derive(Debug, Default)]
struct Strain {
    /// Largest joint speed over its limit (–).
    speed_share: f64,
    /// How often a joint's torque went from one limit to the other within 20 ms.
    flips: u32,
    /// Ticks in which a joint was at its torque limit.
    saturated: u32,
    /// Largest joint speed in the last half second (rad/s).
    last_speed: f64,
}

/// Moves arm `arm`'s goal by `shift` and `turn` there and back again, 2 s each way, with a second of rest at both ends.
fn there_and_back(simulation: &mut Simulation<'_>, arm: usize, shift: Vector3<f64>, turn: Vector3<f64>) -> Strain {
    let (scene, start) = (simulation.scene, simulation.goals[arm].world_from_tool);
    let (index, robot) = (&scene.arms[arm], &scene.robots[arm]);
    let mut strain = Strain::default();
    let mut at_limit = [(0.0, 0); 7];
    let ticks_of = |seconds: f64| (seconds / scene.timestep).round() as i64;
    for tick in 0..ticks_of(6.0) {
        let time = tick as f64 * scene.timestep;
        let share = if time < 3.0 { (time / 2.0).min(1.0) } else { 1.0 - ((time - 3.0) / 2.0).min(1.0) };
        let rotation = rotation_exp(&(turn * share)) * start.rotation;
        simulation.goals[arm].world_from_tool = Pose::from_parts((start.translation.vector + shift * share).into(), rotation);
        simulation.goals[arm].twist = Vector6::zeros();
        simulation.tick();
        let mut saturated = false;
        for joint in 0..7 {
            let speed = simulation.data.qvel()[index.dof + joint].abs();
            strain.speed_share = strain.speed_share.max(speed / robot.joints[joint].max_velocity);
            if tick >= ticks_of(5.5) {
                strain.last_speed = strain.last_speed.max(speed);
            }
            let torque = simulation.data.ctrl()[index.ctrl + joint];
            if torque.abs() >= 0.999 * robot.joints[joint].max_torque {
                saturated = true;
                let (before, when) = at_limit[joint];
                strain.flips += u32::from(before * torque < 0.0 && tick - when < ticks_of(0.02));
                at_limit[joint] = (torque.signum(), tick);
            }
        }
        strain.saturated += u32::from(saturated);
    }
    strain
}

#[test]
fn out_of_reach_and_at_limits_an_arm_stays_calm_and_comes_back() {
    let scene = mixed_scene();
    let far = [
        ("stretched out", Vector3::new(0.9, 0.0, 0.2), Vector3::zeros()),
        ("straight up", Vector3::new(-0.1, 0.0, 0.9), Vector3::zeros()),
        ("over the shoulder", Vector3::new(-0.45, 0.0, 0.2), Vector3::zeros()),
        ("wrist beyond its range", Vector3::zeros(), Vector3::z() * 3.0),
        ("bent back", Vector3::zeros(), Vector3::y() * 2.5),
    ];
    for arm in 0..2 {
        for (what, shift, turn) in far {
            let mut simulation = settled(&scene, 0);
            let start = simulation.tool_pose(arm);
            let base = scene.world_from_bases[arm].rotation;
            let strain = there_and_back(&mut simulation, arm, base * shift, base * turn);
            let error = pose_error(&start, &simulation.tool_pose(arm));
            let [position, rotation] = [0, 3].map(|row| error.fixed_rows::<3>(row).norm());
            let what = format!("{}, {what}: {strain:?}, then {position} m and {rotation} rad off", scene.robots[arm].name);
            assert!(strain.speed_share < 1.5 && strain.flips == 0 && strain.saturated < 300, "{what}");
            assert!(strain.last_speed < 0.01 && position < 0.5e-3 && rotation.to_degrees() < 0.2, "{what}");
        }
    }
}
