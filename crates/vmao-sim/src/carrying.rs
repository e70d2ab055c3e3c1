//! The trial's motion of the object: plan it for all arms that hold it, then carry it along.

use crate::attempt::{Attempt, TIGHT};
use crate::failure::Failure;
use crate::grasping::{MAX_JOINT_STEP, ik_settings};
use crate::planning_world::{Obstacles, collision_world};
use crate::profile::{Stage, time};
use crate::simulation::Simulation;
use crate::task::{goal_errors, threshold_factor};
use vmao_core::collision::CollisionChecker;
use vmao_core::geometry::Pose;
use vmao_core::inverse_kinematics::track;
use vmao_core::object::{ObjectGoal, ObjectState};
use vmao_core::object_centric::{ObjectTrajectory, part_poses};
use vmao_core::outcome::FailureStage;

/// Time for the controllers to settle after a motion between grasps, and after the last one (s).
const SETTLE_AFTER_MOTION: f64 = 0.3;
const SETTLE_AT_GOAL: f64 = 0.5;
/// First leg of the alternative route: straight up by this much (m).
const LIFT_FIRST: f64 = 0.07;
/// Shares of `grasp.carry_margin` that arms keep from each other on the way: the smaller where the larger leaves no way.
const MARGINS: [f64; 2] = [0.5, TIGHT];

/// Where object and arms are, or will be.
struct Stance {
    object: ObjectState,
    /// Joint positions of every arm (rad).
    joints: Vec<Vec<f64>>,
}

/// A motion of the object that every arm can make.
struct CarryPlan {
    trajectory: ObjectTrajectory,
    /// Joint positions (rad) of each holding arm at each waypoint.
    postures: Vec<Vec<Vec<f64>>>,
    /// Joint positions of every arm at the end (rad).
    joints: Vec<Vec<f64>>,
}

impl CarryPlan {
    fn end(&self) -> Stance {
        let (trajectory, time) = (&self.trajectory, self.trajectory.duration());
        let object = ObjectState {
            world_from_parts: trajectory.part_poses_at(time),
            joint_positions: trajectory.joint_positions_at(time),
        };
        Stance { object, joints: self.joints.clone() }
    }
}

impl Attempt<'_> {
    /// Moves the object by object-centric control to the step's goal.
    pub(crate) fn move_object(&mut self) -> Result<(), Failure> {
        self.bring(self.step_goal(self.held.len()))
    }

    /// Moves the object to `goal` with all arms that hold it: straight, or up first.
    pub(crate) fn bring(&mut self, goal: ObjectGoal) -> Result<(), Failure> {
        let last = self.held.len() == self.part_count();
        let mut up_first = goal.clone();
        let now = self.simulation.object_state();
        up_first.world_from_root = Pose::translation(0.0, 0.0, LIFT_FIRST) * now.world_from_parts[usize::from(goal.root.0)];
        up_first.joint_positions.clone_from(&now.joint_positions);
        let mut blocked = Failure::new(FailureStage::NoPlan, "no route");
        let routes = [vec![goal.clone()], vec![up_first, goal]];
        let margins = MARGINS.map(|share| share * self.config.grasp.carry_margin);
        for (margin, route) in margins.iter().flat_map(|&margin| routes.iter().map(move |route| (margin, route))) {
            match time(Stage::Planning, || self.plan_route(route, margin)) {
                Err(failure) => blocked = failure,
                Ok(first) => {
                    let (mut planned, legs) = (Some(first), route.len());
                    if legs > 1 {
                        self.measuring.detour();
                    }
                    for (leg, goal) in route.iter().enumerate() {
                        let extra = if leg + 1 < legs {
                            0.0
                        } else if last {
                            SETTLE_AT_GOAL + self.config.thresholds.hold_seconds
                        } else {
                            SETTLE_AFTER_MOTION
                        };
                        let plan = match planned.take() {
                            Some(plan) => plan,
                            None => time(Stage::Planning, || self.plan_carry(&self.stance(), goal, margin))?,
                        };
                        self.carry_along(&plan, extra)?;
                    }
                    return Ok(());
                }
            }
        }
        Err(blocked)
    }

    /// The plan of the route's first leg, if the others can be planned too from where it is to end.
    fn plan_route(&self, route: &[ObjectGoal], margin: f64) -> Result<CarryPlan, Failure> {
        let first = self.plan_carry(&self.stance(), &route[0], margin)?;
        let mut end = first.end();
        for goal in &route[1..] {
            end = self.plan_carry(&end, goal, margin)?.end();
        }
        Ok(first)
    }

    fn stance(&self) -> Stance {
        let arms = 0..self.scene.robots.len();
        Stance {
            object: self.simulation.object_state(),
            joints: arms.map(|arm| self.simulation.joint_positions(arm).as_slice().to_vec()).collect(),
        }
    }

    fn carry_along(&mut self, plan: &CarryPlan, extra: f64) -> Result<(), Failure> {
        let CarryPlan { trajectory, postures, .. } = plan;
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
        let outcome = time(Stage::Control, || self.simulation.carry(trajectory, &held, postures, extra, motion, at_tick));
        self.errors = errors;
        self.factor = worst;
        self.note_turns();
        outcome
    }

    /// The object's trajectory from `start` to `goal`, and all arms' joint positions along it, `margin` (m) from collision.
    fn plan_carry(&self, start: &Stance, goal: &ObjectGoal, margin: f64) -> Result<CarryPlan, Failure> {
        let trajectory = self.trajectory_from(start.object.clone(), goal.clone());
        let waypoints = self.waypoints(&trajectory);
        // Arms that hold nothing stay where they are.
        let mut ways: Vec<Vec<Vec<f64>>> = start.joints.iter().map(|q| vec![q.clone(); waypoints.len()]).collect();
        for &(arm, part) in &self.held {
            let (index, part) = (usize::from(arm.0), usize::from(part.0));
            let (chain, now) = (&self.simulation.chains[index], &start.joints[index]);
            let world_from_base = self.scene.world_from_bases[index];
            let part_from_tool = waypoints[0][part].inverse() * world_from_base * chain.tool_pose(now);
            let base_from_world = world_from_base.inverse();
            let poses: Vec<Pose> = waypoints[1..].iter().map(|parts| base_from_world * parts[part] * part_from_tool).collect();
            let way = track(chain, &poses, now, MAX_JOINT_STEP, &ik_settings(0)).map_err(|_where| {
                Failure::new(FailureStage::Unreachable, format!("arm {index} cannot follow the object to its goal"))
            })?;
            ways[index] = std::iter::once(now.clone()).chain(way).collect();
        }
        let openings: Vec<f64> = (0..self.scene.robots.len()).map(|arm| self.simulation.opening(arm)).collect();
        let world = collision_world(&self.simulation, &openings, &Obstacles::Nothing);
        let mut checker = CollisionChecker::new(&world);
        for waypoint in 1..waypoints.len() {
            let q: Vec<f64> = ways.iter().flat_map(|way| way[waypoint].iter().copied()).collect();
            if let Some(pair) = checker.check(&q, margin) {
                return Err(Failure::new(FailureStage::NoPlan, format!("on the way to the goal {pair}")));
            }
        }
        let postures = self.held.iter().map(|(arm, _)| ways[usize::from(arm.0)].clone()).collect();
        let joints = ways.into_iter().filter_map(|mut way| way.pop()).collect();
        Ok(CarryPlan { trajectory, postures, joints })
    }

    /// The object's trajectory from where it is now.
    pub(crate) fn trajectory(&self, goal: ObjectGoal) -> ObjectTrajectory {
        self.trajectory_from(self.simulation.object_state(), goal)
    }

    fn trajectory_from(&self, now: ObjectState, goal: ObjectGoal) -> ObjectTrajectory {
        let parts = part_poses(&self.scene.object, &self.graph, goal.root, &goal.world_from_root, &goal.joint_positions);
        let duration = self.config.motion.duration(&now.world_from_parts, &parts);
        ObjectTrajectory::new(&self.scene.object, &self.graph, now, goal, duration)
    }

    pub(crate) fn waypoints(&self, trajectory: &ObjectTrajectory) -> Vec<Vec<Pose>> {
        let count = self.config.motion.waypoints;
        (0..=count).map(|i| trajectory.part_poses_at(trajectory.duration() * i as f64 / count as f64)).collect()
    }
}
