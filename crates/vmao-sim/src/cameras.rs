//! RGB-D by ray casting: no display, no GPU. Several cameras are fused into one cloud of the workspace.

use crate::convention::body_pose;
use crate::mjcf::{TABLE_COLOR, TABLE_HALF_WIDTHS};
use crate::simulation::Simulation;
use crate::viewpoints::Viewpoint;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::depth_noise::DepthNoise;
use vmao_core::depth_picture::{DepthPicture, Pinhole};
use vmao_core::geometry::Pose;
use vmao_core::observation::{Observation, PointLabel};
use vmao_core::random::Stream;
use vmao_core::rays::normal;
use vmao_core::shape::{Shape, Solid};

/// The cameras and what is kept of their pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// How many, evenly spaced around the table; at least two.
    pub count: usize,
    /// Where cameras stand instead of around the table; empty for none.
    pub viewpoints: Vec<Viewpoint>,
    /// Picture width (pixels).
    pub width: usize,
    /// Picture height (pixels).
    pub height: usize,
    /// Vertical field of view (degrees).
    pub field_of_view_deg: f64,
    /// Horizontal distance from the workspace's centre (m).
    pub distance: f64,
    /// Heights above the table, taken in turn by the cameras (m).
    pub elevations: Vec<f64>,
    /// Half the workspace's edge along x and y (m): points outside are dropped.
    pub workspace_half_width: f64,
    /// Height of the workspace (m).
    pub workspace_height: f64,
    /// Points kept of the fused cloud.
    pub points: usize,
    /// Largest share of the kept points that may lie on the table's plane, if enough others are seen.
    pub table_share: f64,
    /// The same for points on the arms: an arm knows where it is, so this needs no labels of the object.
    pub robot_share: f64,
    /// Errors of the measured depths.
    pub noise: DepthNoise,
}

/// Points up to this height count as the table's plane when the cloud is thinned (m); geometry only, no labels.
pub(crate) const TABLE_PLANE_HEIGHT: f64 = 0.002;

pub(crate) struct Seen {
    position: [f32; 3],
    color: [f32; 3],
    label: PointLabel,
}

/// What all cameras see now, fused, cropped and sampled to `config.points` points (fewer if less is seen).
///
/// World frame, metres. The sample depends on `stream`, each camera's noise on its own `noise_stream`, and on the scene's state.
pub(crate) fn observe(
    simulation: &Simulation<'_>,
    config: &CameraConfig,
    stream: &mut Stream,
    noise_stream: impl Fn(usize) -> Stream,
) -> Observation {
    let visible = Visible::of(simulation);
    let mut kinds: [Vec<Seen>; 3] = Default::default();
    for (camera, pinhole) in config.pinholes().iter().enumerate() {
        for point in visible.points(pinhole, config, &mut noise_stream(camera)) {
            let kind = match point.label {
                PointLabel::Arm(_) => 1,
                _ if f64::from(point.position[2]) <= TABLE_PLANE_HEIGHT => 2,
                _ => 0,
            };
            kinds[kind].push(point);
        }
    }
    let counts = shares(config, kinds.each_ref().map(Vec::len));
    let mut observation = Observation::default();
    for (points, wanted) in kinds.iter().zip(counts) {
        for &index in &stream.permutation(points.len())[..wanted] {
            let seen = &points[index];
            observation.points.push(seen.position);
            observation.colors.push(seen.color);
            observation.labels.push(seen.label);
        }
    }
    observation
}

/// How many points to keep of the rest, the arms and the table: their shares, and what is left over wherever there is more.
fn shares(config: &CameraConfig, seen: [usize; 3]) -> [usize; 3] {
    let share = |share: f64| (config.points as f64 * share) as usize;
    let arms = share(config.robot_share).min(seen[1]);
    let table = share(config.table_share).min(seen[2]);
    let rest = (config.points - arms - table).min(seen[0]);
    let table = (config.points - arms - rest).min(seen[2]);
    let arms = (config.points - table - rest).min(seen[1]);
    [rest, arms, table]
}

/// All that rays can meet, where it is now.
#[derive(Debug)]
pub(crate) struct Visible {
    /// What it belongs to, and the solid in the world's frame.
    solids: Vec<(PointLabel, Solid)>,
}

/// The table's number in a picture; solids come after it.
const TABLE: u32 = 0;

impl Visible {
    pub(crate) fn of(simulation: &Simulation<'_>) -> Self {
        let mut solids = Vec::new();
        for (body, described) in simulation.scene.bodies() {
            let world_from_body = body_pose(&simulation.data, body);
            for solid in described.solids {
                solids.push((described.label, Solid { carrier_from_solid: world_from_body * solid.carrier_from_solid, ..solid }));
            }
        }
        Self { solids }
    }

    /// Depths and what is seen at each pixel of the workspace, and at some others.
    pub(crate) fn picture(&self, camera: &Pinhole, config: &CameraConfig) -> DepthPicture {
        let (workspace, world_from_workspace) = workspace(config);
        let window = camera.window(&workspace, &world_from_workspace);
        let mut picture = DepthPicture::new(camera);
        for (index, (_, solid)) in (TABLE + 1..).zip(&self.solids) {
            picture.add_solid(camera, &window, index, &solid.shape, &solid.carrier_from_solid);
        }
        picture.add_rectangle(camera, &window, TABLE, &TABLE_HALF_WIDTHS, &Pose::identity());
        picture
    }

    /// The points of the workspace that `camera` sees, row by row.
    pub(crate) fn points(&self, camera: &Pinhole, config: &CameraConfig, noise_stream: &mut Stream) -> Vec<Seen> {
        let picture = self.picture(camera, config);
        let eye = camera.world_from_camera.translation.vector;
        let noise = Some(&config.noise).filter(|noise| !noise.is_off());
        let mut seen = Vec::new();
        for row in 0..camera.height {
            for column in 0..camera.width {
                let Some((index, depth)) = picture.at(row, column) else { continue };
                let ray = camera.world_from_camera.rotation * Vector3::new(camera.x(column), camera.y(row), 1.0);
                let met = eye + ray * depth;
                if noise.is_none() && !in_workspace(config, &met) {
                    continue;
                }
                let (label, color, normal) = self.surface(index, &met);
                let mut position = met;
                if let Some(noise) = noise {
                    let sine = ray.dot(&normal).abs() / ray.norm();
                    let on_edge = picture.on_edge(row, column, noise.edge_step);
                    let Some(measured) = noise.measure(depth, sine, on_edge, noise_stream) else { continue };
                    position = eye + ray * measured;
                    if !in_workspace(config, &position) {
                        continue;
                    }
                }
                // A soft light from above: enough for shape to show in the colours.
                let shade = 0.6 + 0.4 * normal.z.max(0.0) as f32;
                let position = [position.x as f32, position.y as f32, position.z as f32];
                seen.push(Seen { position, color: color.map(|value| value * shade), label });
            }
        }
        seen
    }

    /// Label, colour and outward normal of the surface number `index` at `point` of the world.
    fn surface(&self, index: u32, point: &Vector3<f64>) -> (PointLabel, [f32; 3], Vector3<f64>) {
        if index == TABLE {
            return (PointLabel::Table, TABLE_COLOR, Vector3::z());
        }
        let (label, solid) = &self.solids[(index - TABLE - 1) as usize];
        let local = solid.carrier_from_solid.inverse_transform_point(&Point3::from(*point)).coords;
        (*label, solid.color, solid.carrier_from_solid.rotation * normal(&solid.shape, &local))
    }
}

/// Lowest height of the workspace (m): the table, and what rounding puts below it.
const WORKSPACE_FLOOR: f64 = -1e-3;

fn in_workspace(config: &CameraConfig, position: &Vector3<f64>) -> bool {
    let half = config.workspace_half_width;
    let height = position.z >= WORKSPACE_FLOOR && position.z <= config.workspace_height;
    height && position.x.abs() <= half && position.y.abs() <= half
}

/// The workspace as a solid.
fn workspace(config: &CameraConfig) -> (Shape, Pose) {
    let half = config.workspace_half_width;
    let middle = f64::midpoint(WORKSPACE_FLOOR, config.workspace_height);
    let half_extents = [half, half, config.workspace_height - middle];
    (Shape::Box { half_extents }, Pose::translation(0.0, 0.0, middle))
}
