//! From a world-frame cloud to what the network reads: centring, features, label maps.

use crate::config::NetworkConfig;
use crate::error::Error;
use crate::kernels::blocks::vectorised;
use crate::kernels::cross_entropy::FINGERS;
use crate::neighbours::columns::Columns;
use crate::neighbours::squared_distance;
use rayon::prelude::*;

/// Numbers per point that the scene encoder reads: centred position, colour, outward offset.
pub(crate) const FEATURES: usize = 9;

/// One successful grasp: what was seen before it, and where the two fingers touched.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Example {
    /// Cloud, world frame (m).
    pub points: Vec<[f32; 3]>,
    /// Red, green, blue in [0, 1], one for each point.
    pub colors: Vec<[f32; 3]>,
    /// Contact points of finger 1 and finger 2, world frame (m).
    pub contacts: [[f32; 3]; 2],
}

/// Refuses a cloud that the network cannot read: too small, lists of different length, a number that is not finite.
pub(crate) fn check_cloud(points: &[[f32; 3]], colors: &[[f32; 3]], fewest: usize) -> Result<(), Error> {
    let refuse = |what: &str, found: String, expected: String| Err(Error::Input { what: what.to_owned(), found, expected });
    if points.len() < fewest {
        return refuse("cloud", format!("{} points", points.len()), format!("at least {fewest}"));
    }
    if colors.len() != points.len() {
        return refuse("cloud", format!("{} colours for {} points", colors.len(), points.len()), "one for each".to_owned());
    }
    for (what, list) in [("point", points), ("colour", colors)] {
        if let Some(i) = list.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
            return refuse(&format!("{what} {i}"), format!("{:?}", list[i]), "finite numbers".to_owned());
        }
    }
    Ok(())
}

/// Where the network's frame lies in the world.
///
/// Its origin is the geometric median, in x and y, of what stands on the table (of everything, if nothing does), which stays with
/// the many points of the object where a mean would follow the few of an arm. Its x axis is the direction in which the object
/// sticks out: the third moment Σ w |r|² r of the points near the origin, weighted by their density, so that thinly seen arms and
/// table count for little. The frame moves and turns with the object along the table and keeps heights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    origin: [f32; 2],
    cos: f32,
    sin: f32,
}

/// Reach of the points that turn the frame (m).
const FRAME_REACH: f64 = 0.2;

impl Frame {
    /// Of a cloud whose points are `spacing` apart (m).
    pub(crate) fn of(points: &[[f32; 3]], spacing: &[f32], config: &NetworkConfig) -> Self {
        let pairs = points.iter().zip(spacing);
        let mut standing: Vec<[f64; 3]> =
            pairs.clone().filter(|(p, _)| p[2] > config.table_height).map(|(p, s)| weighted(p, *s)).collect();
        if standing.is_empty() {
            standing = pairs.map(|(p, s)| weighted(p, *s)).collect();
        }
        let origin = geometric_median(&standing);
        standing.retain(|p| (p[0] - origin[0]).hypot(p[1] - origin[1]) < FRAME_REACH);
        let total: f64 = standing.iter().map(|p| p[2]).sum();
        let mean = [0, 1].map(|axis| standing.iter().map(|p| p[2] * p[axis]).sum::<f64>() / total);
        let mut moment = [0.0; 2];
        for p in &standing {
            let r = [p[0] - mean[0], p[1] - mean[1]];
            let weight = p[2] * (r[0] * r[0] + r[1] * r[1]);
            (0..2).for_each(|axis| moment[axis] += weight * r[axis]);
        }
        let length = moment[0].hypot(moment[1]);
        let [cos, sin] = if length > 0.0 { moment.map(|m| (m / length) as f32) } else { [1.0, 0.0] };
        Self { origin: origin.map(|x| x as f32), cos, sin }
    }

    /// World points in this frame, z from the height origin (m).
    pub(crate) fn place(&self, points: &[[f32; 3]], config: &NetworkConfig) -> Vec<[f32; 3]> {
        let moved = points.iter().map(|p| [p[0] - self.origin[0], p[1] - self.origin[1], p[2] - config.height_origin]);
        moved.map(|p| self.turn(p)).collect()
    }

    /// A world direction in this frame.
    pub(crate) fn turn(&self, v: [f32; 3]) -> [f32; 3] {
        [self.cos * v[0] + self.sin * v[1], self.cos * v[1] - self.sin * v[0], v[2]]
    }
}

/// x, y and density of a point.
fn weighted(point: &[f32; 3], spacing: f32) -> [f64; 3] {
    /// Spacing below which points count as equally dense (m).
    const SMALLEST: f64 = 1e-3;
    [f64::from(point[0]), f64::from(point[1]), f64::from(spacing).max(SMALLEST).powi(-2)]
}

/// The point in the plane with the least sum of distances to `points` (x, y and a number not read here): Weiszfeld's iteration from the mean, a fixed number of steps.
fn geometric_median(points: &[[f64; 3]]) -> [f64; 2] {
    const STEPS: usize = 30;
    /// Distances below this count as this much, so that a point hit exactly does not divide by zero (m).
    const NEAREST: f64 = 1e-3;
    let mut median = [0.0; 2];
    for step in 0..=STEPS {
        let mut sums = [0.0; 3];
        for p in points {
            let weight = if step == 0 { 1.0 } else { 1.0 / (p[0] - median[0]).hypot(p[1] - median[1]).max(NEAREST) };
            sums[0] += weight * p[0];
            sums[1] += weight * p[1];
            sums[2] += weight;
        }
        median = [sums[0] / sums[2], sums[1] / sums[2]];
    }
    median
}

/// Each point minus the mean of the cloud within `radius` of it, in units of `radius`: it points out of a thin part's side.
///
/// Opposite sides of a handle differ in little else; without it a network takes long to tell the two fingers' sides apart.
pub(crate) fn outward(points: &[[f32; 3]], radius: f32) -> Vec<[f32; 3]> {
    let columns = Columns::new(points);
    let bound = (radius * radius).next_up();
    let one = |&point: &[f32; 3]| {
        let mut sums = [0.0_f64; 4];
        vectorised(
            #[inline(always)]
            || {
                columns.scan(
                    point,
                    bound,
                    #[inline(always)]
                    |start, gaps| {
                        for (lane, _) in gaps.iter().enumerate().filter(|&(_, &gap)| gap < bound) {
                            let other = points[start + lane];
                            (0..3).for_each(|axis| sums[axis] += f64::from(point[axis]) - f64::from(other[axis]));
                            sums[3] += 1.0;
                        }
                        bound
                    },
                );
            },
        );
        [0, 1, 2].map(|axis| (sums[axis] / (sums[3] * f64::from(radius))) as f32)
    };
    points.par_iter().with_min_len(OUTWARD_TASK).map(one).collect()
}

/// Points that one task of [`outward`] works on.
const OUTWARD_TASK: usize = 128;

/// Rows [x, y, z, r, g, b, outward offset] of a cloud in its frame, positions in `position_unit`, colours about zero.
pub(crate) fn features(points: &[[f32; 3]], colors: &[[f32; 3]], outward: &[[f32; 3]], config: &NetworkConfig) -> Vec<f32> {
    let mut rows = Vec::with_capacity(points.len() * FEATURES);
    for ((p, c), o) in points.iter().zip(colors).zip(outward) {
        rows.extend(p.map(|x| x / config.position_unit));
        rows.extend(c.map(|x| 2.0 * x - 1.0));
        rows.extend(o.map(|x| 2.0 * x));
    }
    rows
}

/// A contact point spread over the cloud: exp(−d² / 2σ²), normalised over the points; one-hot beyond 3σ of every point.
pub(crate) fn label_map(points: &[[f32; 3]], contact: [f32; 3], sigma: f32) -> Vec<f32> {
    let squared: Vec<f32> = points.iter().map(|&p| squared_distance(p, contact)).collect();
    let closest = (0..squared.len()).fold(0, |best, i| if squared[i] < squared[best] { i } else { best });
    if squared[closest] > 9.0 * sigma * sigma {
        return (0..squared.len()).map(|i| if i == closest { 1.0 } else { 0.0 }).collect();
    }
    let weights: Vec<f64> =
        squared.iter().map(|&d| (-f64::from(d) / (2.0 * f64::from(sigma) * f64::from(sigma))).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / total) as f32).collect()
}

/// Both fingers' label maps, interleaved: points × 2.
pub(crate) fn label_maps(points: &[[f32; 3]], contacts: &[[f32; 3]; FINGERS], sigma: f32) -> Vec<f32> {
    let maps = contacts.map(|contact| label_map(points, contact, sigma));
    maps[0].iter().zip(&maps[1]).flat_map(|(&a, &b)| [a, b]).collect()
}

/// Where each finger's map has its mean, centred frame in `position_unit`: six numbers, x, y, z of finger 1 and of finger 2.
pub(crate) fn map_means(points: &[[f32; 3]], maps: &[f32], config: &NetworkConfig) -> [f32; 3 * FINGERS] {
    let mut sums = [0.0_f64; 3 * FINGERS];
    for (p, m) in points.iter().zip(maps.chunks_exact(FINGERS)) {
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += f64::from(m[i / 3]) * f64::from(p[i % 3]) / f64::from(config.position_unit);
        }
    }
    sums.map(|sum| sum as f32)
}

/// Rows [features, map of finger 1, map of finger 2] for the posterior encoder; each map in units of its largest value.
pub(crate) fn posterior_features(features: &[f32], maps: &[f32]) -> Vec<f32> {
    let largest = |finger: usize| maps.iter().skip(finger).step_by(FINGERS).fold(f32::MIN_POSITIVE, |a, &b| a.max(b));
    let largest = [largest(0), largest(1)];
    let mut rows = Vec::with_capacity(features.len() / FEATURES * (FEATURES + FINGERS));
    for (f, m) in features.chunks_exact(FEATURES).zip(maps.chunks_exact(FINGERS)) {
        rows.extend_from_slice(f);
        rows.extend([m[0] / largest[0], m[1] / largest[1]]);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_a_gaussian_over_the_points() {
        let points = [[0.0, 0.0, 0.0], [0.008, 0.0, 0.0], [0.0, 0.016, 0.0]];
        let map = label_map(&points, [0.0; 3], 0.008);
        let weights = [1.0, (-0.5_f32).exp(), (-2.0_f32).exp()];
        for (found, weight) in map.iter().zip(weights) {
            assert!((found - weight / weights.iter().sum::<f32>()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_contact_far_from_every_point_is_given_to_the_nearest() {
        let points = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]];
        assert_eq!(label_map(&points, [0.0749, 0.0, 0.0], 0.008), vec![0.0, 1.0]);
    }

    fn frame(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let config = NetworkConfig::small();
        Frame::of(points, &vec![0.01; points.len()], &config).place(points, &config)
    }

    #[test]
    fn the_frame_follows_the_object_and_keeps_heights() {
        // A T whose stem is long: the frame's x axis runs along the stem, to its foot.
        let mut scene: Vec<[f32; 3]> = (0..40).map(|i| [1.0 + 0.002 * i as f32, 2.0, 0.02]).collect();
        scene.extend((0..31).map(|i| [1.0, 1.985 + 0.001 * i as f32, 0.04]));
        scene.push([5.0, -3.0, 0.0]);
        let there = frame(&scene);
        let config = NetworkConfig::small();
        assert!((there[39][0] - there[0][0] - 0.078).abs() < 1e-5 && (there[39][1] - there[0][1]).abs() < 1e-3, "{there:?}");
        assert!((there[0][2] - (0.02 - config.height_origin)).abs() < 1e-7);
        let (sin, cos) = 2.0_f32.sin_cos();
        let turned: Vec<[f32; 3]> = scene.iter().map(|p| [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]]).collect();
        for (a, b) in there.iter().zip(frame(&turned)).take(71) {
            assert!((0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-5), "{a:?} {b:?}");
        }
        assert!(frame(&[[1.0, 0.0, 0.0], [3.0, 0.0, 0.001]]).iter().flatten().all(|x| x.is_finite()));
    }

    #[test]
    fn a_few_points_of_an_arm_hardly_move_the_frame() {
        let mut points: Vec<[f64; 3]> = (0..80).map(|i| [f64::from(i % 9) * 0.01, f64::from(i % 5) * 0.01, 1.0]).collect();
        let alone = geometric_median(&points);
        points.extend([[0.3, 0.4, 1.0]; 16]);
        let beside = geometric_median(&points);
        assert!((beside[0] - alone[0]).hypot(beside[1] - alone[1]) < 0.01, "{alone:?} {beside:?}: a mean moves by 0.08");
    }

    #[test]
    fn outward_points_out_of_either_side_of_a_bar() {
        let bar: Vec<[f32; 3]> =
            (0..80).map(|i| [(i / 2) as f32 * 0.002, if i % 2 == 0 { 0.008 } else { -0.008 }, 0.0]).collect();
        let found = outward(&bar, 0.0205);
        for (i, o) in found.iter().enumerate().skip(24).take(32) {
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            // 21 points on the own side, 13 on the other one (within 12 mm along), 16 mm away.
            assert!((o[1] - side * 13.0 / 34.0 * 16.0 / 20.5).abs() < 1e-4 && o[0].abs() < 1e-5, "{o:?}");
        }
        assert_eq!(outward(&[[1.0; 3]], 0.02), vec![[0.0; 3]]);
    }

    #[test]
    fn map_means_are_weighted_positions() {
        let config = NetworkConfig { position_unit: 0.5, ..NetworkConfig::small() };
        let points = [[1.0, 0.0, 2.0], [3.0, 4.0, 0.0]];
        assert_eq!(map_means(&points, &[0.25, 1.0, 0.75, 0.0], &config), [5.0, 6.0, 1.0, 2.0, 0.0, 4.0]);
    }
}
