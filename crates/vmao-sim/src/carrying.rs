//! The trial's motion of the object: plan it for all arms that hold it, then carry it along.

use crate::attempt::Attempt;
use crate::failure::Failure;
use crate::grasping::{MAX_JOINT_STEP, ik_settings};
use crate::planning_world::{Obstacles, collision_world};
use crate::profile::{Stage, time};
use crate::simulation::Simulation;
use crate::task::{goal_errors, threshold_factor};
use vmao_core::collision::CollisionChecker;
use vmao_core::geometry::Pose;
use vmao_core::inverse_kinematics::track;
use vmao_core::object::ObjectGoal;
use vmao_core::object_centric::{ObjectTrajectory, part_poses};
use vmao_core::outcome::FailureStage;

/// Time for the controllers to settle after a motion between grasps, and after the last one (s).
const SETTLE_AFTER_MOTION: f64 = 0.3;
const SETTLE_AT_GOAL: f64 = 0.5;
/// First leg of the alternative route: straight up by this much (m).
const LIFT_FIRST: f64 = 0.07;
/// Joint positions (rad) of each holding arm at each waypoint of a motion.
type Postures = Vec<Vec<Vec<f64>>>;

impl Attempt<'_> {
    /// Moves the object by object-centric control with all arms that hold it: straight to the step's goal, or up first.
    pub(crate) fn move_object(&mut self) -> Result<(), Failure> {
        let goal = self.step_goal(self.held.len());
        let last = self.held.len() == self.part_count();
        let mut up_first = self.step_goal(self.held.len());
        let now = self.simulation.object_state();
        up_first.world_from_root = Pose::translation(0.0, 0.0, LIFT_FIRST) * now.world_from_parts[usize::from(goal.root.0)];
        up_first.joint_positions.clone_from(&now.joint_positions);
        let routes = [vec![goal.clone()], vec![up_first, goal]];
        let mut blocked = Failure::new(FailureStage::NoPlan, "no route");
        for route in routes {
            match time(Stage::Planning, || self.plan_carry(&route[0])) {
                Err(failure) => blocked = failure,
                Ok(_) => {
                    let legs = route.len();
                    if legs > 1 {
                        self.measuring.detour();
                    }
                    for (leg, goal) in route.into_iter().enumerate() {
                        let extra = if leg + 1 < legs {
                            0.0
                        } else if last {
                            SETTLE_AT_GOAL + self.config.thresholds.hold_seconds
                        } else {
                            SETTLE_AFTER_MOTION
                        };
                        self.carry_to(&goal, extra)?;
                    }
                    return Ok(());
                }
            }
        }
        Err(blocked)
    }

    fn carry_to(&mut self, goal: &ObjectGoal, extra: f64) -> Result<(), Failure> {
        let (trajectory, postures) = time(Stage::Planning, || self.plan_carry(goal))?;
        self.note(format!("move the object, {} held", self.held.len()));
        let hold_from = trajectory.duration() + extra - self.config.thresholds.hold_seconds;
        let (held, motion) = (self.held.clone(), &self.config.motion);
        let (scene, goal_parts, wanted, thresholds) = (self.scene, &self.goal_parts, &self.goal, &self.config.thresholds);
        let (mut worst, mut errors) = (0.0_f64, self.errors);
        let holding: Vec<usize> = held.iter().map(|(arm, _)| usize::from(arm.0)).collect();
        let (all_held, measuring) = (held.len() == self.scene.object.parts.len(), &mut self.measuring);
        let at_tick = |simulation: &Simulation<'_>, time: f64| {
            measuring.follow(simulation, &holding);
            if all_held {
                measuring.look(simulation, &holding, || trajectory.part_poses_at(time));
            }
            if time >= hold_from {
                errors = goal_errors(scene, goal_parts, wanted, &simulation.object_state());
                worst = worst.max(threshold_factor(thresholds, &errors));
            }
        };
        let outcome = time(Stage::Control, || self.simulation.carry(&trajectory, &held, &postures, extra, motion, at_tick));
        self.errors = errors;
        self.factor = worst;
        outcome
    }

    /// The object's trajectory to `goal` and the joint positions of each holding arm along it, free of collision.
    fn plan_carry(&self, goal: &ObjectGoal) -> Result<(ObjectTrajectory, Postures), Failure> {
        let trajectory = self.trajectory(goal.clone());
        let waypoints = self.waypoints(&trajectory);
        let mut postures = Vec::new();
        for &(arm, part) in &self.held {
            let (index, part) = (usize::from(arm.0), usize::from(part.0));
            let base_from_world = self.scene.world_from_bases[index].inverse();
            let part_from_tool = waypoints[0][part].inverse() * self.simulation.tool_pose(index);
            let poses: Vec<Pose> = waypoints[1..].iter().map(|parts| base_from_world * parts[part] * part_from_tool).collect();
            let now = self.simulation.joint_positions(index).as_slice().to_vec();
            let way = track(&self.simulation.chains[index], &poses, &now, MAX_JOINT_STEP, &ik_settings(0)).map_err(|_where| {
                Failure::new(FailureStage::Unreachable, format!("arm {index} cannot follow the object to its goal"))
            })?;
            postures.push(std::iter::once(now).chain(way).collect::<Vec<_>>());
        }
        let openings: Vec<f64> = (0..self.scene.robots.len()).map(|arm| self.simulation.opening(arm)).collect();
        let world = collision_world(&self.simulation, &openings, &Obstacles::Nothing);
        let mut checker = CollisionChecker::new(&world);
        for waypoint in 1..waypoints.len() {
            let arms = 0..self.scene.robots.len();
            let q: Vec<f64> = arms
                .flat_map(|arm| match self.held.iter().position(|(held, _)| usize::from(held.0) == arm) {
                    Some(place) => postures[place][waypoint].clone(),
                    None => self.simulation.joint_positions(arm).as_slice().to_vec(),
                })
                .collect();
            if let Some(pair) = checker.check(&q, self.config.grasp.carry_margin / 2.0) {
                return Err(Failure::new(FailureStage::NoPlan, format!("on the way to the goal {pair}")));
            }
        }
        Ok((trajectory, postures))
    }

    /// The object's trajectory from where it is now.
    pub(crate) fn trajectory(&self, goal: ObjectGoal) -> ObjectTrajectory {
        let now = self.simulation.object_state();
        let parts = part_poses(&self.scene.object, &self.graph, goal.root, &goal.world_from_root, &goal.joint_positions);
        let duration = self.config.motion.duration(&now.world_from_parts, &parts);
        ObjectTrajectory::new(&self.scene.object, &self.graph, now, goal, duration)
    }

    pub(crate) fn waypoints(&self, trajectory: &ObjectTrajectory) -> Vec<Vec<Pose>> {
        let count = self.config.motion.waypoints;
        (0..=count).map(|i| trajectory.part_poses_at(trajectory.duration() * i as f64 / count as f64)).collect()
    }
}
