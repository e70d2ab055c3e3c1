//! Contacts: one point per finger, one grasp per gripper, one tuple per object.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// Index of an object part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PartId(pub u16);

/// Index of a robot arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ArmId(pub u16);

/// Where the two fingers of one gripper touch one part: points in that part's frame (m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The part held.
    pub part: PartId,
    /// Finger 1 and finger 2, part frame.
    pub fingers: [Point3<f64>; 2],
}

impl Contact {
    /// Distance between the two finger points (m): how far the gripper must open.
    pub fn width(&self) -> f64 {
        (self.fingers[1] - self.fingers[0]).norm()
    }
}

/// One contact for each gripper (Algorithm 1's `s`), in the order of the grasps.
pub type ContactTuple = Vec<Contact>;

/// Per-point probabilities that a finger touches there; one value per cloud point and finger, each channel sums to one.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactMap {
    /// Finger 1's and finger 2's probabilities, each as long as the cloud.
    pub fingers: [Vec<f32>; 2],
}

/// Points with less than this share of the greatest probability are no peaks, whatever lies about them.
const LEAST_PEAK: f32 = 0.1;

impl ContactMap {
    /// The probability about each of `points` (m), for each finger: mᵢ = Σⱼ pⱼ max(0, 1 − ‖xᵢ − xⱼ‖²/r²), r > 0.
    ///
    /// A point's own probability is that of the surface it stands for, more where the cloud is thin; what lies within a
    /// radius does not depend on the cloud. Zero where the point's own is below a tenth of the greatest.
    pub fn masses(&self, points: &[[f32; 3]], radius: f32) -> [Vec<f32>; 2] {
        self.fingers.each_ref().map(|channel| {
            let least = LEAST_PEAK * channel.iter().copied().fold(0.0, f32::max);
            channel.iter().zip(points).map(|(&p, x)| if p >= least { about(channel, points, x, radius) } else { 0.0 }).collect()
        })
    }

    /// The product of the probabilities about the two points of a pair, mᵢ of [`Self::masses`] without its lower bound.
    pub fn pair_mass(&self, [first, second]: [usize; 2], points: &[[f32; 3]], radius: f32) -> f32 {
        about(&self.fingers[0], points, &points[first], radius) * about(&self.fingers[1], points, &points[second], radius)
    }

    /// The pair of points, one for each finger, with the largest product of [`Self::masses`] among those that the gripper spans:
    /// `span` are its least and its largest distance between fingers (m). Ties go to the lower indices.
    ///
    /// If it spans no pair, the largest of each finger.
    pub fn peaks(&self, points: &[[f32; 3]], radius: f32, span: [f32; 2]) -> [usize; 2] {
        let masses = self.masses(points, radius);
        let [first, second] = masses.each_ref().map(|masses| ranked(masses));
        let spanned = |a: usize, b: usize| (span[0]..=span[1]).contains(&squared_distance(&points[a], &points[b]).sqrt());
        let mut best: Option<(f32, [usize; 2])> = None;
        for &a in &first {
            // Both lists fall, so that what follows the first spanned or lesser product is no better.
            for &b in &second {
                let mass = masses[0][a] * masses[1][b];
                if best.is_some_and(|(most, _)| mass <= most) {
                    break;
                }
                if spanned(a, b) {
                    best = Some((mass, [a, b]));
                    break;
                }
            }
        }
        best.map_or_else(|| [first, second].map(|ranked| ranked.first().copied().unwrap_or(0)), |(_, pair)| pair)
    }
}

/// Σⱼ pⱼ max(0, 1 − ‖x − xⱼ‖²/r²).
fn about(channel: &[f32], points: &[[f32; 3]], x: &[f32; 3], radius: f32) -> f32 {
    let near = |y: &[f32; 3]| (1.0 - squared_distance(x, y) / (radius * radius)).max(0.0);
    channel.iter().zip(points).map(|(p, y)| p * near(y)).sum()
}

fn squared_distance(x: &[f32; 3], y: &[f32; 3]) -> f32 {
    (0..3).map(|axis| (x[axis] - y[axis]) * (x[axis] - y[axis])).sum()
}

/// The indices of the values above zero, largest first, the lower index of equals first.
fn ranked(values: &[f32]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).filter(|&i| values[i] > 0.0).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_lies_where_the_surface_has_most_whatever_the_density_of_points() {
        // A line of 100 mm with ten times as many points in its first half, and a density of contacts largest at 30 mm.
        let mut points: Vec<[f32; 3]> = (0..100).map(|i| [i as f32 * 0.0005, 0.0, 0.0]).collect();
        points.extend((0..10).map(|i| [0.05 + i as f32 * 0.005, 0.0, 0.0]));
        let density = |x: f32| (-(x - 0.03) * (x - 0.03) / (2.0 * 0.015 * 0.015)).exp();
        let spacing = |i: usize| if i < 100 { 0.0005 } else { 0.005 };
        let mut channel: Vec<f32> = points.iter().enumerate().map(|(i, p)| density(p[0]) * spacing(i)).collect();
        let total: f32 = channel.iter().sum();
        channel.iter_mut().for_each(|p| *p /= total);
        let single = ranked(&channel)[0];
        assert!(points[single][0] > 0.045, "the most probable single point stands for more surface");
        let map = ContactMap { fingers: [channel.clone(), channel] };
        for peak in map.peaks(&points, 0.012, [0.0, 1.0]) {
            assert!((points[peak][0] - 0.03).abs() < 0.002, "{}", points[peak][0]);
        }
        // Within a radius smaller than all distances each point stands for itself.
        assert_eq!(map.peaks(&points, 1e-5, [0.0, 1.0]), [single; 2]);
    }

    #[test]
    fn masses_are_hat_weighted_sums() {
        let points = [[0.0, 0.0, 0.0], [0.005, 0.0, 0.0], [0.02, 0.0, 0.0]];
        let map = ContactMap { fingers: [vec![0.5, 0.3, 0.2], vec![0.0, 0.05, 0.95]] };
        let [first, second] = map.masses(&points, 0.01);
        let expected = [0.5 + 0.75 * 0.3, 0.3 + 0.75 * 0.5, 0.2];
        assert!(first.iter().zip(expected).all(|(m, e)| (m - e).abs() < 1e-6), "{first:?}");
        assert_eq!((second[0], second[1]), (0.0, 0.0));
        assert_eq!(map.peaks(&points, 0.01, [0.0, 1.0]), [0, 2]);
        assert!((map.pair_mass([0, 1], &points, 0.01) - expected[0] * 0.05).abs() < 1e-6);
    }

    #[test]
    fn peaks_are_the_best_pair_that_a_gripper_spans() {
        let points = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.03, 0.0, 0.0], [0.07, 0.0, 0.0]];
        let map = ContactMap { fingers: [vec![0.4, 0.3, 0.2, 0.1], vec![0.41, 0.1, 0.19, 0.3]] };
        let peaks = |span| map.peaks(&points, 1e-3, span);
        // In one place, then 3 cm apart, then the widest; and all pairs by brute force.
        assert_eq!((peaks([0.0, 1.0]), peaks([0.005, 0.05]), peaks([0.07, 0.08])), ([0, 0], [1, 0], [0, 3]));
        for span in [[0.0, 0.02], [0.015, 0.025], [0.03, 0.06], [0.05, 0.2]] {
            let spans = |(a, b): &(usize, usize)| {
                let distance: f32 = points[*a][0] - points[*b][0];
                (span[0]..=span[1]).contains(&distance.abs())
            };
            let product = |(a, b): (usize, usize)| map.fingers[0][a] * map.fingers[1][b];
            let best = (0..16).map(|k| (k / 4, k % 4)).filter(spans).map(product).fold(0.0, f32::max);
            let [a, b] = peaks(span);
            assert_eq!(product((a, b)), best, "{span:?}");
        }
        // No pair is so far apart: each finger for itself.
        assert_eq!(peaks([0.1, 0.2]), [0, 0]);
    }
}
