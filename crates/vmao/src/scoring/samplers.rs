//! K contacts from a model: of latent codes, of one map's peaks, of draws; and where a map's contacts come from.

use crate::learned_contacts::{drawn_points, ranked_peaks};
use serde::Serialize;
use vmao_core::contact::ContactMap;
use vmao_core::random::Stream;
use vmao_net::ModelKind;

/// How K contacts are got from one scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampler {
    /// The peaks of V-MAO's maps, one for each latent code.
    VmaoPeak,
    /// A point of each finger's map drawn, one pair for each latent code.
    VmaoDraw,
    /// The peaks of as many codes as there are, the most probable first.
    VmaoRanked,
    /// The most probable pairs of Top-1's map that are apart from each other.
    Top1Peaks,
    /// Pairs drawn from Top-1's map.
    Top1Draw,
    /// Any two points of the cloud.
    Uniform,
}

impl Sampler {
    /// All, in the order of tables.
    pub const ALL: [Self; 6] = [Self::VmaoPeak, Self::VmaoDraw, Self::VmaoRanked, Self::Top1Peaks, Self::Top1Draw, Self::Uniform];

    /// The name in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::VmaoPeak => "V-MAO, peaks",
            Self::VmaoDraw => "V-MAO, draws",
            Self::VmaoRanked => "V-MAO, ranked peaks",
            Self::Top1Peaks => "Top-1, separated peaks",
            Self::Top1Draw => "Top-1, draws",
            Self::Uniform => "uniform",
        }
    }

    /// Whether its samples are independent and alike, so that any K of them say what K samples do.
    pub fn is_independent(self) -> bool {
        match self {
            Self::VmaoPeak | Self::VmaoDraw | Self::Top1Draw | Self::Uniform => true,
            Self::VmaoRanked | Self::Top1Peaks => false,
        }
    }

    /// The model that it asks; none for the baseline.
    pub fn model(self) -> Option<ModelKind> {
        match self {
            Self::VmaoPeak | Self::VmaoDraw | Self::VmaoRanked => Some(ModelKind::Vmao),
            Self::Top1Peaks | Self::Top1Draw => Some(ModelKind::Top1),
            Self::Uniform => None,
        }
    }
}

/// What a map's peaks are, and what Top-1's must keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakRules {
    /// Within which a peak's probability is counted (m): [`ContactMap::masses`].
    pub radius: f64,
    /// Top-1's pairs are at least this far apart: the farther of their fingers' distances (m).
    pub distance: f64,
    /// The least and the largest distance between fingers that a gripper spans (m).
    pub span: [f64; 2],
}

/// At most `count` pairs of point indices from the maps of one model on one cloud, one map for each code.
///
/// `streams` gives the stream of the k-th draw.
pub fn pairs(
    sampler: Sampler,
    maps: &[ContactMap],
    points: &[[f32; 3]],
    rules: PeakRules,
    count: usize,
    streams: &dyn Fn(usize) -> Stream,
) -> Vec<[usize; 2]> {
    let (radius, span) = (rules.radius as f32, rules.span.map(|width| width as f32));
    match sampler {
        Sampler::VmaoPeak => maps.iter().take(count).map(|map| map.peaks(points, radius, span)).collect(),
        Sampler::VmaoDraw => {
            maps.iter().take(count).enumerate().map(|(code, map)| drawn_points(map, &mut streams(code))).collect()
        }
        Sampler::VmaoRanked => ranked_peaks(maps, points, radius, span).into_iter().take(count).collect(),
        Sampler::Top1Peaks => {
            maps.first().map_or_else(Vec::new, |map| separated_peaks(&map.masses(points, radius), points, rules, count))
        }
        Sampler::Top1Draw => {
            let draw = |map: &ContactMap| (0..count).map(|k| drawn_points(map, &mut streams(k))).collect();
            maps.first().map_or_else(Vec::new, draw)
        }
        Sampler::Uniform => {
            let draw = |k| {
                let mut stream = streams(k);
                [0, 1].map(|_| stream.index(points.len()))
            };
            (0..count).map(draw).collect()
        }
    }
}

/// Points of each finger that are combined; the product of two less probable ones is never among the best that are looked at.
const COMBINED: usize = 256;

/// The pairs of the largest products of `masses`, each apart from all before, none that a gripper does not span.
fn separated_peaks(masses: &[Vec<f32>; 2], points: &[[f32; 3]], rules: PeakRules, count: usize) -> Vec<[usize; 2]> {
    let best = |channel: &[f32]| {
        let mut order: Vec<usize> = (0..channel.len()).collect();
        order.sort_by(|&a, &b| channel[b].total_cmp(&channel[a]));
        order.truncate(COMBINED);
        order
    };
    let distance = |a: usize, b: usize| {
        let squared: f64 = (0..3).map(|axis| f64::from(points[a][axis] - points[b][axis]).powi(2)).sum();
        squared.sqrt()
    };
    let mut all: Vec<(f32, [usize; 2])> = Vec::new();
    let second = best(&masses[1]);
    for a in best(&masses[0]) {
        let spanned = second.iter().filter(|&&b| (rules.span[0]..=rules.span[1]).contains(&distance(a, b)));
        all.extend(spanned.map(|&b| (masses[0][a] * masses[1][b], [a, b])));
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<[usize; 2]> = Vec::new();
    for (_, pair) in all {
        if chosen.len() == count {
            break;
        }
        let near = |other: &[usize; 2]| (0..2).all(|f| distance(pair[f], other[f]) < rules.distance);
        if !chosen.iter().any(near) {
            chosen.push(pair);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::slice::from_ref;

    /// Four points on a line 1, 2, 3 cm apart from the first, and a map.
    fn line(first: [f32; 4], second: [f32; 4]) -> (Vec<[f32; 3]>, ContactMap) {
        let points = [0.0, 0.01, 0.02, 0.03].map(|x| [x, 0.0, 0.0]).to_vec();
        (points, ContactMap { fingers: [first.to_vec(), second.to_vec()] })
    }

    fn stream(k: usize) -> Stream {
        Stream::new(3, &[k as u64])
    }

    #[test]
    fn separated_peaks_are_ranked_apart_and_within_the_gripper() {
        let (points, map) = line([0.4, 0.3, 0.2, 0.1], [0.05, 0.35, 0.1, 0.5]);
        let rules = PeakRules { radius: 1e-6, distance: 0.015, span: [0.0, 0.025] };
        // 0-3 is too wide; 1-3 (0.15) is best; 0-1 (0.14) is 2 cm from it at finger 2; 1-1 and 2-3 are near one of them.
        let found = pairs(Sampler::Top1Peaks, from_ref(&map), &points, rules, 3, &stream);
        assert_eq!(found, [[1, 3], [0, 1], [2, 1]]);
        let wide = PeakRules { radius: 1e-6, distance: 1.0, span: [0.0, 1.0] };
        assert_eq!(
            pairs(Sampler::Top1Peaks, from_ref(&map), &points, wide, 3, &stream),
            [[0, 3]],
            "all others are near the best"
        );
    }

    #[test]
    fn draws_follow_the_map_and_depend_on_their_number_only() {
        let (points, map) = line([0.0, 0.5, 0.5, 0.0], [1.0, 0.0, 0.0, 0.0]);
        let rules = PeakRules { radius: 1e-6, distance: 0.01, span: [0.0, 1.0] };
        let draw = |count| pairs(Sampler::Top1Draw, from_ref(&map), &points, rules, count, &stream);
        let all = draw(400);
        assert_eq!(draw(7), all[..7]);
        let ones = all.iter().filter(|pair| pair[0] == 1).count();
        assert!(all.iter().all(|pair| pair[1] == 0 && (1..=2).contains(&pair[0])) && (150..250).contains(&ones), "{ones}");
        let any = pairs(Sampler::Uniform, &[], &points, rules, 400, &stream);
        assert!((0..4).all(|point| any.iter().filter(|pair| pair[0] == point).count() > 60));
    }

    #[test]
    fn codes_give_their_own_peaks_and_ranking_sorts_them() {
        let (points, low) = line([0.4, 0.3, 0.2, 0.1], [0.1, 0.2, 0.3, 0.4]);
        let (_, high) = line([0.0, 0.9, 0.1, 0.0], [0.0, 0.0, 0.1, 0.9]);
        let rules = PeakRules { radius: 1e-6, distance: 0.01, span: [0.0, 1.0] };
        let maps = [low.clone(), high.clone(), low];
        assert_eq!(pairs(Sampler::VmaoPeak, &maps, &points, rules, 9, &stream), [[0, 3], [1, 3], [0, 3]]);
        assert_eq!(pairs(Sampler::VmaoRanked, &maps, &points, rules, 9, &stream), [[1, 3], [0, 3]]);
        assert_eq!(pairs(Sampler::VmaoDraw, &maps, &points, rules, 2, &stream).len(), 2);
    }
}
