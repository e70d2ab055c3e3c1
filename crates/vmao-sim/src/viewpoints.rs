//! Where the cameras stand: evenly around the table, or wherever they are put.

use crate::cameras::CameraConfig;
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::depth_picture::Pinhole;
use vmao_core::geometry::Pose;

/// A camera put where it shall stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Viewpoint {
    /// Where it is, world frame (m).
    pub position: [f64; 3],
    /// What it looks at, world frame (m).
    pub target: [f64; 3],
}

/// What the cameras of the ring look at: the middle of what lies on the table (m).
const RING_TARGET: [f64; 3] = [0.0, 0.0, 0.05];

impl CameraConfig {
    /// All cameras: those of `viewpoints`, or else `count` around the table.
    pub(crate) fn pinholes(&self) -> Vec<Pinhole> {
        let ring = || (0..self.count).map(|camera| self.ring_viewpoint(camera)).collect();
        let viewpoints: Vec<Viewpoint> = if self.viewpoints.is_empty() { ring() } else { self.viewpoints.clone() };
        viewpoints.iter().map(|viewpoint| self.pinhole(viewpoint)).collect()
    }

    fn ring_viewpoint(&self, camera: usize) -> Viewpoint {
        // Off the axes of symmetry, so that no two cameras see the same silhouette of the arms.
        let azimuth = std::f64::consts::TAU * (camera as f64 + 0.5) / self.count as f64;
        let elevation = self.elevations[camera % self.elevations.len()];
        Viewpoint { position: [self.distance * azimuth.cos(), self.distance * azimuth.sin(), elevation], target: RING_TARGET }
    }

    fn pinhole(&self, viewpoint: &Viewpoint) -> Pinhole {
        let eye = Vector3::from(viewpoint.position);
        let look = Vector3::from(viewpoint.target) - eye;
        // Straight down there is no upright: then the picture's up is the world's y.
        let up = if look.xy().norm() > 1e-6 * look.norm() { Vector3::z() } else { Vector3::y() };
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::face_towards(&look, &up));
        Pinhole {
            world_from_camera: Pose::from_parts(Point3::from(eye).into(), rotation),
            width: self.width,
            height: self.height,
            half_tangent: (self.field_of_view_deg.to_radians() / 2.0).tan(),
        }
    }
}
