//! Where to stand so that given points fill a picture.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use vmao_core::depth_picture::Pinhole;
use vmao_core::geometry::Pose;

/// Share of a picture that what is looked at fills.
const FILLED: f64 = 0.92;
/// Rounds in which middle and distance are found in turns: perspective makes near points larger.
const ROUNDS: usize = 8;

/// A camera that looks at `target` (m) from `distance` (m); world z is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Eye {
    pub(crate) target: Point3<f64>,
    pub(crate) distance: f64,
    /// From +x (rad).
    pub(crate) azimuth: f64,
    /// Above the level (rad).
    pub(crate) elevation: f64,
    /// Vertical field of view (rad).
    pub(crate) field: f64,
}

impl Eye {
    /// Unit vectors to the right, up, and from the target to the eye.
    pub(crate) fn axes(&self) -> [Vector3<f64>; 3] {
        let (sin, cos) = self.azimuth.sin_cos();
        let back = Vector3::new(self.elevation.cos() * cos, self.elevation.cos() * sin, self.elevation.sin());
        let right = Vector3::new(-sin, cos, 0.0);
        [right, back.cross(&right), back]
    }

    /// The camera; its columns run from right to left.
    pub(crate) fn pinhole(&self, width: usize, height: usize) -> Pinhole {
        let [right, up, back] = self.axes();
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[-right, up, -back]));
        let place = self.target.coords + back * self.distance;
        let world_from_camera = Pose::from_parts(place.into(), UnitQuaternion::from_rotation_matrix(&rotation));
        Pinhole { world_from_camera, width, height, half_tangent: (self.field / 2.0).tan() }
    }
}

/// The eye from which balls (middle, radius in m) fill a picture of this width over height; they must not be none.
pub(crate) fn fit(balls: &[(Point3<f64>, f64)], [azimuth, elevation]: [f64; 2], field: f64, aspect: f64) -> Eye {
    let middle = balls.iter().map(|(point, _)| point.coords).sum::<Vector3<f64>>() / balls.len().max(1) as f64;
    let mut eye = Eye { target: middle.into(), distance: 1.0, azimuth, elevation, field };
    let [right, up, back] = eye.axes();
    let high = (field / 2.0).tan() * FILLED;
    for round in 0..ROUNDS {
        let offsets = || balls.iter().map(|(point, radius)| (point - eye.target, *radius));
        let need = |(offset, radius): (Vector3<f64>, f64)| {
            let across = (offset.dot(&right).abs() + radius) / (high * aspect);
            offset.dot(&back) + across.max((offset.dot(&up).abs() + radius) / high)
        };
        let distance = offsets().map(need).fold(0.1, f64::max);
        let span = |axis: &Vector3<f64>| {
            let ends = |(offset, radius): (Vector3<f64>, f64)| {
                let depth = (distance - offset.dot(&back)).max(0.05 * distance);
                [(offset.dot(axis) - radius) / depth, (offset.dot(axis) + radius) / depth]
            };
            offsets().map(ends).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [a, b]| [low.min(a), high.max(b)])
        };
        let shift = [right, up].map(|axis| axis * (span(&axis).iter().sum::<f64>() / 2.0 * distance));
        eye.distance = distance;
        if round + 1 < ROUNDS && !balls.is_empty() {
            eye.target += shift[0] + shift[1];
        }
    }
    eye
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_balls_are_in_the_picture_and_fill_it() {
        let balls = [([0.0, 0.0, 0.0], 0.05), ([0.4, -0.1, 0.3], 0.02), ([-0.2, 0.5, 0.1], 0.0)];
        let balls = balls.map(|(point, radius)| (Point3::from(point), radius));
        let aspect = 1.5;
        let eye = fit(&balls, [0.7, 0.4], 0.5, aspect);
        let camera = eye.pinhole(150, 100).world_from_camera;
        let mut most = 0.0_f64;
        for (point, radius) in balls {
            let seen = camera.inverse_transform_point(&point);
            assert!(seen.z > 0.0);
            let edge = |x: f64, half: f64| (x.abs() + radius) / seen.z / half;
            most = most.max(edge(seen.x, (0.25_f64).tan() * aspect)).max(edge(seen.y, (0.25_f64).tan()));
        }
        assert!((0.8..=1.0).contains(&most), "{most}");
    }

    #[test]
    fn up_is_up_and_the_first_column_is_on_the_right() {
        let eye =
            Eye { target: Point3::origin(), distance: 1.0, azimuth: -std::f64::consts::FRAC_PI_2, elevation: 0.3, field: 0.5 };
        let camera = eye.pinhole(9, 9);
        let seen = camera.world_from_camera.inverse_transform_point(&Point3::new(0.1, 0.0, 0.1));
        // From −y, +x is on the right: a column of negative X.
        assert!(seen.y > 0.0 && seen.x < 0.0 && camera.x(0) < 0.0, "{seen}");
    }
}
