//! RGB-D by ray casting: no display, no GPU. Several cameras are fused into one cloud of the workspace.

use crate::scene::{Owner, Scene};
use crate::simulation::Simulation;
use nalgebra::{Point3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use vmao_core::observation::{Observation, PointLabel};
use vmao_core::random::Stream;

/// The cameras and what is kept of their pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraConfig {
    /// How many, evenly spaced around the table; at least two.
    pub count: usize,
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
}

/// Points up to this height count as the table's plane when the cloud is thinned (m); geometry only, no labels.
pub(crate) const TABLE_PLANE_HEIGHT: f64 = 0.002;

struct Seen {
    position: [f32; 3],
    color: [f32; 3],
    label: PointLabel,
}

/// What all cameras see now, fused, cropped and sampled to `config.points` points (fewer if less is seen).
///
/// World frame, metres. The sample depends on `stream` and the scene's state only.
pub(crate) fn observe(simulation: &mut Simulation<'_>, config: &CameraConfig, stream: &mut Stream) -> Observation {
    let mut kinds: [Vec<Seen>; 3] = Default::default();
    for camera in 0..config.count {
        for point in picture(simulation, config, camera) {
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

fn picture(simulation: &mut Simulation<'_>, config: &CameraConfig, camera: usize) -> Vec<Seen> {
    // Off the axes of symmetry, so that no two cameras see the same silhouette of the arms.
    let azimuth = std::f64::consts::TAU * (camera as f64 + 0.5) / config.count as f64;
    let eye = Vector3::new(
        config.distance * azimuth.cos(),
        config.distance * azimuth.sin(),
        config.elevations[camera % config.elevations.len()],
    );
    let look = (Vector3::new(0.0, 0.0, 0.05) - eye).normalize();
    let rotation = Rotation3::face_towards(&look, &Vector3::z());
    let scale = (config.field_of_view_deg.to_radians() / 2.0).tan();
    let aspect = config.width as f64 / config.height as f64;
    let mut directions = Vec::with_capacity(config.width * config.height);
    for row in 0..config.height {
        for column in 0..config.width {
            let x = (2.0 * (column as f64 + 0.5) / config.width as f64 - 1.0) * scale * aspect;
            let y = (1.0 - 2.0 * (row as f64 + 0.5) / config.height as f64) * scale;
            let direction = (rotation * Vector3::new(x, y, 1.0)).normalize();
            if crosses_workspace(config, &eye, &direction) {
                directions.push(<[f64; 3]>::from(direction));
            }
        }
    }
    let mut normals = vec![[0.0; 3]; directions.len()];
    let (geoms, distances) = simulation.data.multi_ray(&eye.into(), &directions, None, true, None, 10.0, Some(&mut normals));
    let scene: &Scene = simulation.scene;
    let mut seen = Vec::new();
    for (index, geom) in geoms.iter().enumerate() {
        let Some(geom) = *geom else { continue };
        let position = eye + Vector3::from(directions[index]) * distances[index];
        if !in_workspace(config, &position) {
            continue;
        }
        let rgba = scene.model.geom_rgba()[geom];
        // A soft light from above: enough for shape to show in the colours.
        let shade = 0.6 + 0.4 * normals[index][2].max(0.0) as f32;
        seen.push(Seen {
            position: [position.x as f32, position.y as f32, position.z as f32],
            color: [rgba[0] * shade, rgba[1] * shade, rgba[2] * shade],
            label: match scene.owners[geom] {
                Owner::Table => PointLabel::Table,
                Owner::Link(arm) | Owner::Pad(arm, _) => PointLabel::Arm(arm.0),
                Owner::Part(part) => PointLabel::Part(part.0),
            },
        });
    }
    seen
}

fn in_workspace(config: &CameraConfig, position: &Vector3<f64>) -> bool {
    let half = config.workspace_half_width;
    position.x.abs() <= half && position.y.abs() <= half && position.z >= -1e-3 && position.z <= config.workspace_height
}

/// Slab test of a ray against the workspace box: rays that cannot hit anything of interest are not cast.
fn crosses_workspace(config: &CameraConfig, eye: &Vector3<f64>, direction: &Vector3<f64>) -> bool {
    let half = config.workspace_half_width;
    let low = Point3::new(-half, -half, -1e-3);
    let high = Point3::new(half, half, config.workspace_height);
    let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let (a, b) = ((low[axis] - eye[axis]) / direction[axis], (high[axis] - eye[axis]) / direction[axis]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}
