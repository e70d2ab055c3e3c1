//! From two contact points to gripper poses: the closing axis is given, the approach about it is free.

use crate::geometry::Pose;
use nalgebra::{Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

/// A way to bring the gripper to two contact points.
#[derive(Debug, Clone, PartialEq)]
pub struct GripperPose {
    /// World pose of the tool frame at the grasp: y through the contacts, z the approach.
    pub world_from_tool: Pose,
    /// Angle of the approach about the closing axis, from straight down (rad).
    pub approach_angle: f64,
}

impl GripperPose {
    /// The tool pose a `distance` (m) back along the approach.
    pub fn backed_off(&self, distance: f64) -> Pose {
        self.world_from_tool * Translation3::new(0.0, 0.0, -distance)
    }
}

/// All gripper poses on these finger points: `count` approaches evenly about the closing axis, each with both fingerings.
///
/// The tool's origin is the middle of the points. A parallel gripper is symmetric, so finger 1 may lie at +y or at -y.
/// Straight down is the first approach, then alternating to both sides. Empty if the points coincide.
pub fn gripper_poses(fingers: &[Point3<f64>; 2], count: usize) -> Vec<GripperPose> {
    let Some(closing) = Unit::try_new(fingers[0] - fingers[1], 1e-6) else { return Vec::new() };
    let middle = nalgebra::center(&fingers[0], &fingers[1]);
    // Straight down, as far as the closing axis allows; along x if the axis itself is vertical.
    let down = -Vector3::z();
    let across = down - closing.into_inner() * closing.dot(&down);
    let across = Unit::try_new(across, 1e-3).unwrap_or_else(|| {
        let level = Vector3::x() - closing.into_inner() * closing.x;
        Unit::new_normalize(level)
    });
    let mut poses = Vec::with_capacity(2 * count);
    for index in 0..count {
        let side = if index % 2 == 0 { 1.0 } else { -1.0 };
        let angle = side * index.div_ceil(2) as f64 * std::f64::consts::TAU / count as f64;
        let approach = Rotation3::from_axis_angle(&closing, angle) * across.into_inner();
        for fingering in [1.0, -1.0] {
            let y = closing.into_inner() * fingering;
            let x = y.cross(&approach);
            let rotation = Rotation3::from_basis_unchecked(&[x, y, approach]);
            poses.push(GripperPose {
                world_from_tool: Pose::from_parts(
                    Translation3::from(middle.coords),
                    UnitQuaternion::from_rotation_matrix(&rotation),
                ),
                approach_angle: angle,
            });
        }
    }
    poses
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(pose: &GripperPose) -> [Vector3<f64>; 3] {
        [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| pose.world_from_tool.rotation * axis)
    }

    #[test]
    fn the_first_pose_of_a_level_grasp_looks_straight_down_with_its_fingers_on_the_points() {
        let fingers = [Point3::new(0.1, 0.23, 0.05), Point3::new(0.1, 0.2, 0.05)];
        let poses = gripper_poses(&fingers, 8);
        assert_eq!(poses.len(), 16);
        let [_, y, z] = axes(&poses[0]);
        assert!((z + Vector3::z()).norm() < 1e-12 && (y - Vector3::y()).norm() < 1e-12);
        for pose in &poses {
            for (finger, sign) in fingers.iter().zip([1.0, -1.0]) {
                let in_tool = pose.world_from_tool.inverse_transform_point(finger);
                assert!(in_tool.x.abs() < 1e-12 && in_tool.z.abs() < 1e-12 && (in_tool.y.abs() - 0.015).abs() < 1e-12, "{sign}");
            }
            let [x, y, z] = axes(pose);
            assert!((x.cross(&y) - z).norm() < 1e-12, "a right-handed frame");
        }
    }

    #[test]
    fn a_vertical_closing_axis_gives_level_approaches() {
        let poses = gripper_poses(&[Point3::new(0.0, 0.0, 0.12), Point3::new(0.0, 0.0, 0.1)], 5);
        assert_eq!(poses.len(), 10);
        for pose in &poses {
            assert!(axes(pose)[2].z.abs() < 1e-12);
        }
    }

    #[test]
    fn coinciding_points_give_no_pose() {
        assert!(gripper_poses(&[Point3::origin(), Point3::origin()], 8).is_empty());
    }
}
