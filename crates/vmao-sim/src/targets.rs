//! What the controllers of a trial were asked for, tick by tick: enough to drive the same scene from elsewhere.

use crate::simulation::{Grip, Simulation};
use vmao_core::osc::GripperGoal;

/// Every command of a trial since its first tick.
#[derive(Debug, Clone)]
pub struct Targets {
    /// The simulator's positions of all joints at the first tick; everything is at rest.
    pub qpos: Vec<f64>,
    /// At each tick, of each arm: where its gripper shall be, and what its fingers shall do.
    pub ticks: Vec<Vec<(GripperGoal, Drive)>>,
}

/// What the fingers of a gripper shall do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive {
    /// Go this far out from the closed position (m), drawn by a spring of [`Targets::STIFFNESS`].
    Open(f64),
    /// Press both together with this force (N), twice that of a pad.
    Close(f64),
}

impl Targets {
    /// Of the spring that opens a gripper (N/m).
    pub const STIFFNESS: f64 = crate::simulation::OPENING_STIFFNESS;

    pub(crate) fn new(simulation: &Simulation<'_>) -> Self {
        Self { qpos: simulation.data.qpos().to_vec(), ticks: Vec::new() }
    }

    /// Keeps what `simulation` is asked for in the tick to come.
    pub(crate) fn note(&mut self, simulation: &Simulation<'_>) {
        let drive = |(arm, grip): (usize, &Grip)| match *grip {
            Grip::Open(opening) => Drive::Open(simulation.scene.robots[arm].gripper.finger_travel(opening)),
            Grip::Close(force) => Drive::Close(2.0 * force),
        };
        let drives = simulation.grips.iter().enumerate().map(drive);
        self.ticks.push(simulation.goals.iter().cloned().zip(drives).collect());
    }
}
