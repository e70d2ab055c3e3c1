//! When two contacts of one part are the same grip, and which grips make a mode.

use nalgebra::{Point3, center};
use vmao_core::contact_model::FingerPoints;

/// How far two contacts are apart (m): the farther of their fingers' distances, in the better of the two fingerings.
///
/// D(a, b) = min over π of max over f of ‖a_f − b_π(f)‖; a parallel gripper is symmetric, so π may swap the fingers.
pub fn grip_distance(a: &FingerPoints, b: &FingerPoints) -> f64 {
    let worst = |swap: usize| (0..2).map(|finger| (a[finger] - b[finger ^ swap]).norm()).fold(0.0, f64::max);
    worst(0).min(worst(1))
}

/// The middle of the two fingers.
pub(super) fn middle(fingers: &FingerPoints) -> Point3<f64> {
    center(&fingers[0], &fingers[1])
}

/// Angle between two closing axes, either way round (rad); a right angle where one has no length.
fn axis_angle(a: &FingerPoints, b: &FingerPoints) -> f64 {
    let (a, b) = (a[1] - a[0], b[1] - b[0]);
    let lengths = a.norm() * b.norm();
    if lengths > 0.0 { (a.dot(&b) / lengths).abs().min(1.0).acos() } else { std::f64::consts::FRAC_PI_2 }
}

/// The mode of each grip, numbered in the order of their first members: single linkage.
///
/// Two grips are linked if their middles are within `distance` (m) and their closing axes within `angle` (rad).
pub fn modes(grips: &[FingerPoints], distance: f64, angle: f64) -> Vec<usize> {
    let linked = |a: &FingerPoints, b: &FingerPoints| (middle(a) - middle(b)).norm() <= distance && axis_angle(a, b) <= angle;
    let mut mode = vec![usize::MAX; grips.len()];
    let mut count = 0;
    for first in 0..grips.len() {
        if mode[first] != usize::MAX {
            continue;
        }
        mode[first] = count;
        let mut open = vec![first];
        while let Some(at) = open.pop() {
            for other in 0..grips.len() {
                if mode[other] == usize::MAX && linked(&grips[at], &grips[other]) {
                    mode[other] = count;
                    open.push(other);
                }
            }
        }
        count += 1;
    }
    mode
}

/// How samples compare with reference grips.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison {
    /// Share of the reference grips with a sample within the distance: the hit rate of so many samples.
    pub hits: f64,
    /// Share of the modes with such a grip.
    pub coverage: f64,
    /// Share of the samples within the distance of a reference grip; none without samples.
    pub precision: Option<f64>,
    /// Mean distance between the middles of two samples (m); none with fewer than two.
    pub diversity: Option<f64>,
}

impl Comparison {
    /// The mean of each number over those that have it.
    pub(super) fn mean(all: &[&Self]) -> Self {
        let of = |number: &dyn Fn(&Self) -> Option<f64>| mean(&all.iter().filter_map(|c| number(c)).collect::<Vec<f64>>());
        Self {
            hits: of(&|c| Some(c.hits)).unwrap_or(0.0),
            coverage: of(&|c| Some(c.coverage)).unwrap_or(0.0),
            precision: of(&|c| c.precision),
            diversity: of(&|c| c.diversity),
        }
    }
}

/// The mean of these values; none of nothing.
pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Share of the grips within `distance` (m) of another one; none with fewer than two.
pub(super) fn left_out(grips: &[FingerPoints], distance: f64) -> Option<f64> {
    let near = |(at, grip): (usize, &FingerPoints)| {
        let others = grips[..at].iter().chain(&grips[at + 1..]);
        f64::from(u8::from(others.into_iter().any(|other| grip_distance(grip, other) <= distance)))
    };
    if grips.len() < 2 { None } else { mean(&grips.iter().enumerate().map(near).collect::<Vec<f64>>()) }
}

/// Compares samples with at least one reference grip, whose modes are given; `distance` in m.
pub fn compare(samples: &[FingerPoints], references: &[FingerPoints], modes: &[usize], distance: f64) -> Comparison {
    let same = |a: &FingerPoints, b: &FingerPoints| grip_distance(a, b) <= distance;
    let hit: Vec<bool> = references.iter().map(|grip| samples.iter().any(|sample| same(sample, grip))).collect();
    let count = modes.iter().max().map_or(0, |last| last + 1);
    let mut covered = vec![false; count];
    modes.iter().zip(&hit).for_each(|(&mode, &hit)| covered[mode] |= hit);
    let share = |flags: &[bool]| flags.iter().filter(|&&flag| flag).count() as f64 / flags.len().max(1) as f64;
    let precise: Vec<bool> = samples.iter().map(|sample| references.iter().any(|grip| same(sample, grip))).collect();
    Comparison {
        hits: share(&hit),
        coverage: share(&covered),
        precision: (!samples.is_empty()).then(|| share(&precise)),
        diversity: diversity(samples),
    }
}

/// Mean distance between the middles of two of these grips (m); none with fewer than two.
pub fn diversity(samples: &[FingerPoints]) -> Option<f64> {
    let pairs = samples.len() * samples.len().saturating_sub(1) / 2;
    let to_later =
        |(index, a): (usize, &FingerPoints)| -> f64 { samples[index + 1..].iter().map(|b| (middle(a) - middle(b)).norm()).sum() };
    (pairs > 0).then(|| samples.iter().enumerate().map(to_later).sum::<f64>() / pairs as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grip across y at x (m), opened by `width`.
    fn grip(x: f64, width: f64) -> FingerPoints {
        [Point3::new(x, width / 2.0, 0.0), Point3::new(x, -width / 2.0, 0.0)]
    }

    #[test]
    fn a_swapped_grip_is_the_same_and_the_farther_finger_counts() {
        let [a, b] = grip(0.0, 0.02);
        assert_eq!(grip_distance(&[a, b], &[b, a]), 0.0);
        assert!((grip_distance(&grip(0.0, 0.02), &grip(0.03, 0.02)) - 0.03).abs() < 1e-15);
        let bent = [a, Point3::new(0.007, -0.01, 0.0)];
        assert!((grip_distance(&[a, b], &bent) - 0.007).abs() < 1e-15);
    }

    #[test]
    fn modes_are_chains_of_near_grips_with_like_axes() {
        let across_x = |x: f64| [Point3::new(x - 0.01, 0.0, 0.0), Point3::new(x + 0.01, 0.0, 0.0)];
        let grips = [grip(0.0, 0.02), grip(0.1, 0.02), grip(0.015, 0.03), across_x(0.016), grip(0.03, 0.02)];
        assert_eq!(modes(&grips, 0.016, 0.5), [0, 1, 0, 2, 0], "0.03 reaches 0 through 0.015; another axis is another mode");
        assert_eq!(modes(&grips, 0.01, 0.5), [0, 1, 2, 3, 4]);
        assert_eq!(modes(&[], 0.01, 0.5), Vec::<usize>::new());
        let swapped = [grip(0.0, 0.02), grip(0.0, -0.02)];
        assert_eq!(modes(&swapped, 0.01, 0.1), [0, 0], "either fingering is the same way to hold");
    }

    #[test]
    fn coverage_precision_and_hits_of_a_known_set() {
        // Two modes: three grips about 0 and one at 0.1. Four samples: two near 0, one at 0.2, one at 0.1.
        let references = [grip(0.0, 0.02), grip(0.004, 0.02), grip(0.02, 0.02), grip(0.1, 0.02)];
        let known = [0, 0, 0, 1];
        let samples = [grip(0.001, 0.02), grip(0.003, 0.02), grip(0.2, 0.02), grip(0.1, 0.02)];
        let found = compare(&samples, &references, &known, 0.005);
        assert_eq!((found.hits, found.coverage, found.precision), (0.75, 1.0, Some(0.75)));
        // |x| differences: 2, 199, 99, 197, 97, 100 mm.
        assert!((found.diversity.unwrap() - 0.694 / 6.0).abs() < 1e-12);
        let one = compare(&samples[..1], &references, &known, 0.005);
        assert_eq!((one.hits, one.coverage, one.precision, one.diversity), (0.5, 0.5, Some(1.0), None));
        assert_eq!(left_out(&references, 0.005), Some(0.5), "0 and 4 mm have each other");
        assert_eq!(left_out(&references[..1], 0.005), None);
        let both = Comparison::mean(&[&found, &one]);
        assert_eq!((both.hits, both.precision, both.diversity), (0.625, Some(0.875), found.diversity));
        let none = compare(&[], &references, &known, 0.005);
        assert_eq!((none.hits, none.coverage, none.precision), (0.0, 0.0, None));
    }
}
