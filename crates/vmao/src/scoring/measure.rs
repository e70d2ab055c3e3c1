//! What is measured in one held-out scene, for one grasp of it.

use super::calibration::Rank;
use super::grips::{Comparison, compare, left_out, mean, modes};
use super::likelihood::{code_information, divergence, log_mean_exp, log_weight};
use super::samplers::{PeakRules, Sampler, pairs};
use crate::failure::Failure;
use crate::learned_contacts::latent;
use crate::output::progress_bar;
use crate::reference::{Grounds, Place, ReferenceScene};
use crate::score_config::ScoreConfig;
use nalgebra::Point3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use vmao_core::contact::ContactMap;
use vmao_core::contact_model::FingerPoints;
use vmao_core::geometry::Pose;
use vmao_core::observation::{Observation, PointLabel};
use vmao_core::random::Stream;
use vmao_core::record::{GraspRecord, TrialRecord};
use vmao_net::{CodeDistribution, ContactNetwork, ModelKind};

/// Names the streams of this module.
const CODES: u64 = (1 << 36) + 16;
const DRAWS: u64 = CODES + 1;
const POSTERIOR: u64 = CODES + 2;

/// The models that are compared: a network for each part; a kind that is not there is left out of the tables.
#[derive(Debug, Clone, Default)]
pub struct Models {
    /// By kind.
    pub networks: BTreeMap<&'static str, Vec<ContactNetwork>>,
}

impl Models {
    /// The network of `kind` for `part`.
    pub fn network(&self, kind: ModelKind, part: usize) -> Option<&ContactNetwork> {
        self.networks.get(kind.name())?.get(part)
    }
}

/// Code k of the prior for `part` in this place: every scene has codes of its own, or all would share one bad one.
pub(super) fn code(network: &ContactNetwork, seed: u64, place: Place, part: usize, k: usize) -> Vec<f32> {
    latent(network, &mut Stream::new(seed, &[CODES, place.set as u64, place.index, part as u64, k as u64]))
}

/// The stream of the k-th draw of a sampler.
pub(super) fn draw_stream(seed: u64, sampler: Sampler, place: Place, part: usize, further: [usize; 2]) -> Stream {
    let [context, k] = further.map(|x| x as u64);
    Stream::new(seed, &[DRAWS, sampler as u64, place.set as u64, place.index, part as u64, context, k])
}

/// How improbable one success is (nats), both fingers together: −ln p(point of finger 1, point of finger 2 | cloud).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likelihoods {
    /// V-MAO, with codes of the prior.
    pub vmao_prior: Option<f64>,
    /// V-MAO, importance-weighted with codes of the posterior (Burda, Grosse, Salakhutdinov 2016).
    pub vmao_bound: Option<f64>,
    /// Top-1.
    pub top1: Option<f64>,
    /// Every point of the cloud alike.
    pub uniform: f64,
    /// Every point of the part alike: knows which part it is, which no model is told.
    pub uniform_on_part: f64,
    /// KL(q(z | scene, contact) ‖ N(0, I)).
    pub divergence: Option<f64>,
}

/// What was measured for one grasp of one scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneScore {
    /// Where.
    pub place: Place,
    /// Which part is grasped.
    pub part: usize,
    /// Tuples tried and tuples that succeeded.
    pub tries: usize,
    /// Of these.
    pub successes: usize,
    /// Modes of the successes.
    pub modes: usize,
    /// Of some successes.
    pub likelihoods: Vec<Likelihoods>,
    /// Means of V-MAO's posteriors, by success.
    pub posterior_means: Vec<Vec<f32>>,
    /// By sampler, for each K of the configuration.
    pub comparisons: BTreeMap<Sampler, Vec<Comparison>>,
    /// Share of the successes within the distance of another one: the precision that samples of the truth would have.
    pub left_out: Option<f64>,
    /// I(z; point) (nats), mean over fingers and contexts.
    pub information: Option<f64>,
    /// Where the successes' points lie in the models' maps, by model, both fingers.
    pub ranks: BTreeMap<&'static str, Vec<Rank>>,
}

/// What a picture of a scene needs.
#[derive(Debug, Clone)]
pub struct Scored {
    /// The numbers.
    pub score: SceneScore,
    /// What was seen, in the part's frame (m).
    pub cloud: Vec<Point3<f64>>,
    /// What each point lies on.
    pub labels: Vec<PointLabel>,
    /// The explored successes, part frame.
    pub references: Vec<FingerPoints>,
    /// Their modes.
    pub modes: Vec<usize>,
    /// The samples of each sampler, part frame.
    pub samples: BTreeMap<Sampler, Vec<FingerPoints>>,
}

/// What the models say of one observation.
struct Context<'a> {
    grasp: &'a GraspRecord,
    /// By code; one entry for Top-1.
    logs: BTreeMap<&'static str, Vec<[Vec<f64>; 2]>>,
}

impl<'a> Context<'a> {
    fn new(models: &Models, grasp: &'a GraspRecord, (seed, place): (u64, Place), codes: usize) -> Result<Self, Failure> {
        let part = usize::from(grasp.contact.part.0);
        let Observation { points, colors, .. } = &grasp.observation;
        let mut logs = BTreeMap::new();
        for kind in ModelKind::ALL {
            let Some(network) = models.network(kind, part) else { continue };
            let scene = network.encode(points, colors)?;
            let count = if kind == ModelKind::Vmao { codes } else { 1 };
            let all = (0..count).map(|k| network.log_probabilities(&scene, &code(network, seed, place, part, k)));
            logs.insert(kind.name(), all.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(Self { grasp, logs })
    }

    /// The maps of a model, one for each code.
    fn maps(&self, kind: ModelKind) -> Vec<ContactMap> {
        let map = |logs: &[Vec<f64>; 2]| {
            let channel = |finger: usize| logs[finger].iter().map(|log| log.exp() as f32).collect();
            ContactMap { fingers: [channel(0), channel(1)] }
        };
        self.logs.get(kind.name()).map_or_else(Vec::new, |logs| logs.iter().map(map).collect())
    }

    /// Where the points lie in the mean map of all codes.
    fn ranks(&self, kind: ModelKind, touched: [usize; 2]) -> Vec<Rank> {
        let Some(logs) = self.logs.get(kind.name()) else { return Vec::new() };
        let rank = |finger: usize| {
            let points = logs.first().map_or(0, |log| log[finger].len());
            let mean = |i: usize| logs.iter().map(|log| log[finger][i].exp()).sum::<f64>() / logs.len() as f64;
            Rank::of(&(0..points).map(mean).collect::<Vec<f64>>(), touched[finger])
        };
        vec![rank(0), rank(1)]
    }

    /// −ln of the mean over the codes of the two points' joint probability.
    fn improbability(&self, kind: ModelKind, touched: [usize; 2]) -> Option<f64> {
        let logs = self.logs.get(kind.name())?;
        let joint: Vec<f64> = logs.iter().map(|log| log[0][touched[0]] + log[1][touched[1]]).collect();
        Some(-log_mean_exp(&joint))
    }
}

/// The cloud point nearest to each finger: exploration touches points of the cloud, so it is the touched one itself.
fn touched(grasp: &GraspRecord) -> [usize; 2] {
    grasp.contact.fingers.map(|finger| {
        let at = grasp.world_from_part * finger;
        let away = |point: &[f32; 3]| (Point3::from(point.map(f64::from)) - at).norm_squared();
        let points = &grasp.observation.points;
        (0..points.len()).min_by(|&a, &b| away(&points[a]).total_cmp(&away(&points[b]))).unwrap_or(0)
    })
}

/// At most `count` of `all`, evenly.
fn evenly<T: Copy>(all: &[T], count: usize) -> Vec<T> {
    let kept = count.min(all.len());
    (0..kept).map(|i| all[i * all.len() / kept]).collect()
}

/// Measures every grasp of every scene that has a success, in the current rayon pool; in the order of places and parts.
pub fn score(grounds: &Grounds<'_>, reference: &[ReferenceScene], models: &Models) -> Result<Vec<Scored>, Failure> {
    let jobs: Vec<(Place, &[TrialRecord], usize)> = reference
        .iter()
        .flat_map(|ReferenceScene { place, records }| {
            (0..grounds.scene(*place).object.parts.len()).map(|part| (*place, records.as_slice(), part))
        })
        .collect();
    let bar = progress_bar("score", jobs.len() as u64);
    let one = |&(place, records, part): &(Place, &[TrialRecord], usize)| {
        let found = score_scene(grounds, place, records, models, part);
        bar.inc(1);
        found
    };
    let found = jobs.par_iter().map(one).collect::<Result<Vec<_>, Failure>>()?;
    bar.finish();
    Ok(found.into_iter().flatten().collect())
}

fn score_scene(
    grounds: &Grounds<'_>,
    place: Place,
    records: &[TrialRecord],
    models: &Models,
    part: usize,
) -> Result<Option<Scored>, Failure> {
    let (config, seed) = (&grounds.config().score, grounds.seed());
    let grasp_of = |record: &'_ TrialRecord| record.grasps.iter().position(|g| usize::from(g.contact.part.0) == part);
    let successes: Vec<&GraspRecord> = records
        .iter()
        .filter(|record| record.outcome.is_success())
        .filter_map(|record| grasp_of(record).map(|at| &record.grasps[at]))
        .collect();
    if successes.is_empty() {
        return Ok(None);
    }
    let references: Vec<FingerPoints> = successes.iter().map(|grasp| grasp.contact.fingers).collect();
    let mode_of = modes(&references, config.mode_distance, config.mode_angle_deg.to_radians());
    let codes = config.codes.max(config.samples.iter().copied().max().unwrap_or(1));
    let (mut contexts, mut likelihoods, mut posterior_means) = (Vec::<Context<'_>>::new(), Vec::new(), Vec::new());
    let mut ranks: BTreeMap<&'static str, Vec<Rank>> = BTreeMap::new();
    for (number, grasp) in evenly(&successes, config.likelihoods).into_iter().enumerate() {
        let known = contexts.iter().position(|context| context.grasp.observation == grasp.observation);
        let at = match known {
            Some(at) => at,
            None => {
                contexts.push(Context::new(models, grasp, (seed, place), codes)?);
                contexts.len() - 1
            }
        };
        let points = touched(grasp);
        for kind in ModelKind::ALL {
            ranks.entry(kind.name()).or_default().extend(contexts[at].ranks(kind, points));
        }
        let noise =
            |k: usize| Stream::new(seed, &[POSTERIOR, place.set as u64, place.index, part as u64, number as u64, k as u64]);
        let bound =
            models.network(ModelKind::Vmao, part).map(|network| posterior_bound(network, grasp, points, config.codes, &noise));
        let bound = bound.transpose()?.flatten();
        let on_part = grasp.observation.labels.iter().filter(|label| **label == PointLabel::Part(part as u16)).count();
        likelihoods.push(Likelihoods {
            vmao_prior: contexts[at].improbability(ModelKind::Vmao, points),
            vmao_bound: bound.as_ref().map(|bound| bound.improbability),
            top1: contexts[at].improbability(ModelKind::Top1, points),
            uniform: 2.0 * (grasp.observation.len() as f64).ln(),
            uniform_on_part: 2.0 * (on_part.max(1) as f64).ln(),
            divergence: bound.as_ref().map(|bound| bound.divergence),
        });
        posterior_means.extend(bound.map(|bound| bound.mean));
    }
    let rules = grounds.peak_rules(place);
    let shown = contexts.len().min(config.contexts);
    let mut compared: Vec<BTreeMap<Sampler, Vec<Comparison>>> = Vec::new();
    let (mut samples, mut information) = (BTreeMap::new(), Vec::new());
    for (number, context) in contexts[..shown].iter().enumerate() {
        let drawn = sample(context, (grounds.seed(), place, part, number), rules, codes);
        compared.push(
            drawn.iter().map(|(&sampler, all)| (sampler, comparisons(sampler, all, &references, &mode_of, config))).collect(),
        );
        let maps = context.maps(ModelKind::Vmao);
        for finger in 0..2 {
            let channels: Vec<&[f32]> = maps.iter().map(|map| map.fingers[finger].as_slice()).collect();
            information.extend((!maps.is_empty()).then(|| code_information(&channels)));
        }
        if number == 0 {
            samples = drawn;
        }
    }
    let seen = contexts[0].grasp;
    let score = SceneScore {
        place,
        part,
        tries: records.len(),
        successes: successes.len(),
        modes: mode_of.iter().max().map_or(0, |last| last + 1),
        likelihoods,
        posterior_means,
        comparisons: averaged(&compared),
        information: mean(&information),
        left_out: left_out(&references, config.distance),
        ranks,
    };
    let cloud = seen.observation.points.iter().map(|point| in_part(&seen.world_from_part, *point)).collect();
    Ok(Some(Scored { score, cloud, labels: seen.observation.labels.clone(), references, modes: mode_of, samples }))
}

/// What codes of the posterior say of one success.
struct PosteriorBound {
    improbability: f64,
    divergence: f64,
    mean: Vec<f32>,
}

/// None without latent code.
fn posterior_bound(
    network: &ContactNetwork,
    grasp: &GraspRecord,
    touched: [usize; 2],
    codes: usize,
    noise: &dyn Fn(usize) -> Stream,
) -> Result<Option<PosteriorBound>, Failure> {
    let Observation { points, colors, .. } = &grasp.observation;
    let scene = network.encode(points, colors)?;
    let contacts = touched.map(|point| points[point]);
    let Some(CodeDistribution { mean, log_variance }) = network.recognise(&scene, points, &contacts)? else { return Ok(None) };
    let mut weighted = Vec::with_capacity(codes);
    for k in 0..codes {
        let mut stream = noise(k);
        let z: Vec<f32> = mean.iter().zip(&log_variance).map(|(m, v)| m + (0.5 * v).exp() * stream.normal() as f32).collect();
        let logs = network.log_probabilities(&scene, &z)?;
        weighted.push(logs[0][touched[0]] + logs[1][touched[1]] + log_weight(&z, &mean, &log_variance));
    }
    let (improbability, divergence) = (-log_mean_exp(&weighted), divergence(&mean, &log_variance));
    Ok(Some(PosteriorBound { improbability, divergence, mean }))
}

fn in_part(world_from_part: &Pose, point: [f32; 3]) -> Point3<f64> {
    world_from_part.inverse_transform_point(&Point3::from(point.map(f64::from)))
}

/// The samples of every sampler whose model is there, part frame.
fn sample(
    context: &Context<'_>,
    (seed, place, part, number): (u64, Place, usize, usize),
    rules: PeakRules,
    count: usize,
) -> BTreeMap<Sampler, Vec<FingerPoints>> {
    let points = &context.grasp.observation.points;
    let mut drawn = BTreeMap::new();
    for sampler in Sampler::ALL {
        let maps = sampler.model().map_or_else(Vec::new, |kind| context.maps(kind));
        if sampler.model().is_some() && maps.is_empty() {
            continue;
        }
        let streams = |k: usize| draw_stream(seed, sampler, place, part, [number, k]);
        let found = pairs(sampler, &maps, points, rules, count, &streams);
        let place_of = |pair: [usize; 2]| pair.map(|point| in_part(&context.grasp.world_from_part, points[point]));
        drawn.insert(sampler, found.into_iter().map(place_of).collect());
    }
    drawn
}

/// For each K: the first K samples; of a sampler whose samples are alike and independent, the mean over all groups of K.
fn comparisons(
    sampler: Sampler,
    samples: &[FingerPoints],
    references: &[FingerPoints],
    modes: &[usize],
    config: &ScoreConfig,
) -> Vec<Comparison> {
    let of_count = |&count: &usize| {
        let groups = if sampler.is_independent() { samples.len() / count } else { 1 };
        let group = |at: usize| &samples[(at * count).min(samples.len())..((at + 1) * count).min(samples.len())];
        let all: Vec<Comparison> = (0..groups.max(1)).map(|at| compare(group(at), references, modes, config.distance)).collect();
        Comparison::mean(&all.iter().collect::<Vec<&Comparison>>())
    };
    config.samples.iter().map(of_count).collect()
}

/// The mean over contexts of each number.
fn averaged(contexts: &[BTreeMap<Sampler, Vec<Comparison>>]) -> BTreeMap<Sampler, Vec<Comparison>> {
    let Some(first) = contexts.first() else { return BTreeMap::new() };
    let average = |sampler: &Sampler, k: usize| {
        let all: Vec<&Comparison> = contexts.iter().filter_map(|context| context.get(sampler)?.get(k)).collect();
        Comparison::mean(&all)
    };
    first.iter().map(|(sampler, ks)| (*sampler, (0..ks.len()).map(|k| average(sampler, k)).collect())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn even_choices_are_spread_and_never_more_than_there_are() {
        let all: Vec<usize> = (0..10).collect();
        assert_eq!(evenly(&all, 4), [0, 2, 5, 7]);
        assert_eq!(evenly(&all, 99), all);
        assert!(evenly(&all[..0], 3).is_empty());
    }
}
