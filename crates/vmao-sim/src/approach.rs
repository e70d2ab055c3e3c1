//! The way to chosen grasps: planned for all their arms together, gone, and planned again where the object has moved.

use crate::attempt::{Attempt, Draw};
use crate::combinations::joint_positions_with;
use crate::failure::Failure;
use crate::grasping::Grasp;
use crate::planning_world::{Obstacles, collision_world};
use crate::profile::{Stage, time};
use crate::simulation::Grip;
use vmao_core::contact::{ArmId, PartId};
use vmao_core::contact_model::FingerPoints;
use vmao_core::geometry::{Pose, pose_distance};
use vmao_core::object_centric::gripper_goal;
use vmao_core::outcome::FailureStage;
use vmao_core::planning::{PlanOutcome, PlanSettings, plan, time_path};
use vmao_core::random::Stream;
use vmao_core::record::GraspRecord;
use vmao_core::time_parameterization::{MotionLimits, Trajectory};

/// A grasp that is off by more than this (m, rad) once the hand is at its stand-off is planned again, so often at most.
const MOVED: [f64; 2] = [0.008, 0.1];
const PLANNED_AGAIN: usize = 3;

/// Joint trajectories to the stand-offs and from there to the grasps.
pub(crate) struct Approach {
    way: Trajectory,
    last_stretch: Trajectory,
    /// Where the parts were when it was planned: a part that hangs free may have moved since.
    seen: Vec<Pose>,
}

impl Attempt<'_> {
    /// The first of these grasps that a collision-free motion of all its arms together leads to.
    pub(crate) fn plan_approach(&mut self, choices: Vec<Vec<Grasp>>) -> Result<(Vec<Grasp>, Approach), Failure> {
        let mut stream = self.stream(Draw::Plan);
        let mut why = String::new();
        for grasps in choices {
            match time(Stage::Planning, || self.approach_to(&grasps, &mut stream)) {
                Ok(approach) => return Ok((grasps, approach)),
                Err(cause) => why = cause,
            }
        }
        Err(Failure::new(FailureStage::NoPlan, why))
    }

    fn approach_to(&self, grasps: &[Grasp], stream: &mut Stream) -> Result<Approach, String> {
        let mut openings: Vec<f64> = (0..self.scene.robots.len()).map(|arm| self.simulation.opening(arm)).collect();
        for grasp in grasps {
            openings[usize::from(grasp.arm.0)] = grasp.opening;
        }
        let chosen: Vec<&Grasp> = grasps.iter().collect();
        let start = joint_positions_with(&self.simulation, &[], &|grasp| grasp.standoff().to_vec());
        let standoff = joint_positions_with(&self.simulation, &chosen, &|grasp| grasp.standoff().to_vec());
        let world = collision_world(&self.simulation, &openings, &Obstacles::Parts(&self.holders()));
        let moving: Vec<usize> = grasps.iter().map(|grasp| usize::from(grasp.arm.0)).collect();
        let frozen_arms = (0..self.scene.robots.len()).filter(|arm| !moving.contains(arm)).collect();
        let settings =
            PlanSettings { margin: self.config.grasp.plan_margin, frozen_arms, max_iterations: 4000, ..PlanSettings::default() };
        let path = match plan(&world, &start, &standoff, &settings, stream) {
            PlanOutcome::Path(path) => path,
            PlanOutcome::Failed(failure) => return Err(failure.to_string()),
        };
        let limits = self.limits(1.0);
        let way = time_path(&world, &path, &limits, &settings).ok_or("no free way to time the path")?;
        let stretch: Vec<Vec<f64>> = (0..grasps[0].approach.len())
            .map(|i| {
                let mut q = standoff.clone();
                for grasp in grasps {
                    let first = 7 * usize::from(grasp.arm.0);
                    q[first..first + 7].copy_from_slice(&grasp.approach[i]);
                }
                q
            })
            .collect();
        let last_stretch = Trajectory::new(&stretch, &self.limits(self.config.motion.approach_share), 0.01);
        Ok(Approach { way, last_stretch, seen: self.simulation.object_state().world_from_parts })
    }

    fn limits(&self, share: f64) -> MotionLimits {
        let joints = || self.scene.robots.iter().flat_map(|robot| &robot.joints);
        let motion = &self.config.motion;
        MotionLimits {
            velocity: joints().map(|joint| joint.max_velocity * motion.velocity_share * share).collect(),
            acceleration: joints().map(|joint| joint.max_acceleration * motion.acceleration_share * share).collect(),
        }
    }

    /// Opens the grippers, goes to the stand-offs and straight on to the grasps; answers those that were gone to.
    ///
    /// A part that hangs free may move before the hands are at their stand-offs. Then the rest is planned again for the same points.
    pub(crate) fn approach(&mut self, mut grasps: Vec<Grasp>, mut approach: Approach) -> Result<Vec<Grasp>, Failure> {
        for again in (0..=PLANNED_AGAIN).rev() {
            self.open_for(&grasps, &approach.seen);
            time(Stage::Control, || self.simulation.follow(&approach.way, &moving(&grasps), None, &self.config.motion))?;
            if again == 0 || !self.moved_since(&grasps, &approach.seen) {
                break;
            }
            let Ok(planned) = self.plan_again(grasps.len()) else { break };
            self.note("the object has moved: plan again".to_owned());
            (grasps, approach) = planned;
        }
        let seen = Some(&approach.seen[..]);
        time(Stage::Control, || self.simulation.follow(&approach.last_stretch, &moving(&grasps), seen, &self.config.motion))?;
        Ok(grasps)
    }

    /// Opens the grippers, and notes the grasps planned with the parts at `seen` as they are on the parts that were looked at.
    fn open_for(&mut self, grasps: &[Grasp], seen: &[Pose]) {
        for grasp in grasps {
            let part = &self.scene.object.parts[usize::from(grasp.part.0)].name;
            self.note(format!("arm {} reaches for {part}", grasp.arm.0));
            self.simulation.grips[usize::from(grasp.arm.0)] = Grip::Open(grasp.opening);
            for record in self.grasps.iter_mut().filter(|record| record.contact.part == grasp.part) {
                let planned_on = &seen[usize::from(grasp.part.0)];
                record.world_from_gripper = Some(gripper_goal(planned_on, &record.world_from_part, &grasp.world_from_tool));
            }
        }
    }

    /// Whether a grasp is elsewhere by now than where it was planned with the parts at `seen`.
    fn moved_since(&self, grasps: &[Grasp], seen: &[Pose]) -> bool {
        let now = self.simulation.object_state().world_from_parts;
        grasps.iter().any(|grasp| {
            let (part, tool) = (usize::from(grasp.part.0), &grasp.world_from_tool);
            let [shift, turn] = pose_distance(&gripper_goal(&seen[part], &now[part], tool), tool);
            shift > MOVED[0] || turn > MOVED[1]
        })
    }

    /// Grasps by the same arms on the same points of the same parts, where they are by now, and the way there.
    fn plan_again(&mut self, count: usize) -> Result<(Vec<Grasp>, Approach), Failure> {
        let now = self.simulation.object_state().world_from_parts;
        let first = self.held.len();
        let here = |record: &GraspRecord| record.contact.fingers.map(|point| now[usize::from(record.contact.part.0)] * point);
        let contacts: Vec<FingerPoints> = self.grasps[first..first + count].iter().map(here).collect();
        let arms = [self.arms.clone()];
        let (_, grasps) = time(Stage::Grasping, || self.choose_among(&arms, &contacts))?;
        self.plan_approach(grasps)
    }
}

fn moving(grasps: &[Grasp]) -> Vec<(ArmId, PartId)> {
    grasps.iter().map(|grasp| (grasp.arm, grasp.part)).collect()
}
