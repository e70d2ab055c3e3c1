//! Poses as documents write them, and directions of any length.

use crate::geometry::{self, Pose};
use serde::{Deserialize, Serialize};

/// A pose as documents write it. A field left out is at its neutral value, so `{}` is the identity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JsonPose {
    /// x, y, z (m).
    #[serde(default)]
    pub position: [f64; 3],
    /// w, x, y, z; need not be unit on the way in.
    #[serde(default = "no_rotation")]
    pub quaternion: [f64; 4],
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

impl Default for JsonPose {
    fn default() -> Self {
        Self { position: [0.0; 3], quaternion: no_rotation() }
    }
}

impl JsonPose {
    /// The pose, its quaternion normalised without overflow or underflow; none if the quaternion is zero.
    pub fn to_pose(&self) -> Option<Pose> {
        normalized(self.quaternion).map(|quaternion| geometry::pose(self.position, quaternion))
    }
}

impl From<&Pose> for JsonPose {
    fn from(pose: &Pose) -> Self {
        let (position, quaternion) = geometry::position_quaternion(pose);
        Self { position, quaternion }
    }
}

/// The unit vector along `vector`, at any finite magnitude; none for the zero vector.
pub fn normalized<const N: usize>(vector: [f64; N]) -> Option<[f64; N]> {
    let largest = vector.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    if largest == 0.0 {
        return None;
    }
    let scaled = vector.map(|x| x / largest);
    let norm = scaled.iter().map(|x| x * x).sum::<f64>().sqrt();
    Some(scaled.map(|x| x / norm))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_any_finite_magnitude_have_a_direction() {
        for scale in [5e-324, 1e-300, 1.0, 1e300, f64::MAX] {
            let [x, y] = normalized([scale, -scale]).unwrap();
            assert!((x - 0.5_f64.sqrt()).abs() < 1e-15 && (y + 0.5_f64.sqrt()).abs() < 1e-15, "{scale}");
        }
        assert_eq!(normalized([0.0, -0.0]), None);
    }

    #[test]
    fn an_empty_pose_is_the_identity() {
        let pose: JsonPose = serde_json::from_str("{}").unwrap();
        assert_eq!(pose.to_pose(), Some(Pose::identity()));
    }
}
