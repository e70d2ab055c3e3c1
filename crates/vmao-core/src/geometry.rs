//! Rigid transforms, rotation logarithms and interpolation. Frames are named `to_from_of`: `world_from_part`.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// A rigid transform, rotation then translation; metres.
pub type Pose = Isometry3<f64>;

/// The pose with this position (m) and unit quaternion in w, x, y, z order (normalised here).
pub fn pose(position: [f64; 3], quaternion_wxyz: [f64; 4]) -> Pose {
    let [w, x, y, z] = quaternion_wxyz;
    Pose::from_parts(Translation3::from(Vector3::from(position)), UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)))
}

/// A pure translation (m).
pub fn translation(x: f64, y: f64, z: f64) -> Pose {
    Pose::translation(x, y, z)
}

/// Position and w, x, y, z quaternion of a pose: how poses leave the program.
pub fn position_quaternion(pose: &Pose) -> ([f64; 3], [f64; 4]) {
    let q = pose.rotation.quaternion();
    (pose.translation.vector.into(), [q.w, q.i, q.j, q.k])
}

/// The rotation vector of `rotation`: axis times angle, angle in [0, π].
///
/// Exact at the identity; at π the axis is one of the two valid ones, chosen by the quaternion's sign.
pub fn rotation_log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let q = rotation.quaternion();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let (w, v) = (q.w * sign, q.imag() * sign);
    let sine = v.norm();
    if sine < 1e-8 {
        // atan2(s, w)/s -> 1/w as s -> 0
        return v * (2.0 / w);
    }
    v * (2.0 * sine.atan2(w) / sine)
}

/// The rotation by `vector.norm()` radians about `vector`.
pub fn rotation_exp(vector: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(*vector)
}

/// Angle between two orientations, in [0, π] rad.
pub fn rotation_distance(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    rotation_log(&(a.inverse() * b)).norm()
}

/// Distance between two poses' origins (m), and the angle between their orientations in [0, π] rad.
pub fn pose_distance(a: &Pose, b: &Pose) -> [f64; 2] {
    [(a.translation.vector - b.translation.vector).norm(), rotation_distance(&a.rotation, &b.rotation)]
}

/// The pose a `fraction` of the way from `start` to `end`: straight in position, constant-axis in rotation.
pub fn interpolate(start: &Pose, end: &Pose, fraction: f64) -> Pose {
    let turn = rotation_log(&(end.rotation * start.rotation.inverse()));
    Pose::from_parts(
        Translation3::from(start.translation.vector.lerp(&end.translation.vector, fraction)),
        rotation_exp(&(turn * fraction)) * start.rotation,
    )
}

/// Minimum-jerk progress in [0, 1] at `time` of a motion that lasts `duration` (s): 10s³ − 15s⁴ + 6s⁵.
pub fn minimum_jerk(time: f64, duration: f64) -> f64 {
    let s = (time / duration).clamp(0.0, 1.0);
    s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn log_is_zero_at_the_identity_and_pi_at_a_half_turn() {
        assert_eq!(rotation_log(&UnitQuaternion::identity()), Vector3::zeros());
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let turn = rotation_log(&rotation_exp(&(axis * PI)));
            assert!((turn.norm() - PI).abs() < 1e-12 && turn.cross(&axis).norm() < 1e-9, "{turn:?}");
        }
    }

    #[test]
    fn log_inverts_exp_down_to_the_smallest_angles() {
        for angle in [1e-300, 1e-12, 1e-7, 1e-3, 1.0, 3.0, PI - 1e-9] {
            let vector = Vector3::new(0.3, -0.8, 0.5).normalize() * angle;
            let back = rotation_log(&rotation_exp(&vector));
            assert!((back - vector).norm() <= 1e-9 * angle.max(1e-6), "{angle}: {back:?}");
        }
    }

    #[test]
    fn interpolation_meets_both_ends_and_halves_the_angle() {
        let a = pose([0.1, 0.2, 0.3], [0.9, 0.1, -0.3, 0.2]);
        let b = pose([-0.4, 0.5, 0.0], [0.2, 0.7, 0.3, -0.5]);
        assert!((interpolate(&a, &b, 0.0).to_homogeneous() - a.to_homogeneous()).norm() < 1e-12);
        assert!((interpolate(&a, &b, 1.0).to_homogeneous() - b.to_homogeneous()).norm() < 1e-12);
        let middle = interpolate(&a, &b, 0.5);
        let whole = rotation_distance(&a.rotation, &b.rotation);
        assert!((rotation_distance(&a.rotation, &middle.rotation) - whole / 2.0).abs() < 1e-12);
    }
}
