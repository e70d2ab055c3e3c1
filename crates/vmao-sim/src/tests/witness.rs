//! A whole trial under observation: torques within limits, nothing but actuators and contacts acts, nothing jumps.

use super::observed;
use super::support::{configuration, first_successes, scene};
use crate::convention::body_pose;
use crate::simulation::Simulation;
use std::cell::RefCell;
use std::rc::Rc;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::order::GraspOrder;

/// What was seen over all ticks.
#[derive(Debug, Default)]
struct Seen {
    ticks: u64,
    /// Largest torque of a joint over its limit (–).
    torque_share: f64,
    /// Largest force of a gripper's drive (N).
    drive: f64,
    applied: f64,
    /// Largest position change that velocity does not explain (m or rad).
    jump: f64,
    /// Largest tangential force of a contact over what its friction allows (–).
    friction_share: f64,
    /// Deepest contact of a pad with the object (m).
    penetration: f64,
    warnings: i64,
    before: Option<(f64, Vec<f64>, Pose)>,
}

impl Seen {
    fn look(&mut self, simulation: &Simulation<'_>) {
        let (scene, data) = (simulation.scene, &simulation.data);
        self.ticks += 1;
        for (arm, robot) in scene.arms.iter().zip(&scene.robots) {
            for (index, joint) in robot.joints.iter().enumerate() {
                self.torque_share = self.torque_share.max(data.qfrc_actuator()[arm.dof + index].abs() / joint.max_torque);
            }
            self.drive = self.drive.max(data.qfrc_actuator()[arm.dof + 7].abs());
            self.drive = self.drive.max(data.qfrc_actuator()[arm.dof + 8].abs());
        }
        let object = scene.object_dof..scene.object_dof + 7;
        assert!(data.qfrc_actuator()[object].iter().all(|&force| force == 0.0), "something drives the object");
        let applied = data.qfrc_applied().iter().chain(data.xfrc_applied().iter().flatten());
        self.applied = applied.fold(self.applied, |most, force| most.max(force.abs()));
        self.warnings += data.warning().iter().map(|warning| i64::from(warning.number)).sum::<i64>();
        self.look_for_jumps(simulation);
        self.look_at_contacts(simulation);
    }

    fn look_for_jumps(&mut self, simulation: &Simulation<'_>) {
        let (scene, data) = (simulation.scene, &simulation.data);
        let dt = scene.timestep;
        let hinges = scene.arms.iter().flat_map(|arm| (0..9).map(|i| (arm.qpos + i, arm.dof + i)));
        let addresses: Vec<(usize, usize)> = hinges
            .chain(scene.joint_addresses.iter().flatten().copied())
            .chain((0..3).map(|i| (scene.object_qpos + i, scene.object_dof + i)))
            .collect();
        let positions: Vec<f64> = addresses.iter().map(|(qpos, _)| data.qpos()[*qpos]).collect();
        let q = &data.qpos()[scene.object_qpos + 3..scene.object_qpos + 7];
        let turned = vmao_core::geometry::pose([0.0; 3], [q[0], q[1], q[2], q[3]]);
        if let Some((time, before, turned_before)) = &self.before
            && *time < data.time()
        {
            // The integrator moves positions by the new velocities, so that any other change is a teleport.
            for ((position, before), (_, dof)) in positions.iter().zip(before).zip(&addresses) {
                self.jump = self.jump.max((position - before - dt * data.qvel()[*dof]).abs());
            }
            let spin = &data.qvel()[scene.object_dof + 3..scene.object_dof + 6];
            let angle = dt * spin.iter().map(|rate| rate * rate).sum::<f64>().sqrt();
            self.jump = self.jump.max((rotation_distance(&turned.rotation, &turned_before.rotation) - angle).abs());
        }
        self.before = Some((data.time(), positions, turned));
    }

    fn look_at_contacts(&mut self, simulation: &Simulation<'_>) {
        let data = &simulation.data;
        for (index, contact) in data.contact().iter().enumerate() {
            if contact.exclude != 0 {
                continue;
            }
            assert!(contact.friction[0] <= 1.0 && contact.friction[2] <= 0.003, "friction {:?}", contact.friction);
            let [normal, first, second, torsion, ..] = data.contact_force(index);
            assert!(normal >= -1e-9, "a contact pulls with {normal} N");
            if normal > 1.0 {
                let [mu, _, mu_torsion, ..] = contact.friction;
                let share = ((first * first + second * second) / (mu * mu) + (torsion / mu_torsion).powi(2)).sqrt() / normal;
                self.friction_share = self.friction_share.max(share);
            }
            self.penetration = self.penetration.max(-contact.dist);
        }
    }
}

#[test]
fn nothing_but_limited_torques_and_friction_moves_the_object() {
    let scene = scene(0);
    let (_, config) = configuration();
    for order in [GraspOrder::Parallel, GraspOrder::Sequential] {
        let seen = Rc::new(RefCell::new(Seen::default()));
        let eyes = Rc::clone(&seen);
        let look = move |simulation: &Simulation<'_>| {
            // A new simulation starts elsewhere.
            if simulation.steps == 1 {
                *eyes.borrow_mut() = Seen::default();
            }
            eyes.borrow_mut().look(simulation);
        };
        let successes = observed(look, || first_successes(&scene, &config, order, 1));
        let success = &successes[0];
        let mut seen = seen.take();
        seen.before = None;
        assert_eq!(seen.ticks, success.record.steps, "every step was seen");
        assert!(seen.torque_share <= 1.0 + 1e-12, "{seen:?}");
        assert!(seen.drive <= 2.0 * scene.robots[0].gripper.max_force + 1e-9, "{seen:?}");
        assert_eq!((seen.applied, seen.warnings), (0.0, 0), "{seen:?}");
        assert!(seen.jump < 1e-9, "{seen:?}");
        assert!(seen.friction_share < 1.01, "{seen:?}");
        assert!(seen.penetration < 2e-3, "{seen:?}");
        let moved = success.record.goal.world_from_root.translation.z - success.record.start.world_from_parts[0].translation.z;
        assert!(moved > 0.05, "the trial moved nothing");
        println!("{order:?}: {seen:?}");
    }
}

#[test]
fn an_arm_left_alone_holds_still() {
    let scene = scene(1);
    let mut simulation = super::settled(&scene, 0);
    let before: Vec<Pose> = scene.arms.iter().map(|arm| body_pose(&simulation.data, arm.hand_body)).collect();
    simulation.wait(2.0);
    for (arm, before) in scene.arms.iter().zip(before) {
        let after = body_pose(&simulation.data, arm.hand_body);
        assert!((after.translation.vector - before.translation.vector).norm() < 1e-5, "the hand sags");
        assert!(rotation_distance(&after.rotation, &before.rotation) < 1e-5);
    }
}
