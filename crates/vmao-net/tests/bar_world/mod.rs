//! A toy with two right answers: a bar under a crossing bar on a table beside an arm, gripped across at one of two places.
//!
//! The bar is 100 × 16 × 20 mm; grips cluster 30 mm either side of its middle; finger 1 is on its left side, finger 2 on its right.
//! The crossing bar, of another colour, sticks out to the left, which tells the sides apart.
#![allow(dead_code, reason = "each test file uses its own part")]

use vmao_core::contact::ContactMap;
use vmao_core::random::Stream;
use vmao_net::Example;

/// Half the length, width, and the height of the bar (m).
const BAR: [f64; 3] = [0.05, 0.008, 0.02];
const CROSSING: [f64; 3] = [0.03, 0.006, 0.014];
/// Distance of either cluster of grips from the middle, and its half width (m).
pub(crate) const MODE: f64 = 0.03;
pub(crate) const SPREAD: f64 = 0.008;

/// A scene with its grip, and where the bar lies.
pub(crate) struct Scene {
    pub(crate) example: Example,
    pub(crate) yaw: f64,
    pub(crate) position: [f64; 2],
    /// −1 or +1: which cluster the grip is from.
    pub(crate) mode: f64,
}

/// Points of the bar, the crossing bar, the table and an arm: the shares of the simulator's cameras.
const COUNTS: [usize; 4] = [440, 270, 155, 155];

pub(crate) fn scene(seed: u64, index: u64) -> Scene {
    denser_scene(seed, index, 1)
}

/// The same with `times` as many points.
pub(crate) fn denser_scene(seed: u64, index: u64, times: usize) -> Scene {
    let mut s = Stream::new(seed, &[index]);
    let yaw = s.range(-std::f64::consts::PI, std::f64::consts::PI);
    let position = [s.range(-0.07, 0.07), s.range(-0.07, 0.07)];
    let tilt = std::f64::consts::FRAC_PI_2 + s.range(-0.3, 0.3);
    let (mut points, mut colors) = (Vec::new(), Vec::new());
    let world = |p: [f64; 3]| {
        let (sin, cos) = yaw.sin_cos();
        [position[0] + cos * p[0] - sin * p[1], position[1] + sin * p[0] + cos * p[1], p[2]].map(|x| x as f32)
    };
    for _ in 0..times * COUNTS[0] {
        points.push(world(on_box(BAR, &mut s)));
        colors.push([0.8, 0.2, 0.15]);
    }
    for _ in 0..times * COUNTS[1] {
        let p = on_box(CROSSING, &mut s);
        let (sin, cos) = tilt.sin_cos();
        let along = p[0] + 0.018;
        points.push(world([cos * along - sin * p[1], sin * along + cos * p[1], p[2]]));
        colors.push([0.15, 0.25, 0.8]);
    }
    for _ in 0..times * COUNTS[2] {
        points.push([s.range(-0.25, 0.25) as f32, s.range(-0.25, 0.25) as f32, 0.0]);
        colors.push([0.6, 0.55, 0.5]);
    }
    let (azimuth, distance, height) = (s.range(0.0, std::f64::consts::TAU), s.range(0.12, 0.2), s.range(0.05, 0.2));
    for _ in 0..times * COUNTS[3] {
        let p = on_box([0.03, 0.03, 0.15], &mut s);
        let (x, y) = (position[0] + distance * azimuth.cos() + p[0], position[1] + distance * azimuth.sin() + p[1]);
        points.push([x, y, height + p[2]].map(|x| x as f32));
        colors.push([0.9, 0.9, 0.9]);
    }
    let mode = if s.unit() < 0.5 { -1.0 } else { 1.0 };
    let along = mode * MODE + s.range(-SPREAD, SPREAD);
    let height = s.range(0.008, 0.014);
    let contacts = [world([along, BAR[1], height]), world([along, -BAR[1], height])];
    Scene { example: Example { points, colors, contacts }, yaw, position, mode }
}

/// A uniform point on the top or on a side of a box that stands on the table.
fn on_box(half: [f64; 3], s: &mut Stream) -> [f64; 3] {
    let [a, b, h] = half;
    let areas = [4.0 * a * b, 4.0 * a * h, 4.0 * b * h];
    let side = if s.unit() < 0.5 { -1.0 } else { 1.0 };
    match s.weighted(&areas) {
        0 => [s.range(-a, a), s.range(-b, b), h],
        1 => [s.range(-a, a), side * b, s.range(0.0, h)],
        _ => [side * a, s.range(-b, b), s.range(0.0, h)],
    }
}

/// Where a map's two peaks lie.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peaks {
    /// Distance of each peak from the nearest place where that finger may touch (m).
    pub(crate) error: [f64; 2],
    /// How far the peaks are apart along the bar (m); zero is exactly opposite.
    pub(crate) shift: f64,
    /// Whether the peaks lie on different sides of the bar.
    pub(crate) across: bool,
    /// Which cluster each peak is nearer to.
    pub(crate) modes: [f64; 2],
}

impl Scene {
    /// A world point in the bar's frame (m).
    pub(crate) fn in_bar(&self, p: [f32; 3]) -> [f64; 3] {
        let (x, y) = (f64::from(p[0]) - self.position[0], f64::from(p[1]) - self.position[1]);
        let (sin, cos) = self.yaw.sin_cos();
        [cos * x + sin * y, cos * y - sin * x, f64::from(p[2])]
    }

    pub(crate) fn peaks(&self, map: &ContactMap) -> Peaks {
        let at = map.peaks(&self.example.points, 0.012, [0.0, 1.0]).map(|i| self.in_bar(self.example.points[i]));
        let error = |p: [f64; 3], side: f64| {
            let along = ((p[0].abs() - MODE).abs() - SPREAD).max(0.0);
            let across = p[1] - side * BAR[1];
            let up = (0.008 - p[2]).max(p[2] - 0.014).max(0.0);
            (along * along + across * across + up * up).sqrt()
        };
        Peaks {
            error: [error(at[0], 1.0), error(at[1], -1.0)],
            shift: (at[0][0] - at[1][0]).abs(),
            across: at[0][1] * at[1][1] < 0.0,
            modes: at.map(|p| p[0].signum()),
        }
    }
}

/// `count` scenes of one seed.
pub(crate) fn scenes(seed: u64, count: u64) -> Vec<Scene> {
    (0..count).map(|i| scene(seed, i)).collect()
}

/// The examples of scenes, as training takes them.
pub(crate) fn examples(scenes: &[Scene]) -> Vec<Example> {
    scenes.iter().map(|s| s.example.clone()).collect()
}

/// How a network's samples compare with the two clusters, over held-out scenes.
#[derive(Debug, Default)]
pub(crate) struct Score {
    /// Share of fingers' peaks within 8 mm of a right place.
    pub(crate) hits: f64,
    /// Mean and 90 % quantile of the peak error (m).
    pub(crate) mean_error: f64,
    pub(crate) error_90: f64,
    /// Share of samples whose peaks are within 10 mm of exactly opposite.
    pub(crate) opposite: f64,
    /// Share of samples whose peaks lie on different sides of the bar.
    pub(crate) across: f64,
    /// Share of samples whose two peaks are in the same cluster.
    pub(crate) same_mode: f64,
    /// Share of scenes where the samples reach both clusters.
    pub(crate) both: f64,
    /// Share of samples in the cluster at +30 mm.
    pub(crate) positive: f64,
}

/// Samples `per_scene` maps of each scene.
pub(crate) fn score(network: &vmao_net::ContactNetwork, held_out: &[Scene], per_scene: u64) -> Score {
    let mut score = Score::default();
    let mut errors = Vec::new();
    let weight = 1.0 / (held_out.len() as f64 * per_scene as f64);
    for (index, scene) in held_out.iter().enumerate() {
        let encoded = network.encode(&scene.example.points, &scene.example.colors).unwrap();
        let (mut low, mut high) = (false, false);
        for sample in 0..per_scene {
            let mut stream = Stream::new(9, &[index as u64, sample]);
            let latent: Vec<f32> = (0..network.latent_size()).map(|_| stream.normal() as f32).collect();
            let peaks = scene.peaks(&network.decode(&encoded, &latent).unwrap());
            errors.extend(peaks.error);
            score.opposite += if peaks.shift < 0.010 { weight } else { 0.0 };
            score.across += if peaks.across { weight } else { 0.0 };
            score.same_mode += if peaks.modes[0] == peaks.modes[1] { weight } else { 0.0 };
            score.positive += if peaks.modes[0] > 0.0 { weight } else { 0.0 };
            low |= peaks.modes[0] < 0.0;
            high |= peaks.modes[0] > 0.0;
        }
        score.both += if low && high { 1.0 / held_out.len() as f64 } else { 0.0 };
    }
    errors.sort_by(f64::total_cmp);
    score.hits = errors.iter().filter(|&&e| e < 0.008).count() as f64 / errors.len() as f64;
    score.mean_error = errors.iter().sum::<f64>() / errors.len() as f64;
    score.error_90 = errors[errors.len() * 9 / 10];
    score
}
