//! From a world-frame cloud to what the network reads: centring, features, label maps.

use crate::config::NetworkConfig;
use crate::error::Error;
use crate::kernels::cross_entropy::FINGERS;
use crate::neighbours::squared_distance;

/// Numbers per point that the scene encoder reads: centred position and colour.
pub(crate) const FEATURES: usize = 6;

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

/// The cloud in the network's frame: xy from the geometric median of what stands on the table, z from the height origin (m).
///
/// The median stays with the many points of the object where a mean would follow the few of an arm. A cloud with nothing above the
/// table is centred on its own median. The frame moves and turns with the cloud along the table and keeps heights.
pub(crate) fn centre(points: &[[f32; 3]], config: &NetworkConfig) -> Vec<[f32; 3]> {
    let mut standing: Vec<[f64; 2]> =
        points.iter().filter(|p| p[2] > config.table_height).map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
    if standing.is_empty() {
        standing = points.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect();
    }
    let [x, y] = geometric_median(&standing).map(|x| x as f32);
    points.iter().map(|p| [p[0] - x, p[1] - y, p[2] - config.height_origin]).collect()
}

/// The point with the least sum of distances to `points`: Weiszfeld's iteration from the mean, a fixed number of steps.
fn geometric_median(points: &[[f64; 2]]) -> [f64; 2] {
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

/// Rows [x, y, z, r, g, b] of a centred cloud, positions in `position_unit`, colours about zero.
pub(crate) fn features(points: &[[f32; 3]], colors: &[[f32; 3]], config: &NetworkConfig) -> Vec<f32> {
    let mut rows = Vec::with_capacity(points.len() * FEATURES);
    for (p, c) in points.iter().zip(colors) {
        rows.extend(p.map(|x| x / config.position_unit));
        rows.extend(c.map(|x| 2.0 * x - 1.0));
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

/// Rows [x, y, z, r, g, b, map of finger 1, map of finger 2] for the posterior encoder; each map in units of its largest value.
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

    #[test]
    fn the_frame_follows_the_object_and_keeps_heights() {
        let config = NetworkConfig::small();
        let scene = [[1.0, 2.0, 0.02], [1.2, 2.0, 0.04], [1.0, 2.2, 0.04], [1.2, 2.2, 0.04], [5.0, -3.0, 0.0]];
        let centred = centre(&scene, &config);
        assert!((centred[0][0] + 0.1).abs() < 1e-6 && (centred[3][1] - 0.1).abs() < 1e-6);
        assert!((centred[1][2] - (0.04 - config.height_origin)).abs() < 1e-7);
        let flat = centre(&[[1.0, 0.0, 0.0], [3.0, 0.0, 0.001]], &config);
        assert_eq!([flat[0][0], flat[1][0]], [-1.0, 1.0]);
    }

    #[test]
    fn a_few_points_of_an_arm_hardly_move_the_frame() {
        let mut points: Vec<[f64; 2]> = (0..80).map(|i| [f64::from(i % 9) * 0.01, f64::from(i % 5) * 0.01]).collect();
        let alone = geometric_median(&points);
        points.extend([[0.3, 0.4]; 16]);
        let beside = geometric_median(&points);
        assert!((beside[0] - alone[0]).hypot(beside[1] - alone[1]) < 0.01, "{alone:?} {beside:?}: a mean moves by 0.08");
    }
}
