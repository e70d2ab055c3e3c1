//! How a motion of the held object went: forces that the arms waste on each other, errors of the parts, paths of the hands.

use crate::scene::Owner;
use crate::simulation::Simulation;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::geometry::Pose;
use vmao_core::osc::JointVector;

/// What was measured while the object was moved: paths and speeds by all arms that held it, the rest with all parts held.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MotionMeasures {
    /// Largest internal force of an arm, mean over 50 ms (N).
    pub peak_internal_force: f64,
    /// Mean over the motion of the largest internal force of an arm (N).
    pub mean_internal_force: f64,
    /// Root mean square distance of the parts from their trajectory (m).
    pub part_error: f64,
    /// Length of the ways of all hands (m).
    pub hand_path: f64,
    /// Length of the longest way of a hand (m).
    pub longest_hand_path: f64,
    /// Largest speed of a hand, over 10 ms (m/s).
    pub hand_speed: f64,
    /// How far all joints of all arms turned (rad).
    pub joint_travel: f64,
    /// Motions whose straight route was blocked, so that the object went up first.
    pub detours: u32,
}

/// Time between two looks (s), and looks in a mean of forces: contacts of stiff bodies come and go from tick to tick.
const LOOK_EVERY: f64 = 0.01;
const LOOKS: usize = 5;

/// One arm's part of the motions.
#[derive(Debug, Default, Clone)]
struct Way {
    last: Option<(u64, Vector3<f64>, JointVector)>,
    length: f64,
}

/// Collects [`MotionMeasures`].
#[derive(Debug, Default)]
pub(crate) struct Measuring {
    /// Sums of the forces of each arm over the present window, and its looks.
    window: Vec<Vector3<f64>>,
    looks: usize,
    windows: usize,
    force_sum: f64,
    squares: f64,
    samples: usize,
    /// Each arm's hand and joints at the last look, and the length of its hand's way so far.
    arms: Vec<Way>,
    measures: MotionMeasures,
}

impl Measuring {
    /// Takes in the paths of the arms `holding` after a tick in which they moved the object.
    pub(crate) fn follow(&mut self, simulation: &Simulation<'_>, holding: &[usize]) {
        let every = simulation.interval(LOOK_EVERY);
        if !simulation.steps.is_multiple_of(every) {
            return;
        }
        self.arms.resize(simulation.scene.arms.len(), Way::default());
        for &arm in holding {
            let (way, steps) = (&mut self.arms[arm], simulation.steps);
            let (hand, joints) = (simulation.tool_pose(arm).translation.vector, simulation.joint_positions(arm));
            // Between two motions nobody looks.
            if let Some((before, last_hand, last_joints)) = way.last
                && before + every == steps
            {
                let step = (hand - last_hand).norm();
                way.length += step;
                let speed = step / (every as f64 * simulation.scene.timestep);
                self.measures.hand_speed = self.measures.hand_speed.max(speed);
                self.measures.joint_travel += (joints - last_joints).abs().sum();
            }
            way.last = Some((steps, hand, joints));
        }
    }

    /// Notes that the straight route of a motion was blocked.
    pub(crate) fn detour(&mut self) {
        self.measures.detours += 1;
    }

    /// Takes in the state after a tick in which the arms `holding`, all there are, moved the parts toward `wanted` poses.
    pub(crate) fn look(&mut self, simulation: &Simulation<'_>, holding: &[usize], wanted: impl FnOnce() -> Vec<Pose>) {
        if !simulation.steps.is_multiple_of(simulation.interval(LOOK_EVERY)) {
            return;
        }
        for (part, wanted) in simulation.object_state().world_from_parts.iter().zip(wanted()) {
            self.squares += (part.translation.vector - wanted.translation.vector).norm_squared();
            self.samples += 1;
        }
        let forces = simulation.arm_forces();
        self.window.resize(holding.len(), Vector3::zeros());
        for (sum, &arm) in self.window.iter_mut().zip(holding) {
            *sum += forces[arm];
        }
        self.looks += 1;
        if self.looks == LOOKS {
            let means: Vec<Vector3<f64>> = self.window.iter().map(|sum| sum / LOOKS as f64).collect();
            let force = internal_force(&means);
            self.measures.peak_internal_force = self.measures.peak_internal_force.max(force);
            self.force_sum += force;
            self.windows += 1;
            self.window.fill(Vector3::zeros());
            self.looks = 0;
        }
    }

    pub(crate) fn finish(&self) -> MotionMeasures {
        MotionMeasures {
            mean_internal_force: self.force_sum / self.windows.max(1) as f64,
            part_error: (self.squares / self.samples.max(1) as f64).sqrt(),
            hand_path: self.arms.iter().map(|way| way.length).sum(),
            longest_hand_path: self.arms.iter().map(|way| way.length).fold(0.0, f64::max),
            ..self.measures
        }
    }
}

/// The largest deviation of an arm's force on the object from the mean of all arms (N): what cancels and moves nothing.
///
/// fᵢ − (1/N) Σ fⱼ; the mean is what carries and accelerates the object.
pub(crate) fn internal_force(forces: &[Vector3<f64>]) -> f64 {
    let mean = forces.iter().sum::<Vector3<f64>>() / forces.len().max(1) as f64;
    forces.iter().map(|force| (force - mean).norm()).fold(0.0, f64::max)
}

/// One contact between an arm and the object.
pub(crate) struct ObjectTouch {
    pub(crate) arm: usize,
    /// Which of its pads; none for another link.
    pub(crate) pad: Option<usize>,
    /// World frame (m).
    pub(crate) point: Vector3<f64>,
    /// On the object, friction included, world frame (N).
    pub(crate) force: Vector3<f64>,
}

impl Simulation<'_> {
    /// The contacts between arms and the object, in the simulator's order.
    pub(crate) fn touches(&self) -> impl Iterator<Item = ObjectTouch> {
        self.data.contact().iter().enumerate().filter(|(_, contact)| contact.exclude == 0).filter_map(|(index, contact)| {
            // The contact frame's first axis points from the first geom to the second, and the force is that on the second.
            let (owner, sign) = match contact.geom.map(|geom| self.scene.owners[geom as usize]) {
                [owner, Owner::Part(_)] => (owner, 1.0),
                [Owner::Part(_), owner] => (owner, -1.0),
                _ => return None,
            };
            let (arm, pad) = match owner {
                Owner::Link(arm) => (arm, None),
                Owner::Pad(arm, pad) => (arm, Some(pad)),
                Owner::Table | Owner::Part(_) => return None,
            };
            let [normal, first, second, ..] = self.data.contact_force(index);
            let world_from_contact = Matrix3::from_column_slice(&contact.frame);
            let force = world_from_contact * Vector3::new(normal, first, second) * sign;
            Some(ObjectTouch { arm: usize::from(arm.0), pad, point: contact.pos.into(), force })
        })
    }

    /// Net contact force of each arm on the object, world frame (N).
    pub(crate) fn arm_forces(&self) -> Vec<Vector3<f64>> {
        let mut forces = vec![Vector3::zeros(); self.scene.arms.len()];
        for touch in self.touches() {
            forces[touch.arm] += touch.force;
        }
        forces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_carries_is_not_internal_and_what_squeezes_is() {
        let up = Vector3::z() * 3.0;
        assert!(internal_force(&[up, up, up]) < 1e-12, "three equal shares of a weight");
        let squeeze = Vector3::x() * 7.0;
        assert!((internal_force(&[up + squeeze, up - squeeze]) - 7.0).abs() < 1e-12);
        assert!(internal_force(&[up]) < 1e-12 && internal_force(&[]) < 1e-12);
    }
}
