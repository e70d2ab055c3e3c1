//! Samples carried out: the same start and goal again and again, each time with the next sample of every grasp.

use super::measure::{Models, code, draw_stream};
use super::samplers::{PeakRules, Sampler, pairs};
use crate::output::progress_bar;
use crate::reference::{Grounds, Place};
use nalgebra::Point3;
use rayon::prelude::*;
use serde::Serialize;
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints};
use vmao_core::outcome::TrialOutcome;
use vmao_core::random::Stream;
use vmao_net::ModelKind;

/// One sample that was carried out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Executed {
    /// Name of the sizes.
    pub set: &'static str,
    /// Number of the scene in its set.
    pub scene: u64,
    /// Where the contacts came from.
    pub sampler: Sampler,
    /// Which sample.
    pub number: usize,
    /// How the trial ended.
    pub outcome: TrialOutcome,
    /// Finger points of each grasp that was tried, part frame (m), in the order of the parts.
    pub contacts: Vec<[[f64; 3]; 2]>,
}

/// The samplers that are carried out: the uniform one would only fail.
const CARRIED_OUT: [Sampler; 5] =
    [Sampler::VmaoPeak, Sampler::VmaoDraw, Sampler::VmaoRanked, Sampler::Top1Peaks, Sampler::Top1Draw];

/// Proposes the `number`-th sample of its sampler.
struct Numbered<'a> {
    models: &'a Models,
    sampler: Sampler,
    number: usize,
    place: Place,
    seed: u64,
    rules: PeakRules,
    codes: usize,
}

impl ContactModel for Numbered<'_> {
    fn propose(&self, query: &ContactQuery<'_>, _stream: &mut Stream) -> Vec<FingerPoints> {
        self.sample(query).into_iter().collect()
    }
}

impl Numbered<'_> {
    fn sample(&self, query: &ContactQuery<'_>) -> Option<FingerPoints> {
        let part = usize::from(query.part.0);
        let network = self.models.network(self.sampler.model()?, part)?;
        let seen = query.observation;
        let scene = network.encode(&seen.points, &seen.colors).ok()?;
        let map = |k: usize| network.decode(&scene, &code(network, self.seed, self.place, part, k)).ok();
        // Ranking needs all codes; otherwise only the one asked for.
        let (codes, count, at) = match self.sampler {
            Sampler::VmaoRanked => (0..self.codes, self.number + 1, self.number),
            Sampler::VmaoPeak | Sampler::VmaoDraw => (self.number..self.number + 1, 1, 0),
            Sampler::Top1Peaks | Sampler::Top1Draw | Sampler::Uniform => (0..1, self.number + 1, self.number),
        };
        let first = codes.start;
        let maps = codes.map(map).collect::<Option<Vec<_>>>()?;
        let streams = |k: usize| draw_stream(self.seed, self.sampler, self.place, part, [0, first + k]);
        let found = pairs(self.sampler, &maps, &seen.points, self.rules, count, &streams);
        // Where there are fewer samples than asked for, they begin again.
        let pair = found.get(at).or_else(|| found.get(at % found.len().max(1)))?;
        Some(pair.map(|point| Point3::from(seen.points[point].map(f64::from))))
    }
}

/// Carries out the first `count` samples of each sampler in each place, in the current rayon pool; in the order of places.
pub fn execute(grounds: &Grounds<'_>, places: &[Place], models: &Models, count: usize) -> Vec<Executed> {
    let config = &grounds.config().score;
    let present = |sampler: &Sampler| sampler.model().is_some_and(|kind: ModelKind| models.network(kind, 0).is_some());
    let samplers: Vec<Sampler> = CARRIED_OUT.into_iter().filter(present).collect();
    let jobs: Vec<(Place, Sampler, usize)> = places
        .iter()
        .flat_map(|&place| samplers.iter().flat_map(move |&sampler| (0..count).map(move |number| (place, sampler, number))))
        .collect();
    let bar = progress_bar("execute", jobs.len() as u64);
    let run = |&(place, sampler, number): &(Place, Sampler, usize)| {
        let rules = grounds.peak_rules(place);
        let model = Numbered { models, sampler, number, place, seed: grounds.seed(), rules, codes: config.codes };
        let record = grounds.trial(place, &model).record;
        bar.inc(1);
        let mut grasps = record.grasps;
        grasps.sort_by_key(|grasp| grasp.contact.part);
        let contacts = grasps.iter().map(|grasp| grasp.contact.fingers.map(Into::into)).collect();
        let (set, scene) = (crate::reference::set_name(place.set), place.index);
        Executed { set, scene, sampler, number, outcome: record.outcome, contacts }
    };
    let found = jobs.par_iter().map(run).collect();
    bar.finish();
    found
}
