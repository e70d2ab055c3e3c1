//! How bodies move with each other: a link about its joint, a finger along its rail, so that one number a frame says where each is.
//!
//! The joints are found in the motion itself, which knows them to rounding; what moves like no joint keeps whole poses.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::geometry::{Pose, position_quaternion};

/// How well a motion has to follow a joint (m, rad): simulated joints do so to rounding, and chains must not add up.
const EXACT: f64 = 1e-6;
/// Furthest that the point which a body turns about may be from it (m): half a milliradian about it is a millimetre.
pub(super) const FURTHEST: f64 = 2.0;
/// Lengths, axes and quaternions of mounts are rounded to so many to the unit, so that equal arms are equal texts.
const ROUNDED: f64 = 1e7;

/// How a body moves with what carries it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Motion {
    /// Not at all.
    Fixed,
    /// About an axis through a point, both in the body's frame at angle zero: one angle a frame (rad).
    Turns { axis: [f64; 3], anchor: [f64; 3] },
    /// Along an axis of the body's frame: one length a frame (m).
    Slides { axis: [f64; 3] },
    /// Like no joint: a pose a frame.
    Free,
}

/// A motion that was found, the body's pose in its carrier's frame where the joint is at zero, and the joint over time.
#[derive(Debug)]
pub(super) struct Fit {
    pub(super) motion: Motion,
    pub(super) pose: Pose,
    pub(super) values: Vec<f64>,
}

/// The joint that moves a body as in `poses` (carrier from body, a frame each); none if there is none.
///
/// The pose at zero does not depend on where the motion begins, so that equal arms are equal texts: the joint's angle is counted from
/// the pose that has no rotation about the joint's axis (from the first, if that is half a turn across the axis), and its length
/// from the point where the axis passes nearest to the carrier's origin.
pub(super) fn fit(poses: &[Pose]) -> Option<Fit> {
    let first = poses.first()?;
    let moved: Vec<Pose> = poses.iter().map(|pose| first.inv_mul(pose)).collect();
    let furthest = |size: &dyn Fn(&Pose) -> f64| moved.iter().max_by(|a, b| size(a).total_cmp(&size(b)));
    let turned = furthest(&|pose| half_sine(pose))?;
    let shifted = furthest(&|pose| pose.translation.vector.norm())?;
    let rests = |pose: &Pose| 2.0 * half_sine(pose) < EXACT;
    let (motion, values) = if rests(turned) && shifted.translation.vector.norm() < EXACT {
        (Motion::Fixed, Vec::new())
    } else if rests(turned) {
        let axis = rounded(signed(shifted.translation.vector));
        let offset = (first.rotation.inverse() * first.translation.vector).dot(&axis);
        let along = |pose: &Pose| pose.translation.vector.dot(&axis) + offset;
        (Motion::Slides { axis: axis.into() }, moved.iter().map(along).collect())
    } else {
        let axis = rounded(signed(turned.rotation.imag()));
        let anchor = rounded_vector(anchor(turned, &axis));
        // What creeps by a hair seems to turn about a point far away, about which rounded angles would throw it far off.
        if anchor.norm() > FURTHEST {
            return None;
        }
        let mut angles = Vec::with_capacity(moved.len());
        let mut last = twist(&first.rotation, &axis);
        for pose in &moved {
            let angle = twist(&first.rotation, &axis) + 2.0 * pose.rotation.imag().dot(&axis).atan2(pose.rotation.w);
            last += (angle - last + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
            angles.push(last);
        }
        (Motion::Turns { axis: axis.into(), anchor: anchor.into() }, angles)
    };
    let zero = first * displacement(&motion, values.first().copied().unwrap_or(0.0)).inverse();
    let pose = Pose::from_parts(rounded_vector(zero.translation.vector).into(), rounded_quaternion(&zero.rotation));
    let follows = |(frame, seen): (usize, &Pose)| {
        let off = (pose * displacement(&motion, values.get(frame).copied().unwrap_or(0.0))).inv_mul(seen);
        // What is no number follows nothing.
        off.translation.vector.norm() < EXACT && 2.0 * half_sine(&off) < EXACT
    };
    poses.iter().enumerate().all(follows).then_some(Fit { motion, pose, values })
}

/// Where a joint's value takes a body, from its pose at zero.
pub(super) fn displacement(motion: &Motion, value: f64) -> Pose {
    match *motion {
        Motion::Fixed | Motion::Free => Pose::identity(),
        Motion::Slides { axis } => Pose::from_parts((Vector3::from(axis) * value).into(), UnitQuaternion::identity()),
        Motion::Turns { axis, anchor } => {
            let rotation = UnitQuaternion::new(Vector3::from(axis) * value);
            let anchor = Vector3::from(anchor);
            Pose::from_parts((anchor - rotation * anchor).into(), rotation)
        }
    }
}

/// Sine of half the angle of a pose's rotation.
fn half_sine(pose: &Pose) -> f64 {
    pose.rotation.imag().norm()
}

/// The point next to the origin that a turn about `axis` leaves where it is: solves t = (1 − R) c for c at right angles to the axis.
fn anchor(turned: &Pose, axis: &Vector3<f64>) -> Vector3<f64> {
    let t = turned.translation.vector;
    let t = t - axis * t.dot(axis);
    let (sine, cosine) = (turned.rotation.imag().dot(axis), turned.rotation.w);
    (t + axis.cross(&t) * (cosine / sine)) / 2.0
}

/// The angle about `axis` that a rotation has, seen from the carrier; zero where it has none to tell.
fn twist(rotation: &UnitQuaternion<f64>, axis: &Vector3<f64>) -> f64 {
    let along = rotation.imag().dot(axis);
    if along.hypot(rotation.w) < 1e-3 { 0.0 } else { 2.0 * along.atan2(rotation.w) }
}

/// A unit vector along a line: of both, the one whose largest component is positive.
fn signed(along: Vector3<f64>) -> Vector3<f64> {
    let unit = along / along.norm();
    if unit[unit.iamax()] < 0.0 { -unit } else { unit }
}

fn round(value: f64) -> f64 {
    // Adding zero makes −0 and 0 one.
    (value * ROUNDED).round() / ROUNDED + 0.0
}

fn rounded_vector(vector: Vector3<f64>) -> Vector3<f64> {
    vector.map(round)
}

/// A rounded direction, which is one again.
fn rounded(axis: Vector3<f64>) -> Vector3<f64> {
    rounded_vector(axis).normalize()
}

fn rounded_quaternion(rotation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let (_, [w, x, y, z]) = position_quaternion(&Pose::from_parts(Point3::origin().coords.into(), *rotation));
    let sign = if [w, x, y, z].iter().find(|x| x.abs() * ROUNDED > 1.0).is_some_and(|x| *x < 0.0) { -1.0 } else { 1.0 };
    let [w, x, y, z] = [w, x, y, z].map(|x| round(sign * x));
    UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;
    use vmao_core::geometry::{pose, pose_distance};
    use vmao_core::random::Stream;

    fn any_pose(stream: &mut Stream) -> Pose {
        let mut draw = || stream.normal();
        pose([draw(), draw(), draw()], [draw(), draw(), draw(), draw()])
    }

    /// Poses of a body with `motion` at `values`, seen from its carrier.
    fn moved(zero: &Pose, motion: Motion, values: impl Iterator<Item = f64>) -> Vec<Pose> {
        values.map(|value| zero * displacement(&motion, value)).collect()
    }

    #[track_caller]
    fn check(poses: &[Pose]) -> Fit {
        let fit = fit(poses).unwrap();
        for (k, made) in poses.iter().enumerate() {
            let found = fit.pose * displacement(&fit.motion, fit.values.get(k).copied().unwrap_or(0.0));
            assert!(pose_distance(made, &found).into_iter().all(|off| off < 2.0 * EXACT));
        }
        fit
    }

    #[test]
    fn joints_are_found_wherever_they_are_and_whatever_they_do() {
        let mut stream = Stream::new(1, &[]);
        for _ in 0..200 {
            let zero = any_pose(&mut stream);
            let axis = signed(any_pose(&mut stream).translation.vector);
            let anchor = 0.3 * any_pose(&mut stream).translation.vector;
            let anchor = anchor - axis * anchor.dot(&axis);
            let (axis, anchor) = (axis.into(), anchor.into());
            // More than a whole turn, which a robot's last joint may do.
            let turns = check(&moved(&zero, Motion::Turns { axis, anchor }, (0..40).map(|k| 0.2 * f64::from(k) - 1.0)));
            assert!(matches!(turns.motion, Motion::Turns { .. }));
            assert!((turns.values[39] - turns.values[0] - 7.8).abs() < 1e-5);
            let slides = check(&moved(&zero, Motion::Slides { axis }, (0..40).map(|k| 0.01 * f64::from(k))));
            assert!(matches!(slides.motion, Motion::Slides { .. }));
            let rests = check(&moved(&zero, Motion::Fixed, (0..9).map(f64::from)));
            assert_eq!((rests.motion, rests.values.len()), (Motion::Fixed, 0));
        }
    }

    #[test]
    fn the_pose_at_zero_does_not_depend_on_where_the_motion_begins() {
        // As links of robots are mounted: turned by right angles, joint about z.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mounts = [[1.0, 0.0, 0.0, 0.0], [half, -half, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5], [half, 0.0, half, 0.0]];
        for quaternion in mounts {
            let zero = pose([0.1, -0.2, 0.3], quaternion);
            let motion = Motion::Turns { axis: [0.0, 0.0, 1.0], anchor: [0.0; 3] };
            let found: Vec<Fit> =
                [-3.0, -0.4, 1.9].map(|start| check(&moved(&zero, motion, [start, start + 0.7].into_iter()))).into();
            for fit in &found {
                assert_eq!(fit.motion, motion);
                assert_eq!(fit.pose, found[0].pose);
            }
        }
    }

    #[test]
    fn half_a_turn_from_the_first_frame_is_a_joint_too() {
        let motion = Motion::Turns { axis: [0.0, 1.0, 0.0], anchor: [0.2, 0.0, 0.0] };
        let found = check(&moved(&Pose::identity(), motion, [0.0, PI / 2.0, PI].into_iter()));
        assert_eq!(found.motion, motion);
        let swung = pose([0.0; 3], [0.0, 1.0, 0.0, 0.0]);
        check(&moved(&swung, motion, [0.3, 0.4].into_iter()));
    }

    #[test]
    fn what_creeps_is_no_turn_about_a_point_far_away() {
        let crept = pose([0.01, 0.0, 0.0], [1.0, 0.0, 0.0, 5e-6]);
        assert!(fit(&[Pose::identity(), crept]).is_none());
    }

    #[test]
    fn what_follows_no_joint_is_free() {
        let mut stream = Stream::new(2, &[]);
        let wild: Vec<Pose> = (0..5).map(|_| any_pose(&mut stream)).collect();
        assert!(fit(&wild).is_none());
        let screw = |k: f64| pose([0.0, 0.0, 0.01 * k], [(0.1 * k).cos(), 0.0, 0.0, (0.1 * k).sin()]);
        assert!(fit(&[0.0, 1.0, 2.0].map(screw)).is_none());
        let mut lost = vec![Pose::identity(); 4];
        lost[2].translation.x = f64::NAN;
        assert!(fit(&lost).is_none());
        assert!(fit(&[]).is_none());
    }
}
