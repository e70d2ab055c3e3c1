//! The controller on the simulated arm: how well a Panda tracks a motion of 20 cm and 90° in 2 s.

use super::settled;
use super::support::scene;
use nalgebra::{Vector3, Vector6};
use vmao_core::geometry::{Pose, interpolate, minimum_jerk, rotation_distance, rotation_exp, rotation_log};

const SECONDS: f64 = 2.0;

/// What the null space is drawn to.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Posture {
    /// Where the arm is: to nothing.
    Own,
    /// Home, away from where the motion leads.
    Home,
}

/// Position error (m) and rotation error (rad) at every tick of the motion and of half a second after it.
fn track(turn: Vector3<f64>, shift: Vector3<f64>, posture: Posture) -> Vec<[f64; 2]> {
    let scene = scene(0);
    let mut simulation = settled(&scene, 0);
    let start = simulation.tool_pose(0);
    let mut end = start;
    end.translation.vector += shift;
    end.rotation = rotation_exp(&turn) * start.rotation;
    let dt = scene.timestep;
    let at = |time: f64| -> Pose { interpolate(&start, &end, minimum_jerk(time, SECONDS)) };
    (1..=((SECONDS + 0.5) / dt).round() as usize)
        .map(|tick| {
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
            [(is.translation.vector - before.translation.vector).norm(), rotation_distance(&is.rotation, &before.rotation)]
        })
        .collect()
}

#[test]
fn a_panda_tracks_a_fast_motion_and_settles_at_its_end() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let motions: [(Vector3<f64>, Vector3<f64>); 3] = [
        (Vector3::z() * quarter, Vector3::new(0.12, 0.16, 0.0)),
        (Vector3::z() * -quarter, Vector3::new(0.12, -0.12, -0.106)),
        (Vector3::new(0.6, 0.0, 0.8) * quarter, Vector3::new(0.0, 0.12, 0.16)),
    ];
    // A far posture leaks into the task by the damping of singularities, ε (A + εI)⁻¹ of its pull, A = J M⁻¹ Jᵀ.
    for (posture, settled) in [(Posture::Own, 0.05e-3), (Posture::Home, 0.5e-3)] {
        for (turn, shift) in motions {
            assert!((shift.norm() - 0.2).abs() < 1e-3 && (turn.norm() - quarter).abs() < 1e-9);
            let errors = track(turn, shift, posture);
            let sum = |which: usize| errors.iter().map(|error| error[which].powi(2)).sum::<f64>();
            let [position, rotation] = [0, 1].map(|which| (sum(which) / errors.len() as f64).sqrt());
            let [last_position, last_rotation] = *errors.last().unwrap();
            let measured = format!(
                "{posture:?}: rms {:.3} mm {:.3}°, settled {:.4} mm {:.4}°",
                position * 1e3,
                rotation.to_degrees(),
                last_position * 1e3,
                last_rotation.to_degrees()
            );
            println!("{measured}");
            assert!(position < 2e-3 && rotation.to_degrees() < 1.0, "{measured}");
            assert!(last_position < settled && last_rotation.to_degrees() < 0.2, "{measured}");
        }
    }
}
