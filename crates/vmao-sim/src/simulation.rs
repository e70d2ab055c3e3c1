//! A running scene: state in, torques out, one tick at a time.

use crate::convention::{Data, body_pose, free_joint_position, hinge_jacobian, joint_vector, mass_block, warning};
use crate::failure::Failure;
use crate::profile::{Stage, time};
use crate::recorder::Recorder;
use crate::scene::{Owner, Scene};
use crate::targets::Targets;
use nalgebra::Vector6;
use std::f64::consts::TAU;
use vmao_core::contact::{ArmId, PartId};
use vmao_core::geometry::Pose;
use vmao_core::kinematics::SerialChain;
use vmao_core::object::{JointKind, ObjectState};
use vmao_core::object_centric::joint_positions;
use vmao_core::osc::{ArmState, GripperGoal, JointVector, OscGains, torques};
use vmao_core::outcome::FailureStage;

/// What a gripper's drive is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Grip {
    /// Go to this gap between the pads (m).
    Open(f64),
    /// Press with this force on each pad (N), as far as the gripper can.
    Close(f64),
}

/// What touches an arm.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Touch {
    /// Normal force on each pad from the part asked about (N).
    pub(crate) pads: [f64; 2],
    /// What this arm presses on and must not, with the force (N): names for people.
    pub(crate) forbidden: Option<(String, f64)>,
}

/// Stiffness of the gripper's opening servo (N/m).
pub(crate) const OPENING_STIFFNESS: f64 = 4000.0;

/// One scene in motion.
pub(crate) struct Simulation<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) data: Data,
    pub(crate) chains: Vec<SerialChain>,
    /// What each arm shall do in the next tick.
    pub(crate) goals: Vec<GripperGoal>,
    /// What each gripper shall do.
    pub(crate) grips: Vec<Grip>,
    /// Ticks so far.
    pub(crate) steps: u64,
    /// Ticks at most.
    pub(crate) max_steps: u64,
    pub(crate) recorder: Option<Recorder>,
    /// Everything that was asked for, if it is kept.
    pub(crate) targets: Option<Targets>,
    gains: OscGains,
    full_mass: Vec<f64>,
}

impl<'s> Simulation<'s> {
    /// The scene at rest: arms at home, grippers open, the object at `world_from_root` with these joint positions.
    pub(crate) fn new(scene: &'s Scene, gains: OscGains, world_from_root: &Pose, joint_positions: &[f64]) -> Self {
        let mut data = Data::new(scene.model.clone());
        let nv = data.qvel().len();
        let qpos = data.qpos_mut();
        qpos[scene.object_qpos..scene.object_qpos + 7].copy_from_slice(&free_joint_position(world_from_root));
        scene.set_object_joints(qpos, joint_positions);
        for (arm, robot) in scene.arms.iter().zip(&scene.robots) {
            qpos[arm.qpos..arm.qpos + 7].copy_from_slice(&robot.home);
            qpos[arm.finger_qpos] = robot.gripper.travel;
            qpos[arm.finger_qpos + 1] = robot.gripper.travel;
        }
        data.forward();
        let chains: Vec<SerialChain> = scene.robots.iter().map(vmao_core::robots::RobotModel::tool_chain).collect();
        let goals = (0..scene.arms.len())
            .map(|arm| GripperGoal {
                world_from_tool: scene.world_from_bases[arm] * chains[arm].tool_pose(&scene.robots[arm].home),
                twist: Vector6::zeros(),
                posture: JointVector::from_row_slice(&scene.robots[arm].home),
            })
            .collect();
        let grips = scene.robots.iter().map(|robot| Grip::Open(robot.gripper.max_opening())).collect();
        Self {
            scene,
            data,
            chains,
            goals,
            grips,
            steps: 0,
            max_steps: u64::MAX,
            recorder: None,
            targets: None,
            gains,
            full_mass: vec![0.0; nv * nv],
        }
    }

    /// One tick of a trial; fails when its steps are spent, or when the simulator has gone astray.
    pub(crate) fn advance(&mut self) -> Result<(), Failure> {
        if self.steps >= self.max_steps {
            let why = format!("not done after {} steps, the most that a trial may take", self.steps);
            return Err(Failure::new(FailureStage::Timeout, why));
        }
        self.tick();
        match warning(&self.data) {
            None => Ok(()),
            // The simulator has put its state back or left something out: what follows would mean nothing.
            Some(what) => Err(Failure::new(FailureStage::Timeout, format!("the simulation went astray: {what}"))),
        }
    }

    /// One control tick and one physics step: torques from the state at its start.
    pub(crate) fn tick(&mut self) {
        if let Some(mut targets) = self.targets.take() {
            targets.note(self);
            self.targets = Some(targets);
        }
        time(Stage::Physics, || self.data.step1());
        time(Stage::Control, || self.command());
        time(Stage::Physics, || self.data.step2());
        self.steps += 1;
        if let Some(mut recorder) = self.recorder.take() {
            recorder.observe(self);
            self.recorder = Some(recorder);
        }
        #[cfg(test)]
        crate::tests::after_tick(self);
    }

    /// Sets every actuator to what its arm's goal asks for.
    fn command(&mut self) {
        if self.data.full_m(&mut self.full_mass).is_err() {
            // The buffer is nv × nv by construction.
            self.full_mass.fill(0.0);
        }
        for arm in 0..self.scene.arms.len() {
            let state = self.arm_state(arm);
            let index = &self.scene.arms[arm];
            let torque = torques(&self.gains, &state, &self.goals[arm], &index.limits);
            let drive = self.grip_force(arm);
            let ctrl = self.data.ctrl_mut();
            ctrl[index.ctrl..index.ctrl + 7].copy_from_slice(torque.as_slice());
            ctrl[index.ctrl + 7] = drive;
        }
    }

    fn grip_force(&self, arm: usize) -> f64 {
        let gripper = &self.scene.robots[arm].gripper;
        let limit = 2.0 * gripper.max_force;
        match self.grips[arm] {
            Grip::Open(opening) => {
                let target = gripper.finger_travel(opening);
                (OPENING_STIFFNESS * (target - self.data.qpos()[self.scene.arms[arm].finger_qpos])).clamp(-limit, limit)
            }
            Grip::Close(force) => -(2.0 * force).min(limit),
        }
    }

    fn arm_state(&self, arm: usize) -> ArmState {
        let index = &self.scene.arms[arm];
        let world_from_tool = self.tool_pose(arm);
        let nv = self.data.qvel().len();
        let bias = joint_vector(self.data.qfrc_bias(), index.dof) - joint_vector(self.data.qfrc_passive(), index.dof);
        ArmState {
            q: joint_vector(self.data.qpos(), index.qpos),
            qd: joint_vector(self.data.qvel(), index.dof),
            jacobian: hinge_jacobian(&self.data, &index.joints, &world_from_tool.translation.vector),
            world_from_tool,
            mass: mass_block(&self.full_mass, nv, index.dof),
            bias,
        }
    }

    /// World pose of the arm's tool frame.
    pub(crate) fn tool_pose(&self, arm: usize) -> Pose {
        body_pose(&self.data, self.scene.arms[arm].hand_body) * self.scene.robots[arm].gripper.hand_from_tool
    }

    /// The arm's joint positions (rad).
    pub(crate) fn joint_positions(&self, arm: usize) -> JointVector {
        joint_vector(self.data.qpos(), self.scene.arms[arm].qpos)
    }

    /// Gap between the pads (m).
    pub(crate) fn opening(&self, arm: usize) -> f64 {
        self.scene.robots[arm].gripper.closed_gap + 2.0 * self.data.qpos()[self.scene.arms[arm].finger_qpos]
    }

    /// Where the object is.
    pub(crate) fn object_state(&self) -> ObjectState {
        let object = &self.scene.object;
        let world_from_parts: Vec<Pose> = self.scene.part_bodies.iter().map(|&body| body_pose(&self.data, body)).collect();
        let mut joint_positions = joint_positions(object, &world_from_parts);
        let mut coordinate = 0;
        for (address, joint) in self.scene.joint_addresses.iter().zip(&object.joints) {
            // The simulator counts the turns of a hinge, which poses alone cannot tell apart; its angle is a step ahead of the poses.
            if let (Some((qpos, _)), JointKind::Revolute) = (address, joint.kind) {
                let angle = &mut joint_positions[coordinate];
                *angle += TAU * ((self.data.qpos()[*qpos] - *angle) / TAU).round();
            }
            coordinate += joint.kind.coordinates();
        }
        ObjectState { world_from_parts, joint_positions }
    }

    /// The fastest motion of the object: over its free body (m/s and rad/s mixed) and its joints.
    pub(crate) fn object_speed(&self) -> f64 {
        let joints = self.scene.joint_addresses.iter().zip(&self.scene.object.joints);
        let joints = joints.filter_map(|(address, joint)| address.map(|(_, dof)| dof..dof + joint.kind.coordinates())).flatten();
        (self.scene.object_dof..self.scene.object_dof + 6)
            .chain(joints)
            .map(|dof| self.data.qvel()[dof].abs())
            .fold(0.0, f64::max)
    }

    /// What touches `arm`, which is to hold `part`: forces on its pads, and anything it must not press on.
    pub(crate) fn touch(&self, arm: ArmId, part: PartId) -> Touch {
        let mut touch = Touch::default();
        for (index, contact) in self.data.contact().iter().enumerate() {
            if contact.exclude != 0 {
                continue;
            }
            let owners = contact.geom.map(|geom| self.scene.owners[geom as usize]);
            let (own, other) = match (is_of(owners[0], arm), is_of(owners[1], arm)) {
                (true, _) => (owners[0], owners[1]),
                (_, true) => (owners[1], owners[0]),
                _ => continue,
            };
            let force = self.data.contact_force(index)[0];
            match (own, other) {
                (Owner::Pad(_, finger), Owner::Part(touched)) if touched == part => touch.pads[finger] += force,
                // Links and pads may graze the object they reach for: what counts is how it ends.
                (_, Owner::Part(_)) => {}
                _ if touch.forbidden.as_ref().is_none_or(|(_, strongest)| force > *strongest) => {
                    touch.forbidden = Some((describe(other), force));
                }
                _ => {}
            }
        }
        touch
    }
}

fn is_of(owner: Owner, arm: ArmId) -> bool {
    matches!(owner, Owner::Link(a) | Owner::Pad(a, _) if a == arm)
}

fn describe(owner: Owner) -> String {
    match owner {
        Owner::Table => "the table".to_owned(),
        Owner::Link(arm) | Owner::Pad(arm, _) => format!("arm {}", arm.0),
        Owner::Part(part) => format!("part {}", part.0),
    }
}
