//! Scenes with the maps of several latent codes, each code's points grasped and the trial carried out in physics.

use crate::contact_maps::latent_maps;
use crate::evaluation::{Evaluation, TrialLine};
use crate::failure::Failure;
use crate::learned_contacts::LearnedContacts;
use crate::output::progress_bar;
use crate::report::{ContactMapFigure, RolloutFigure};
use crate::results::Method;
use crate::rollouts::PackedRollout;
use nalgebra::Point3;
use rayon::prelude::*;
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints};
use vmao_core::order::GraspOrder;
use vmao_core::outcome::TrialOutcome;
use vmao_core::random::Stream;
use vmao_sim::{Recording, Trial};

/// Latent codes shown for each scene, as in the supplement's Figure 4.
const CODES: u64 = 5;
/// Scenes shown, each before and after the first gripper has lifted the object.
const SCENES: usize = 2;
/// The grasp whose maps are shown, from zero.
const GRASP: usize = 1;

/// V-MAO with the points of one grasp given.
struct WithPoints<'m> {
    model: &'m LearnedContacts,
    points: FingerPoints,
}

impl ContactModel for WithPoints<'_> {
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints> {
        if query.grasp == GRASP { vec![self.points] } else { self.model.propose(query, stream) }
    }
}

/// The scenes of a report: V-MAO's first trials that came to the second grasp in every shown order.
pub(super) fn scenes(evaluation: &Evaluation<'_>, lines: &[TrialLine], seed: u64) -> Result<Vec<ContactMapFigure>, Failure> {
    let Some(model) = evaluation.model(Method::Vmao) else { return Ok(Vec::new()) };
    let of_order = |order| lines.iter().filter(move |line| line.order == order && line.method == Method::Vmao);
    let orders: Vec<GraspOrder> =
        [GraspOrder::Sequential, GraspOrder::Parallel].into_iter().filter(|&order| of_order(order).next().is_some()).collect();
    let Some(&first) = orders.first() else { return Ok(Vec::new()) };
    // A solved trial came to its second grasp for certain.
    let solved = |order, index| of_order(order).any(|line| line.index == index && line.outcome.is_success());
    let everywhere = |line: &&TrialLine| orders.iter().all(|&order| solved(order, line.index));
    let indices: Vec<u64> = of_order(first).filter(everywhere).take(SCENES).map(|line| line.index).collect();
    let wanted: Vec<(u64, GraspOrder)> =
        indices.iter().flat_map(|&index| orders.iter().map(move |&order| (index, order))).collect();
    let bar = progress_bar("codes for the report", wanted.len() as u64 * CODES);
    let figures = wanted.par_iter().map(|&(index, order)| {
        let figure = scene(evaluation, model, (order, index), seed)?;
        bar.inc(CODES);
        Ok(figure)
    });
    let figures: Vec<Option<ContactMapFigure>> = figures.collect::<Result<_, Failure>>()?;
    bar.finish();
    Ok(figures.into_iter().flatten().collect())
}

fn scene(
    evaluation: &Evaluation<'_>,
    model: &LearnedContacts,
    (order, index): (GraspOrder, u64),
    seed: u64,
) -> Result<Option<ContactMapFigure>, Failure> {
    let seen = evaluation.trial_by(model, order, index, Recording::Off);
    let Some(grasp) = seen.record.grasps.get(GRASP) else { return Ok(None) };
    let part = usize::from(grasp.contact.part.0);
    let span = evaluation.scene(index).robots[usize::from(grasp.arm.0)].gripper.span();
    let mut maps = latent_maps(model, part, &grasp.observation, span, seed, CODES)?;
    let executed = maps.par_iter().enumerate().map(|(code, map)| {
        let points = map.peaks.map(|point| Point3::from(grasp.observation.points[point].map(f64::from)));
        let trial = evaluation.trial_by(&WithPoints { model, points }, order, index, Recording::On);
        figure(code, trial)
    });
    let executed: Vec<Option<RolloutFigure>> = executed.collect::<Result<_, Failure>>()?;
    for (map, executed) in maps.iter_mut().zip(executed) {
        map.executed = executed;
    }
    let lifted = order == GraspOrder::Sequential;
    let state = if lifted { "lifted by the first gripper" } else { "lying on the table" };
    let caption = format!(
        "Trial {index}, {} order: {} Choose a code: below is what happens when its most probable points are grasped.",
        order.name(),
        if lifted { "the first gripper holds the object at its goal, the second looks." } else { "nothing is grasped yet." }
    );
    Ok(Some(ContactMapFigure::new(format!("Scene {index}, {state}"), caption, &grasp.observation, maps)))
}

fn figure(code: usize, trial: Trial) -> Result<Option<RolloutFigure>, Failure> {
    let Some(rollout) = trial.rollout else { return Ok(None) };
    let what = match trial.record.outcome {
        TrialOutcome::Success => "success".to_owned(),
        TrialOutcome::Failed(stage) => format!("failed at {}", stage.name()),
    };
    let title = format!("Code {}: {what}", code + 1);
    Ok(Some(RolloutFigure { title, caption: trial.record.detail, trial: None, rollout: PackedRollout::pack(&rollout)? }))
}
