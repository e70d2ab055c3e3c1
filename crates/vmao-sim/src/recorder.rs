//! Watches a simulation and keeps its motion for the viewer.

use crate::convention::body_pose;
use crate::scene::Scene;
use crate::simulation::Simulation;
use nalgebra::{Point3, Vector3};
use vmao_core::geometry::Pose;
use vmao_core::rollout::{PadForce, Rollout, RolloutContact, RolloutEvent};

/// Frames are kept at this interval (s).
const FRAME_SECONDS: f64 = 0.04;

/// Collects a [`Rollout`] while a trial runs.
#[derive(Debug)]
pub(crate) struct Recorder {
    pub(crate) rollout: Rollout,
    bodies: Vec<usize>,
    every: u64,
    /// Tick of the first frame: the rollout's time zero.
    first: u64,
    /// Of each arm's pads since the last frame, and the ticks looked at.
    presses: Vec<[Press; 2]>,
    looks: u32,
}

/// Sums over ticks: forces, and contact points with the size of their force.
#[derive(Debug, Clone, Copy, Default)]
struct Press {
    force: Vector3<f64>,
    points: Vector3<f64>,
    weight: f64,
}

impl Press {
    fn mean(&self, looks: u32) -> PadForce {
        if self.weight == 0.0 {
            return PadForce::default();
        }
        PadForce { point: (self.points / self.weight).into(), force: (self.force / f64::from(looks)).into() }
    }
}

impl Recorder {
    /// A recorder of all arms and parts, which begins with the present frame; `goal` holds the parts' goal poses.
    pub(crate) fn new(simulation: &Simulation<'_>, goal: Vec<Pose>) -> Self {
        let scene: &Scene = simulation.scene;
        let (bodies, described) = scene.bodies().into_iter().unzip();
        let every = (FRAME_SECONDS / scene.timestep).round().max(1.0) as u64;
        let rollout = Rollout { bodies: described, frame_seconds: every as f64 * scene.timestep, goal, ..Rollout::default() };
        let presses = vec![[Press::default(); 2]; scene.arms.len()];
        let mut recorder = Self { rollout, bodies, every, first: simulation.steps, presses, looks: 0 };
        recorder.observe(simulation);
        recorder
    }

    /// Takes in the pads' forces of a tick, and keeps a frame if it is time for one.
    ///
    /// Contacts of stiff bodies come and go from tick to tick, so that a frame has the mean since the one before.
    pub(crate) fn observe(&mut self, simulation: &Simulation<'_>) {
        self.looks += 1;
        for touch in simulation.touches() {
            let Some(pad) = touch.pad else { continue };
            let (press, size) = (&mut self.presses[touch.arm][pad], touch.force.norm());
            press.force += touch.force;
            press.points += touch.point * size;
            press.weight += size;
        }
        if (simulation.steps - self.first).is_multiple_of(self.every) {
            self.rollout.frames.push(self.bodies.iter().map(|&body| body_pose(&simulation.data, body)).collect());
            self.rollout.forces.push(self.presses.iter().map(|pads| pads.map(|press| press.mean(self.looks))).collect());
            self.presses.fill([Press::default(); 2]);
            self.looks = 0;
        }
    }

    /// Notes that a stage begins at tick `steps`.
    pub(crate) fn event(&mut self, steps: u64, label: String) {
        let time = self.time(steps);
        self.rollout.events.push(RolloutEvent { time, label });
    }

    /// Notes where `arm` is asked to touch `part` at tick `steps`.
    pub(crate) fn contact(&mut self, steps: u64, (arm, part): (u16, u16), fingers: &[Point3<f64>; 2]) {
        let time = self.time(steps);
        self.rollout.contacts.push(RolloutContact { time, arm, part, fingers: fingers.map(Into::into) });
    }

    /// Time since the first frame (s).
    fn time(&self, steps: u64) -> f64 {
        (steps - self.first) as f64 * self.rollout.frame_seconds / self.every as f64
    }
}
