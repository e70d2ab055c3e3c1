//! Pictures of objects for documents: ray-cast like the cameras of a trial, with light and shadow for people.

use crate::convention::{Data, free_joint_position};
use crate::error::Error;
use crate::scene::{Scene, SceneConfig};
use crate::task::lowest_point;
use nalgebra::{Rotation3, Vector3};
use vmao_core::catalogue::CatalogueItem;
use vmao_core::geometry::Pose;
use vmao_core::object::JointKind;

/// A picture, row by row from the top; red, green, blue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width` × `height` pixels.
    pub pixels: Vec<[u8; 3]>,
}

/// Each pixel is the mean of so many rays squared.
const RAYS: usize = 3;
/// Vertical field of view (rad).
const FIELD_OF_VIEW: f64 = 0.5;
/// From the object to the eye and to the light; only the eye's direction matters.
const TO_EYE: Vector3<f64> = Vector3::new(0.30, -0.65, 0.62);
const TO_LIGHT: Vector3<f64> = Vector3::new(-0.8, -0.9, 1.9);
/// Share of the light that comes from everywhere.
const AMBIENT: f64 = 0.45;
/// What rays see that hit nothing.
const BACKGROUND: [f64; 3] = [0.82, 0.78, 0.72];

/// The object on the table with every joint in the middle of its range. Fails if the simulator refuses the model.
pub fn portrait(config: &SceneConfig, item: CatalogueItem, width: usize, height: usize) -> Result<Picture, Error> {
    let scene = Scene::without_arms(config, item)?;
    let joints: Vec<f64> = scene.object.joints.iter().flat_map(|joint| middle(joint.kind, joint.limits)).collect();
    let lowest = lowest_point(&scene, &Pose::identity(), &joints);
    let mut data = Data::new(scene.model.clone());
    let qpos = data.qpos_mut();
    let standing = free_joint_position(&Pose::translation(0.0, 0.0, -lowest));
    qpos[scene.object_qpos..scene.object_qpos + 7].copy_from_slice(&standing);
    scene.set_object_joints(qpos, &joints);
    data.forward();

    let (center, radius) = bounds(&scene, &data);
    let eye = center + TO_EYE.normalize() * (0.92 * radius / (FIELD_OF_VIEW / 2.0).sin());
    let colors = colors(&scene, &mut data, &eye, &directions(&(center - eye), width, height));
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        for column in 0..width {
            let rays = (0..RAYS * RAYS).map(|ray| (row * RAYS + ray / RAYS) * width * RAYS + column * RAYS + ray % RAYS);
            let sum = rays.map(|ray| colors[ray]).sum::<Vector3<f64>>();
            pixels.push((sum / (RAYS * RAYS) as f64).map(|light| (255.0 * light.clamp(0.0, 1.0)).round() as u8).into());
        }
    }
    Ok(Picture { width, height, pixels })
}

fn middle(kind: JointKind, limits: Option<[f64; 2]>) -> Vec<f64> {
    match kind {
        JointKind::Ball => vec![0.0; 3],
        JointKind::Revolute | JointKind::Prismatic | JointKind::Fixed => {
            vec![limits.map_or(0.0, |[low, high]| f64::midpoint(low, high))]
        }
    }
}

/// A ball around all solids of the object.
fn bounds(scene: &Scene, data: &Data) -> (Vector3<f64>, f64) {
    let bodies = scene.model.geom_bodyid();
    let of_object = |geom: &usize| scene.part_bodies.contains(&(bodies[*geom] as usize));
    let geoms: Vec<usize> = (0..bodies.len()).filter(of_object).collect();
    let place = |geom: usize| Vector3::from(data.geom_xpos()[geom]);
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for &geom in &geoms {
        (low, high) = (low.inf(&place(geom)), high.sup(&place(geom)));
    }
    let center = (low + high) / 2.0;
    let reach = |&geom: &usize| (place(geom) - center).norm() + 0.8 * scene.model.geom_rbound()[geom];
    (center, geoms.iter().map(reach).fold(0.0, f64::max))
}

/// Unit directions of all rays, row by row.
fn directions(look: &Vector3<f64>, width: usize, height: usize) -> Vec<[f64; 3]> {
    let rotation = Rotation3::face_towards(look, &Vector3::z());
    let (columns, rows) = (width * RAYS, height * RAYS);
    let scale = (FIELD_OF_VIEW / 2.0).tan();
    let mut directions = Vec::with_capacity(columns * rows);
    for row in 0..rows {
        for column in 0..columns {
            // To the left as the picture is seen: x of the looking frame.
            let x = (1.0 - 2.0 * (column as f64 + 0.5) / columns as f64) * scale * columns as f64 / rows as f64;
            let y = (1.0 - 2.0 * (row as f64 + 0.5) / rows as f64) * scale;
            directions.push((rotation * Vector3::new(x, y, 1.0)).normalize().into());
        }
    }
    directions
}

/// What each ray from the eye sees.
fn colors(scene: &Scene, data: &mut Data, eye: &Vector3<f64>, directions: &[[f64; 3]]) -> Vec<Vector3<f64>> {
    let mut normals = vec![[0.0; 3]; directions.len()];
    let (geoms, distances) = data.multi_ray(&(*eye).into(), directions, None, true, None, 10.0, Some(&mut normals));
    let points: Vec<Vector3<f64>> =
        directions.iter().zip(&distances).map(|(direction, distance)| eye + Vector3::from(*direction) * *distance).collect();
    // The light meets a point first, or something that shades it.
    let from_light: Vec<[f64; 3]> = points.iter().map(|point| (point - TO_LIGHT).normalize().into()).collect();
    let (_, lit) = data.multi_ray(&TO_LIGHT.into(), &from_light, None, true, None, 10.0, None);
    let shade = |ray: usize| {
        let Some(geom) = geoms[ray] else { return Vector3::from(BACKGROUND) };
        let to_light = TO_LIGHT - points[ray];
        let shadowed = lit[ray] < to_light.norm() - 1e-4;
        let facing = if shadowed { 0.0 } else { Vector3::from(normals[ray]).dot(&to_light.normalize()).max(0.0) };
        let [red, green, blue, _] = scene.model.geom_rgba()[geom];
        Vector3::new(red, green, blue).map(f64::from) * (AMBIENT + (1.0 - AMBIENT) * facing)
    };
    (0..directions.len()).map(shade).collect()
}
