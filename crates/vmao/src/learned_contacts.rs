//! The learned contact models: V-MAO samples a latent code for each grasp, best-of-K several, Top-1 takes its one map.

use crate::config::EvaluateConfig;
use crate::results::Method;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use vmao_core::contact::ContactMap;
use vmao_core::contact_model::{ContactModel, ContactQuery, FingerPoints};
use vmao_core::random::Stream;
use vmao_net::{ContactNetwork, ModelKind};

/// How finger points are taken from a contact map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Draw {
    /// The points of the two fingers about which most probability lies, of those that the gripper spans.
    Peak,
    /// A point of each finger drawn with its probability.
    Sample,
}

/// One network for each part: p(c₁..c_N) = Π p(cᵢ | the scene after the grasps before). With the first part as root, part i
/// is grasp i.
#[derive(Debug)]
pub struct LearnedContacts {
    /// The network of each part.
    pub networks: Vec<ContactNetwork>,
    /// Latent codes drawn for each grasp: one in the paper's method; with more the trial takes the best that it can make.
    pub samples: usize,
    /// How points are taken from the maps.
    pub draw: Draw,
    /// Within which a peak's probability is counted (m): [`ContactMap::masses`].
    pub peak_radius: f64,
}

/// The configured methods whose networks are among `models`.
pub fn methods(config: &EvaluateConfig, models: &[(ModelKind, Vec<ContactNetwork>)]) -> Vec<(Method, LearnedContacts)> {
    let with_model = |&method: &Method| {
        let (_, networks) = models.iter().find(|(kind, _)| *kind == method.model())?;
        let samples = if method == Method::BestOfK { config.best_of } else { 1 };
        Some((
            method,
            LearnedContacts { networks: networks.clone(), samples, draw: config.draw, peak_radius: config.peak_radius },
        ))
    };
    config.methods.iter().filter_map(with_model).collect()
}

/// A latent code z ~ N(0, I) for `network`; empty for Top-1.
pub fn latent(network: &ContactNetwork, stream: &mut Stream) -> Vec<f32> {
    (0..network.latent_size()).map(|_| stream.normal() as f32).collect()
}

/// A point of each finger, drawn with the probabilities of its map.
pub fn drawn_points(map: &ContactMap, stream: &mut Stream) -> [usize; 2] {
    [0, 1].map(|finger| stream.weighted(&map.fingers[finger].iter().map(|&p| f64::from(p)).collect::<Vec<f64>>()))
}

/// The different pairs of points on the cloud `points` (m), those first about which all maps together have most probability: Σₖ m₁ₐ⁽ᵏ⁾ m₂ᵦ⁽ᵏ⁾.
///
/// That is the model's own probability of the pair, the code integrated out, up to a factor.
fn ranked(pairs: impl IntoIterator<Item = [usize; 2]>, maps: &[ContactMap], points: &[[f32; 3]], radius: f32) -> Vec<[usize; 2]> {
    let mut ranked: Vec<(f32, [usize; 2])> = Vec::new();
    for pair in pairs {
        if ranked.iter().all(|(_, other)| *other != pair) {
            ranked.push((maps.iter().map(|map| map.pair_mass(pair, points, radius)).sum(), pair));
        }
    }
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.into_iter().map(|(_, pair)| pair).collect()
}

/// The different peaks of these maps, the pairs that are most probable over all maps first; lengths in m.
pub fn ranked_peaks(maps: &[ContactMap], points: &[[f32; 3]], radius: f32, span: [f32; 2]) -> Vec<[usize; 2]> {
    ranked(maps.iter().map(|map| map.peaks(points, radius, span)), maps, points, radius)
}

impl ContactModel for LearnedContacts {
    /// Points of `samples` maps, the most probable first. Sees the cloud and its colours only: neither labels nor poses.
    fn propose(&self, query: &ContactQuery<'_>, stream: &mut Stream) -> Vec<FingerPoints> {
        let part = usize::from(query.part.0);
        let Some(network) = self.networks.get(part) else { return Vec::new() };
        let seen = query.observation;
        // A cloud too small for the network is a scene in which it sees nowhere to touch.
        let Ok(scene) = network.encode(&seen.points, &seen.colors) else { return Vec::new() };
        let maps: Vec<ContactMap> =
            (0..self.samples).filter_map(|_| network.decode(&scene, &latent(network, stream)).ok()).collect();
        let (points, radius, span) = (&seen.points, self.peak_radius as f32, query.span.map(|width| width as f32));
        let pairs = match self.draw {
            Draw::Peak => ranked_peaks(&maps, points, radius, span),
            Draw::Sample => {
                let drawn: Vec<[usize; 2]> = maps.iter().map(|map| drawn_points(map, stream)).collect();
                ranked(drawn, &maps, points, radius)
            }
        };
        let place = |index: usize| Point3::from(seen.points[index].map(f64::from));
        pairs.into_iter().map(|pair| pair.map(place)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawn_points_have_the_frequencies_of_the_map() {
        let map = ContactMap { fingers: [vec![0.2, 0.8, 0.0], vec![0.0, 0.5, 0.5]] };
        let mut stream = Stream::new(1, &[]);
        let mut counts = [[0; 3]; 2];
        for _ in 0..4000 {
            let pair = drawn_points(&map, &mut stream);
            (0..2).for_each(|finger| counts[finger][pair[finger]] += 1);
        }
        assert!(counts[0][2] == 0 && counts[1][0] == 0);
        assert!((f64::from(counts[0][0]) / 4000.0 - 0.2).abs() < 0.03 && (f64::from(counts[1][1]) / 4000.0 - 0.5).abs() < 0.03);
    }

    #[test]
    fn ranking_drops_repeats_and_puts_first_what_most_codes_agree_on() {
        let map = |p: f32, peak: usize| {
            let channel: Vec<f32> = (0..3).map(|i| if i == peak { p } else { (1.0 - p) / 2.0 }).collect();
            ContactMap { fingers: [channel.clone(), channel] }
        };
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        // One sharp map against two that agree: 2 · 0.5² + 0.1² = 0.51 about point 0, 2 · 0.25² + 0.8² = 0.765 about point 2.
        let maps = [map(0.5, 0), map(0.8, 2), map(0.5, 0)];
        assert_eq!(ranked_peaks(&maps, &points, 0.01, [0.0, 1.0]), [[2, 2], [0, 0]]);
        // Now 2 · 0.6² + 0.1² + 0.3² = 0.82 about point 0, 2 · 0.2² + 0.8² + 0.3² = 0.81 about point 2.
        let maps = [map(0.6, 0), map(0.8, 2), map(0.6, 0), map(0.4, 1)];
        assert_eq!(ranked_peaks(&maps, &points, 0.01, [0.0, 1.0]), [[0, 0], [2, 2], [1, 1]]);
    }
}
