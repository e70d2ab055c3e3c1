//! Watches a simulation and keeps its motion for the viewer.

use crate::convention::body_pose;
use crate::scene::Scene;
use crate::simulation::Simulation;
use nalgebra::Point3;
use vmao_core::geometry::Pose;
use vmao_core::rollout::{Rollout, RolloutEvent};

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
}

impl Recorder {
    /// A recorder of all arms and parts, which begins with the present frame; `goal` holds the parts' goal poses.
    pub(crate) fn new(simulation: &Simulation<'_>, goal: Vec<Pose>) -> Self {
        let scene: &Scene = simulation.scene;
        let (bodies, described) = scene.bodies().into_iter().unzip();
        let every = (FRAME_SECONDS / scene.timestep).round().max(1.0) as u64;
        let rollout = Rollout { bodies: described, frame_seconds: every as f64 * scene.timestep, goal, ..Rollout::default() };
        let mut recorder = Self { rollout, bodies, every, first: simulation.steps };
        recorder.observe(simulation);
        recorder
    }

    /// Keeps a frame if it is time for one.
    pub(crate) fn observe(&mut self, simulation: &Simulation<'_>) {
        if (simulation.steps - self.first).is_multiple_of(self.every) {
            self.rollout.frames.push(self.bodies.iter().map(|&body| body_pose(&simulation.data, body)).collect());
        }
    }

    /// Notes that a stage begins at tick `steps`.
    pub(crate) fn event(&mut self, steps: u64, label: String) {
        let time = self.time(steps);
        self.rollout.events.push(RolloutEvent { time, label });
    }

    /// Notes where `arm` is asked to touch at tick `steps`.
    pub(crate) fn contact(&mut self, steps: u64, arm: u16, fingers: &[Point3<f64>; 2]) {
        let time = self.time(steps);
        self.rollout.contacts.push((time, arm, fingers[0].into(), fingers[1].into()));
    }

    /// Time since the first frame (s).
    fn time(&self, steps: u64) -> f64 {
        (steps - self.first) as f64 * self.rollout.frame_seconds / self.every as f64
    }
}
