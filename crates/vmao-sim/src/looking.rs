//! How fast the cameras look, and what they see pixel by pixel: for comparison with other renderers of the same scene.

use crate::cameras::{CameraConfig, Visible};
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::trial::TrialConfig;
use vmao_core::depth_picture::Pinhole;
use vmao_core::geometry::Pose;
use vmao_core::random::Stream;

/// A scene that stands still, to be looked at.
#[derive(Debug)]
pub struct Still {
    /// The simulator's positions of all joints.
    pub qpos: Vec<f64>,
    /// The cameras.
    pub cameras: Vec<Pinhole>,
    config: CameraConfig,
    visible: Visible,
}

impl Still {
    /// The scene as simulated at its start: arms at home, the object at `world_from_root` with these joint positions.
    pub fn new(scene: &Scene, config: &TrialConfig, world_from_root: &Pose, joint_positions: &[f64]) -> Self {
        let simulation = Simulation::new(scene, config.osc, world_from_root, joint_positions);
        let cameras = config.cameras.pinholes();
        let (qpos, visible) = (simulation.data.qpos().to_vec(), Visible::of(&simulation));
        Self { qpos, cameras, config: config.cameras.clone(), visible }
    }

    /// What `camera` sees as a trial's cameras do, cropped: the number of coloured and labelled points.
    pub fn look(&self, camera: usize) -> usize {
        self.visible.points(&self.cameras[camera], &self.config, &mut Stream::new(0, &[])).len()
    }

    /// Depth along the camera's axis of each pixel, row by row (m); zero where nothing is seen.
    pub fn depths(&self, camera: usize) -> Vec<f64> {
        let pinhole = &self.cameras[camera];
        let picture = self.visible.picture(pinhole, &self.config);
        let pixels = (0..pinhole.height).flat_map(|row| (0..pinhole.width).map(move |column| (row, column)));
        pixels.map(|(row, column)| picture.at(row, column).map_or(0.0, |(_, depth)| depth)).collect()
    }
}
