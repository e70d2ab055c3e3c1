//! Carrying out plans: follow joint trajectories, close the grippers, carry the object along its own trajectory.

use crate::failure::Failure;
use crate::grasping::{Grasp, GraspConfig};
use crate::simulation::{Grip, Simulation};
use nalgebra::{Vector3, Vector6};
use serde::{Deserialize, Serialize};
use vmao_core::contact::{ArmId, PartId};
use vmao_core::geometry::{Pose, interpolate, pose_distance, rotation_log};
use vmao_core::object_centric::{ObjectTrajectory, gripper_goal};
use vmao_core::osc::JointVector;
use vmao_core::outcome::FailureStage;
use vmao_core::time_parameterization::Trajectory;

/// How fast things move and what counts as a collision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionConfig {
    /// Share of the joints' velocity limits used by planned motions.
    pub velocity_share: f64,
    /// Share of the joints' acceleration limits used by planned motions.
    pub acceleration_share: f64,
    /// The straight approach is slower than other planned motions by this factor.
    pub approach_share: f64,
    /// Mean speed of the object's parts (m/s).
    pub object_speed: f64,
    /// Mean turning speed of the object (rad/s) and of its revolute joints (rad/s).
    pub object_turning_speed: f64,
    /// Shortest motion of the object (s).
    pub shortest_motion: f64,
    /// An arm that presses on another arm or the table harder than this has collided (N).
    pub collision_force: f64,
    /// Waypoints at which a motion of the object is planned.
    pub waypoints: usize,
    /// Time constant (s) with which a hand accepts its part's place in it as the one to keep; zero: at once.
    pub grip_memory: f64,
    /// Simulated steps that a trial may take.
    pub max_steps: u64,
}

impl MotionConfig {
    /// How long the object takes from one place of its parts to another (s): the slowest part decides.
    pub(crate) fn duration(&self, from: &[Pose], to: &[Pose]) -> f64 {
        let mut duration = self.shortest_motion;
        for (from, to) in from.iter().zip(to) {
            let [distance, turn] = pose_distance(from, to);
            duration = duration.max(distance / self.object_speed).max(turn / self.object_turning_speed);
        }
        duration
    }
}

/// Contacts are examined at this interval (s).
const WATCH_EVERY: f64 = 0.02;
/// A held part may be without pad contact for this many examinations before it counts as lost.
const LOST_AFTER: u32 = 5;

/// A part that has moved in the pads by this much (m, rad) since the motion began is not where any plan has it.
const SLIPPED: [f64; 2] = [0.05, 1.5];

/// Time over which the pads' forces are averaged to tell whether a gripper holds its part (s).
const HOLD_SECONDS: f64 = 0.05;

impl Simulation<'_> {
    /// Lets time pass with all goals as they are.
    pub(crate) fn wait(&mut self, seconds: f64) {
        for _ in 0..self.ticks(seconds) {
            self.tick();
        }
    }

    fn ticks(&self, seconds: f64) -> u64 {
        (seconds / self.scene.timestep).round() as u64
    }

    /// Ticks of an interval (s), one at least.
    pub(crate) fn interval(&self, seconds: f64) -> u64 {
        self.ticks(seconds).max(1)
    }

    fn time_to_watch(&self) -> bool {
        self.steps.is_multiple_of(self.interval(WATCH_EVERY))
    }

    /// Follows a joint trajectory of all arms (flat) to its end; arms not in `moving` keep their goals.
    ///
    /// With `seen`, the parts' poses that the trajectory was made for, each gripper goes where its part is by now (Eq. 1).
    pub(crate) fn follow(
        &mut self,
        trajectory: &Trajectory,
        moving: &[(ArmId, PartId)],
        seen: Option<&[Pose]>,
        motion: &MotionConfig,
    ) -> Result<(), Failure> {
        let ticks = (trajectory.duration() / self.scene.timestep).ceil() as u64;
        for tick in 1..=ticks {
            let (q, qd) = trajectory.at(tick as f64 * self.scene.timestep);
            let parts = seen.map(|_| self.object_state().world_from_parts);
            for (arm, part) in moving {
                let (arm, part) = (usize::from(arm.0), usize::from(part.0));
                self.aim(arm, &q, &qd);
                if let (Some(seen), Some(now)) = (seen, &parts) {
                    let goal = &mut self.goals[arm].world_from_tool;
                    *goal = gripper_goal(&seen[part], &now[part], goal);
                }
            }
            self.advance()?;
            if self.time_to_watch() {
                self.watch_collisions(moving, motion)?;
            }
        }
        Ok(())
    }

    /// Sets an arm's goal to these joint positions and velocities of all arms (flat).
    fn aim(&mut self, arm: usize, q: &[f64], qd: &[f64]) {
        let first = 7 * arm;
        let (q, qd) = (&q[first..first + 7], &qd[first..first + 7]);
        let world_from_base = self.scene.world_from_bases[arm];
        let twist = self.chains[arm].jacobian(q) * JointVector::from_row_slice(qd);
        let linear = world_from_base.rotation * Vector3::new(twist[0], twist[1], twist[2]);
        let angular = world_from_base.rotation * Vector3::new(twist[3], twist[4], twist[5]);
        let goal = &mut self.goals[arm];
        goal.world_from_tool = world_from_base * self.chains[arm].tool_pose(q);
        goal.twist = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
        goal.posture = JointVector::from_row_slice(q);
    }

    /// Closes the grippers of these grasps and checks by contact that each holds its part.
    pub(crate) fn close(&mut self, grasps: &[Grasp], config: &GraspConfig) -> Result<(), Failure> {
        for grasp in grasps {
            let arm = usize::from(grasp.arm.0);
            self.goals[arm].twist = Vector6::zeros();
            self.grips[arm] = Grip::Close(config.closing_force);
        }
        for _ in 0..self.ticks(config.closing_seconds) {
            self.advance()?;
        }
        // Contacts of stiff bodies come and go from one tick to the next: what counts is the mean over a moment.
        let mut pads = vec![[0.0; 2]; grasps.len()];
        let ticks = self.interval(HOLD_SECONDS);
        for _ in 0..ticks {
            self.advance()?;
            for (pads, grasp) in pads.iter_mut().zip(grasps) {
                let touch = self.touch(grasp.arm, grasp.part);
                pads[0] += touch.pads[0] / ticks as f64;
                pads[1] += touch.pads[1] / ticks as f64;
            }
        }
        grasps.iter().zip(pads).try_for_each(|(grasp, pads)| check_hold(grasp, pads, config))
    }

    /// Carries the object along `trajectory` with the arms that hold it; `postures` are their planned joint positions.
    ///
    /// At each tick a gripper's target is its part's wanted pose (Eq. 2) times the grip, the tool's pose on the part, so that
    /// the hand keeps its part still in it. The grip follows what is really there with `motion.grip_memory`: a part that
    /// has slipped still comes to its goal. Runs for the trajectory's duration and `extra` seconds at its end.
    pub(crate) fn carry(
        &mut self,
        trajectory: &ObjectTrajectory,
        held: &[(ArmId, PartId)],
        postures: &[Vec<Vec<f64>>],
        extra: f64,
        motion: &MotionConfig,
        mut at_tick: impl FnMut(&Self, f64),
    ) -> Result<(), Failure> {
        let ticks = ((trajectory.duration() + extra) / self.scene.timestep).ceil() as u64;
        let mut wanted = trajectory.part_poses_at(0.0);
        let mut lost = vec![0; held.len()];
        let part_from_tools = self.part_from_tools(held);
        let mut grips = part_from_tools.clone();
        let accepted = self.scene.timestep / motion.grip_memory.max(self.scene.timestep);
        for tick in 1..=ticks {
            let time = tick as f64 * self.scene.timestep;
            let next = trajectory.part_poses_at(time);
            for (((&(arm, part), postures), grip), now) in
                held.iter().zip(postures).zip(&mut grips).zip(self.part_from_tools(held))
            {
                let (arm, part) = (usize::from(arm.0), usize::from(part.0));
                let tool = self.tool_pose(arm);
                *grip = interpolate(grip, &now, accepted);
                let goal = &mut self.goals[arm];
                goal.world_from_tool = next[part] * *grip;
                goal.twist = twist_at(&wanted[part], &next[part], &tool, self.scene.timestep);
                goal.posture = posture_at(postures, time / trajectory.duration());
            }
            wanted = next;
            self.advance()?;
            at_tick(self, time);
            if self.time_to_watch() {
                self.watch_collisions(held, motion)?;
                self.watch_hold(held, &mut lost)?;
                self.watch_slip(held, &part_from_tools)?;
            }
        }
        Ok(())
    }

    fn watch_collisions(&self, arms: &[(ArmId, PartId)], motion: &MotionConfig) -> Result<(), Failure> {
        for &(arm, part) in arms {
            if let Some((what, force)) = self.touch(arm, part).forbidden
                && force > motion.collision_force
            {
                return Err(Failure::new(FailureStage::Collision, format!("arm {} pressed on {what} with {force:.0} N", arm.0)));
            }
        }
        Ok(())
    }

    /// Where the tool of each of these arms is on the part that it holds.
    pub(crate) fn part_from_tools(&self, held: &[(ArmId, PartId)]) -> Vec<Pose> {
        let parts = self.object_state().world_from_parts;
        held.iter().map(|(arm, part)| parts[usize::from(part.0)].inverse() * self.tool_pose(usize::from(arm.0))).collect()
    }

    fn watch_slip(&self, held: &[(ArmId, PartId)], before: &[Pose]) -> Result<(), Failure> {
        for ((now, before), (arm, part)) in self.part_from_tools(held).iter().zip(before).zip(held) {
            let [shift, turn] = pose_distance(now, before);
            if shift > SLIPPED[0] || turn > SLIPPED[1] {
                let why =
                    format!("part {} slipped in arm {} by {:.0} mm and {:.0}°", part.0, arm.0, shift * 1e3, turn.to_degrees());
                return Err(Failure::new(FailureStage::Slip, why));
            }
        }
        Ok(())
    }

    fn watch_hold(&self, held: &[(ArmId, PartId)], lost: &mut [u32]) -> Result<(), Failure> {
        for (&(arm, part), count) in held.iter().zip(lost) {
            let touching = self.touch(arm, part).pads.iter().all(|&force| force > 0.0);
            *count = if touching { 0 } else { *count + 1 };
            if *count >= LOST_AFTER {
                return Err(Failure::new(FailureStage::Slip, format!("arm {} lost part {}", arm.0, part.0)));
            }
        }
        Ok(())
    }
}

fn check_hold(grasp: &Grasp, pads: [f64; 2], config: &GraspConfig) -> Result<(), Failure> {
    if pads.iter().all(|&force| force >= config.hold_force) {
        return Ok(());
    }
    let (arm, part) = (grasp.arm.0, grasp.part.0);
    let why = format!("pads of arm {arm} press on part {part} with {:.1} N and {:.1} N", pads[0], pads[1]);
    Err(Failure::new(FailureStage::NoContact, why))
}

/// Twist of a tool that rides on a body which moves from `before` to `after` within `dt` (s); linear, then angular.
fn twist_at(before: &Pose, after: &Pose, world_from_tool: &Pose, dt: f64) -> Vector6<f64> {
    let angular = rotation_log(&(after.rotation * before.rotation.inverse())) / dt;
    let arm = world_from_tool.translation.vector - before.translation.vector;
    let linear = (after.translation.vector - before.translation.vector) / dt + angular.cross(&arm);
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

/// The planned joint positions at `fraction` of a motion, between evenly spaced waypoints.
fn posture_at(postures: &[Vec<f64>], fraction: f64) -> JointVector {
    let last = postures.len() - 1;
    let place = fraction.clamp(0.0, 1.0) * last as f64;
    let before = (place as usize).min(last);
    let after = (before + 1).min(last);
    let (a, b) = (JointVector::from_row_slice(&postures[before]), JointVector::from_row_slice(&postures[after]));
    a + (b - a) * (place - before as f64)
}
