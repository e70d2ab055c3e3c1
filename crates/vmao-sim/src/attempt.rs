//! The state of one trial and its steps: looking, choosing, holding, judging. [`crate::trial`] strings them together.

use crate::assignment::assignments;
use crate::cameras::observe;
use crate::combinations::{Choices, Reserve, compatible_grasps, free_alone};
use crate::dependency_root::{choose_root, grasp_sequence, step_goal};
use crate::failure::Failure;
use crate::grasping::{Grasp, GraspConfig, object_cloud, reachable_grasps};
use crate::measures::Measuring;
use crate::profile::{Stage, time};
use crate::recorder::Recorder;
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::targets::Targets;
use crate::task::{GoalReach, draw_goal, goal_errors, sample_start};
use crate::trial::{Recording, Trial, TrialConfig};
use nalgebra::Point3;
use std::ops::Range;
use vmao_core::contact::{ArmId, Contact, PartId};
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints};
use vmao_core::geometry::{Pose, interpolate, rotation_distance};
use vmao_core::object::{ObjectGoal, ObjectState};
use vmao_core::object_graph::ObjectGraph;
use vmao_core::order::GraspOrder;
use vmao_core::outcome::{FailureStage, TrialOutcome};
use vmao_core::random::Stream;
use vmao_core::record::{GraspRecord, TrialRecord};
use vmao_core::rollout::RolloutContact;

/// Random streams of a trial, each its own so that two methods meet the same scene and goal.
#[derive(Clone, Copy)]
pub(crate) enum Draw {
    Start = 0,
    Goal,
    Look,
    Contacts,
    Reach,
    Plan,
    Noise,
}

/// Longest time an object may take to come to rest (s), the time in which it falls, and the speed below which it rests then.
const SETTLE_SECONDS: f64 = 1.0;
const FALL_SECONDS: f64 = 0.1;
const REST_SPEED: f64 = 2e-3;
/// Steps in which the motion after a later grasp is looked at.
const RESERVE_WAYPOINTS: usize = 4;

/// Share of `grasp.carry_margin` that arms keep from each other on the way to the goal where all of it leaves none.
pub(crate) const TIGHT: f64 = 0.1;

/// A trial under way.
pub(crate) struct Attempt<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) config: &'a TrialConfig,
    pub(crate) simulation: Simulation<'a>,
    pub(crate) graph: ObjectGraph,
    order: GraspOrder,
    seed: u64,
    index: u64,
    /// The parts in the order in which they are grasped.
    pub(crate) sequence: Vec<PartId>,
    /// Which arm grasps each part.
    pub(crate) arms: Vec<ArmId>,
    start: ObjectState,
    pub(crate) goal: ObjectGoal,
    pub(crate) goal_parts: Vec<Pose>,
    reach: GoalReach,
    pub(crate) held: Vec<(ArmId, PartId)>,
    pub(crate) grasps: Vec<GraspRecord>,
    pub(crate) errors: [f64; 4],
    /// Worst ratio of error to threshold while the goal was to be held.
    pub(crate) factor: f64,
    /// How the motions of the object went with all parts held.
    pub(crate) measuring: Measuring,
    /// Where each of the hands that hold was on its part when it had closed.
    pub(crate) closed: Vec<Pose>,
    /// The most that any part has turned in its hand since then (rad).
    pub(crate) turned: f64,
    settled: Result<(), Failure>,
}

impl<'a> Attempt<'a> {
    /// Lays the object on the table, lets it settle, and draws the goal.
    pub(crate) fn begin(
        scene: &'a Scene,
        config: &'a TrialConfig,
        order: GraspOrder,
        (seed, index): (u64, u64),
        recording: Recording,
    ) -> Self {
        let draw = |draw: Draw| Stream::new(seed, &[index, draw as u64]);
        let (world_from_root, joints) = sample_start(scene, &config.start, &mut draw(Draw::Start));
        let mut simulation = Simulation::new(scene, config.osc, &world_from_root, &joints);
        if recording == Recording::Targets {
            simulation.targets = Some(Targets::new(&simulation));
        }
        simulation.max_steps = config.motion.max_steps;
        let mut settled = Ok(());
        for tick in 1..=(SETTLE_SECONDS / scene.timestep) as usize {
            settled = simulation.advance();
            let fallen = tick as f64 * scene.timestep > FALL_SECONDS;
            if settled.is_err() || fallen && simulation.object_speed() < REST_SPEED {
                break;
            }
        }
        let graph = scene.graph.clone();
        let start = simulation.object_state();
        // Drawn as a motion of part 0 whatever the root, so that all roots meet the same goals.
        let (drawn, goal_parts, reach) = draw_goal(scene, (&config.goal, &config.grasp), &start, &mut draw(Draw::Goal));
        let root = choose_root(scene, config, order, &start, &drawn);
        let goal = drawn.with_root(&scene.object, &graph, root);
        let sequence = grasp_sequence(&graph, goal.root, order);
        if recording == Recording::On {
            simulation.recorder = Some(Recorder::new(&simulation, goal_parts.clone()));
        }
        let errors = goal_errors(scene, &goal_parts, &goal, &start);
        let arms = assignments(scene, &[], &[&start.world_from_parts, &goal_parts]).remove(0);
        let (held, grasps) = (Vec::new(), Vec::new());
        Self {
            scene,
            config,
            simulation,
            graph,
            order,
            seed,
            index,
            sequence,
            arms,
            start,
            goal,
            goal_parts,
            reach,
            held,
            grasps,
            errors,
            factor: f64::INFINITY,
            measuring: Measuring::default(),
            closed: Vec::new(),
            turned: 0.0,
            settled,
        }
    }

    /// Whether the object came to lie on the table.
    pub(crate) fn settled(&self) -> Result<(), Failure> {
        self.settled.clone()
    }

    /// Number of parts to take hold of.
    pub(crate) fn part_count(&self) -> usize {
        self.scene.object.parts.len()
    }

    pub(crate) fn stream(&self, draw: Draw) -> Stream {
        Stream::new(self.seed, &[self.index, draw as u64, self.held.len() as u64])
    }

    pub(crate) fn note(&mut self, label: String) {
        let steps = self.simulation.steps;
        if let Some(recorder) = &mut self.simulation.recorder {
            recorder.event(steps, label);
        }
    }

    /// Where the object shall go once the first `count` parts of the sequence are held.
    pub(crate) fn step_goal(&self, count: usize) -> ObjectGoal {
        let now = self.simulation.object_state();
        step_goal(&self.scene.object, (&self.goal, &self.goal_parts), &self.sequence[..count], &now)
    }

    /// Looks at the scene and asks the model for the contacts of the grasps `step`.
    pub(crate) fn propose_contacts(
        &mut self,
        model: &dyn ContactModel,
        step: Range<usize>,
    ) -> Result<Vec<Vec<FingerPoints>>, Failure> {
        let mut stream = self.stream(Draw::Look);
        let held = self.held.len() as u64;
        let noise = |camera| Stream::new(self.seed, &[self.index, Draw::Noise as u64, held, camera as u64]);
        let observation = time(Stage::Observation, || observe(&self.simulation, &self.config.cameras, &mut stream, noise));
        let state = self.simulation.object_state();
        let mut contacts = Vec::new();
        for grasp in step {
            let part = self.sequence[grasp];
            let world_from_part = state.world_from_parts[usize::from(part.0)];
            let span = self.scene.robots[usize::from(self.arms[usize::from(part.0)].0)].gripper.span();
            let query = ContactQuery { grasp, part, observation: &observation, span, world_from_part: &world_from_part };
            let mut stream = Stream::new(self.seed, &[self.index, Draw::Contacts as u64, grasp as u64]);
            let proposals = time(Stage::Proposal, || model.propose(&query, &mut stream));
            let Some(&fingers) = proposals.first() else {
                let why = format!("nothing to touch was seen on part {}", part.0);
                return Err(Failure::new(FailureStage::NoContact, why));
            };
            if let Some(odd) = proposals.iter().find(|fingers| fingers.iter().flat_map(|p| p.iter()).any(|x| !x.is_finite())) {
                let why = format!("the points proposed on part {} are not finite: {} and {}", part.0, odd[0], odd[1]);
                return Err(Failure::new(FailureStage::NoContact, why));
            }
            let contact = Contact { part, fingers: fingers.map(|point| world_from_part.inverse_transform_point(&point)) };
            let (arm, observation) = (self.arms[usize::from(part.0)], observation.clone());
            self.grasps.push(GraspRecord { arm, contact, observation, world_from_part, world_from_gripper: None });
            let steps = self.simulation.steps;
            if let Some(recorder) = &mut self.simulation.recorder {
                recorder.contact(steps, (arm.0, part.0), &fingers);
            }
            contacts.push(proposals);
        }
        Ok(contacts)
    }

    /// Forgets the contacts of grasps that were not made, and answers them.
    pub(crate) fn forget_contacts(&mut self) -> (Vec<GraspRecord>, Vec<RolloutContact>) {
        let made = self.held.len();
        let shown = self.simulation.recorder.as_mut().map(|recorder| recorder.rollout.contacts.split_off(made));
        (self.grasps.split_off(made), shown.unwrap_or_default())
    }

    /// Puts forgotten contacts back in the place of those of grasps that were not made.
    pub(crate) fn recall_contacts(&mut self, (grasps, shown): (Vec<GraspRecord>, Vec<RolloutContact>)) {
        self.forget_contacts();
        self.grasps.extend(grasps);
        if let Some(recorder) = &mut self.simulation.recorder {
            recorder.rollout.contacts.extend(shown);
        }
    }

    /// Gripper poses for these contacts that all arms reach, carry to the step's goal, and take without meeting; best first.
    ///
    /// Arms are assigned to parts by distance; the other way round only if that leaves no way, now or for later grasps.
    pub(crate) fn choose_grasps(&mut self, contacts: &[FingerPoints]) -> Result<Vec<Vec<Grasp>>, Failure> {
        let now = self.simulation.object_state().world_from_parts;
        let assignments = assignments(self.scene, &self.held, &[&now, &self.goal_parts]);
        let (arms, grasps) = time(Stage::Grasping, || self.choose_among(&assignments, contacts))?;
        Ok(self.assign(&arms, grasps))
    }

    /// The first of these assignments that leaves later arms room, or that leaves a way at all, and its grasps, best first.
    ///
    /// Where none leaves a way with all of `grasp.carry_margin` between what is carried, a share of it has to do.
    pub(crate) fn choose_among(
        &self,
        assignments: &[Vec<ArmId>],
        contacts: &[FingerPoints],
    ) -> Result<(Vec<ArmId>, Vec<Vec<Grasp>>), Failure> {
        let mut stream = self.stream(Draw::Reach);
        let tight = GraspConfig { carry_margin: TIGHT * self.config.grasp.carry_margin, ..self.config.grasp.clone() };
        let mut first = None;
        for config in [&self.config.grasp, &tight] {
            let mut crowded = None;
            for arms in assignments {
                match self.choices(arms, contacts, config, &mut stream) {
                    Ok(Choices { roomy, .. }) if !roomy.is_empty() => return Ok((arms.clone(), roomy)),
                    Ok(choices) => drop(crowded.get_or_insert((arms.clone(), choices.crowded))),
                    Err(failure) => drop(first.get_or_insert(failure)),
                }
            }
            if let Some(found) = crowded {
                return Ok(found);
            }
        }
        Err(first.unwrap_or_else(|| Failure::new(FailureStage::NoPlan, "no arm is free")))
    }

    /// The combinations of grasps on these contacts that the arms can make if part p is taken by `arms[p]`.
    fn choices(
        &self,
        arms: &[ArmId],
        contacts: &[FingerPoints],
        config: &GraspConfig,
        stream: &mut Stream,
    ) -> Result<Choices, Failure> {
        let first = self.held.len();
        let holders = self.holders();
        let motion = self.waypoints(&self.trajectory(self.step_goal(first + contacts.len())));
        let mut candidates = Vec::new();
        for (&part, fingers) in self.sequence[first..].iter().zip(contacts) {
            let cloud = self.cloud_on(part);
            candidates.push(self.within_reach((arms[usize::from(part.0)], part), (&cloud, fingers), &motion, stream)?);
        }
        let reserve = self.reserve(arms, first + contacts.len(), &motion, stream);
        compatible_grasps(&self.simulation, config, &candidates, &holders, &reserve)
    }

    /// The grasps of `part` at these points that `arm` can make and carry as far as it alone is concerned.
    pub(crate) fn within_reach(
        &self,
        (arm, part): (ArmId, PartId),
        touch: (&[Point3<f64>], &FingerPoints),
        motion: &[Vec<Pose>],
        stream: &mut Stream,
    ) -> Result<Vec<Grasp>, Failure> {
        let reached = reachable_grasps(&self.simulation, &self.config.grasp, (arm, part), touch, motion, stream)?;
        Ok(free_alone(&self.simulation, &self.config.grasp, &self.holders(), &motion[0], reached))
    }

    /// The object's points as they were seen for the grasp of `part`, moved with that part to where it is by now.
    pub(crate) fn cloud_on(&self, part: PartId) -> Vec<Point3<f64>> {
        let now = self.simulation.object_state().world_from_parts;
        let here = |record: &GraspRecord| {
            let by = now[usize::from(part.0)] * record.world_from_part.inverse();
            object_cloud(&record.observation).iter().map(|point| by * point).collect()
        };
        self.grasps.iter().find(|record| record.contact.part == part).map(here).unwrap_or_default()
    }

    /// How the parts that are grasped from `next` on could be taken where the object is after `motion`: as demonstrated, on average.
    fn reserve(&self, arms: &[ArmId], next: usize, motion: &[Vec<Pose>], stream: &mut Stream) -> Reserve {
        let world_from_parts = motion[motion.len() - 1].clone();
        let between = |share: f64| {
            let ends = world_from_parts.iter().zip(&self.goal_parts);
            ends.map(|(from, to)| interpolate(from, to, share)).collect()
        };
        let motion: Vec<Vec<Pose>> = (0..=RESERVE_WAYPOINTS).map(|i| between(i as f64 / RESERVE_WAYPOINTS as f64)).collect();
        let mut grasps = Vec::new();
        for &place in &self.sequence[next..] {
            let part = usize::from(place.0);
            let fingers = self.scene.hold_fingers[part].map(|point| world_from_parts[part] * point);
            let arm = arms[part];
            // Cheaper than the later search itself: few postures of each gripper pose.
            let config = GraspConfig {
                approaches: self.config.grasp.approaches / 2,
                ik_candidates: 1,
                ik_restarts: 1,
                ..self.config.grasp.clone()
            };
            let reached = reachable_grasps(&self.simulation, &config, (arm, place), (&[], &fingers), &motion, stream);
            let reached = reached.unwrap_or_default();
            grasps.push(free_alone(&self.simulation, &config, &self.holders(), &world_from_parts, reached));
        }
        Reserve { world_from_parts, grasps }
    }

    /// Decides who takes which part, and notes it where the contacts were noted.
    fn assign(&mut self, arms: &[ArmId], choices: Vec<Vec<Grasp>>) -> Vec<Vec<Grasp>> {
        let first = self.held.len();
        self.arms = arms.to_vec();
        let taken_by = |part: &PartId| arms[usize::from(part.0)];
        for (record, part) in self.grasps.iter_mut().zip(&self.sequence).skip(first) {
            record.arm = taken_by(part);
        }
        if let Some(recorder) = &mut self.simulation.recorder {
            for (contact, part) in recorder.rollout.contacts.iter_mut().zip(&self.sequence).skip(first) {
                contact.arm = taken_by(part).0;
            }
        }
        choices
    }

    /// Closes the grippers and checks by contact that each holds its part.
    pub(crate) fn take_hold(&mut self, grasps: &[Grasp]) -> Result<(), Failure> {
        self.note("close".to_owned());
        time(Stage::Control, || self.simulation.close(grasps, &self.config.grasp))?;
        self.held.extend(grasps.iter().map(|grasp| (grasp.arm, grasp.part)));
        let known = self.closed.len();
        self.closed.extend(self.simulation.part_from_tools(&self.held[known..]));
        Ok(())
    }

    /// (arm, part) pairs that may touch: an arm that holds the object may touch all of it.
    pub(crate) fn holders(&self) -> Vec<(usize, usize)> {
        let parts = 0..self.part_count();
        self.held.iter().flat_map(|(arm, _)| parts.clone().map(|part| (usize::from(arm.0), part))).collect()
    }

    /// Notes how far parts have turned in the hands that hold them.
    pub(crate) fn note_turns(&mut self) {
        let now = self.simulation.part_from_tools(&self.held);
        let turns = self.closed.iter().zip(&now).map(|(closed, now)| rotation_distance(&closed.rotation, &now.rotation));
        self.turned = turns.fold(self.turned, f64::max);
    }

    /// Whether the goal was met while it was to be held, by hands that held firmly.
    pub(crate) fn goal_held(&self) -> Result<(), Failure> {
        if self.factor <= 1.0 {
            return self.held_firmly();
        }
        let [position, rotation, turn, slide] = self.errors;
        let why = format!(
            "{:.1} mm, {:.1}°, joints {:.1}° and {:.1} mm off",
            position * 1e3,
            rotation.to_degrees(),
            turn.to_degrees(),
            slide * 1e3
        );
        Err(Failure::new(FailureStage::Threshold, why))
    }

    /// Whether no part turned in its hand further than it may.
    fn held_firmly(&self) -> Result<(), Failure> {
        if self.turned <= self.config.most_turn {
            return Ok(());
        }
        let [turned, most] = [self.turned, self.config.most_turn].map(f64::to_degrees);
        let why = format!("a part turned by {turned:.1}° in its hand, at most {most:.1}° may be learned from");
        Err(Failure::new(FailureStage::Slip, why))
    }

    /// Writes the record.
    pub(crate) fn finish(mut self, outcome: Result<(), Failure>) -> Trial {
        let (outcome, detail) = match outcome {
            Ok(()) => (TrialOutcome::Success, String::new()),
            Err(failure) => (TrialOutcome::Failed(failure.stage), failure.why),
        };
        let steps = self.simulation.steps;
        let rollout = self.simulation.recorder.take().map(|recorder| {
            let mut rollout = recorder.rollout;
            rollout.outcome = match outcome {
                TrialOutcome::Success => "success".to_owned(),
                TrialOutcome::Failed(stage) => format!("{}: {detail}", stage.name()),
            };
            rollout
        });
        let targets = self.simulation.targets.take();
        let (index, seed, order, start, goal, grasps) = (self.index, self.seed, self.order, self.start, self.goal, self.grasps);
        let record = TrialRecord { index, seed, order, start, goal, grasps, outcome, detail, steps, final_errors: self.errors };
        let got_so_far = matches!(outcome, TrialOutcome::Success | TrialOutcome::Failed(FailureStage::Threshold));
        Trial {
            record,
            threshold_factor: if got_so_far { self.factor } else { f64::INFINITY },
            rollout,
            targets,
            motion: self.measuring.finish(),
            reach: self.reach,
        }
    }
}
