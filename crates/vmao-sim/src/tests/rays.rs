//! Our rays against the simulator's, on random solids and on the scene of a trial.

use super::settled;
use super::support::{configuration, scene};
use crate::cameras::Visible;
use crate::convention::Data;
use crate::mjcf;
use mujoco_rs::wrappers::mj_model::MjModel;
use nalgebra::{Point3, Vector3};
use std::sync::Arc;
use vmao_core::collision::Obstacle;
use vmao_core::depth_picture::DepthPicture;
use vmao_core::geometry::{Pose, rotation_exp};
use vmao_core::random::Stream;
use vmao_core::rays::{ahead, normal, span};
use vmao_core::shape::{Shape, Solid};

fn random_vector(stream: &mut Stream) -> Vector3<f64> {
    Vector3::from_fn(|_, _| stream.normal())
}

/// Solids of all kinds in a box of 1 m; every third stands straight, so that rays along axes run along its faces.
fn random_solids(stream: &mut Stream) -> Vec<Solid> {
    (0..12)
        .map(|index| {
            let mut size = || stream.range(0.01, 0.2);
            let shape = match index % 4 {
                0 => Shape::Sphere { radius: size() },
                1 => Shape::Capsule { radius: size(), half_length: size() },
                2 => Shape::Cylinder { radius: size(), half_length: size() },
                _ => Shape::Box { half_extents: [size(), size(), size()] },
            };
            let turn = if index % 3 == 0 { Vector3::zeros() } else { random_vector(stream) };
            let place = Vector3::from_fn(|_, _| stream.range(-0.5, 0.5));
            Solid { shape, carrier_from_solid: Pose::from_parts(place.into(), rotation_exp(&turn)), color: [0.5; 3] }
        })
        .collect()
}

/// Distance, solid and outward normal where a ray first meets one of `solids`.
fn nearest(solids: &[Solid], origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<(f64, usize, Vector3<f64>)> {
    let meet = |(index, solid): (usize, &Solid)| {
        let solid_from_world = solid.carrier_from_solid.inverse();
        let origin = (solid_from_world * Point3::from(*origin)).coords;
        let direction = solid_from_world * direction;
        let t = ahead(span(&solid.shape, &origin, &direction)?)?;
        Some((t, index, solid.carrier_from_solid.rotation * normal(&solid.shape, &(origin + direction * t))))
    };
    solids.iter().enumerate().filter_map(meet).min_by(|a, b| a.0.total_cmp(&b.0))
}

/// How squarely a ray meets the surface: where it grazes, a rounding decides by how much, or whether it meets at all.
const SQUARE: f64 = 1e-3;

#[test]
fn random_rays_meet_random_solids_where_the_simulator_says() {
    let (config, _) = configuration();
    let (mut met, mut inside, mut along_axes, mut grazing) = (0, 0, 0, 0);
    for scene in 0..40 {
        let mut stream = Stream::new(11, &[scene]);
        let solids = random_solids(&mut stream);
        let obstacles: Vec<Obstacle> =
            solids.iter().map(|solid| Obstacle { name: String::new(), solid: solid.clone() }).collect();
        let model = MjModel::from_xml_string(&mjcf::arms_among(&config, &[], &[], &obstacles)).unwrap();
        let mut data = Data::new(Arc::new(model));
        data.forward();
        for ray in 0..300 {
            // From anywhere, from the centre of a solid, or from afar along an axis of the world.
            let axis = Vector3::ith(ray % 3, if ray % 2 == 0 { 1.0 } else { -1.0 });
            let center = solids[ray % solids.len()].carrier_from_solid.translation.vector;
            let (origin, direction) = match ray % 5 {
                0 => (center, random_vector(&mut stream).normalize()),
                1 => (center + random_vector(&mut stream) * 0.05 - axis * 2.0, axis),
                2 => (center, axis),
                _ => (random_vector(&mut stream), random_vector(&mut stream).normalize()),
            };
            let mut normals = [[0.0; 3]];
            let rays = [<[f64; 3]>::from(direction)];
            let (geoms, distances) = data.multi_ray(&origin.into(), &rays, None, true, None, 10.0, Some(&mut normals));
            let ours = nearest(&solids, &origin, &direction);
            if ours.is_some_and(|(.., normal)| normal.dot(&direction).abs() < SQUARE) {
                grazing += 1;
                continue;
            }
            assert_eq!(ours.map(|(_, solid, _)| solid), geoms[0], "scene {scene}, ray {ray}: {ours:?} {distances:?}");
            let Some((distance, solid, normal)) = ours else { continue };
            let off = (distance - distances[0]).abs();
            assert!(off < 1e-9, "scene {scene}, ray {ray}: {distance} m, the simulator's {} m", distances[0]);
            if normal.dot(&direction) < 0.0 {
                let off = (normal - Vector3::from(normals[0])).norm();
                assert!(off < 1e-6, "scene {scene}, ray {ray}, {:?}: {normal} {normals:?}", solids[solid].shape);
            } else {
                inside += 1;
            }
            met += 1;
            along_axes += usize::from(matches!(ray % 5, 1 | 2));
        }
    }
    assert!(met > 6000 && inside > 2000 && along_axes > 2000 && grazing < 30, "{met} {inside} {along_axes} {grazing}");
}

#[test]
fn pictures_of_a_trial_are_those_of_the_simulators_rays() {
    let (_, config) = configuration();
    let scene = scene(0);
    let mut simulation = settled(&scene, 3);
    let visible = Visible::of(&simulation);
    let mut cameras = config.cameras.clone();
    (cameras.workspace_half_width, cameras.workspace_height) = (0.7, 0.9);
    let (mut compared, mut differ) = (0, 0);
    for camera in cameras.pinholes() {
        let picture: DepthPicture = visible.picture(&camera, &cameras);
        let eye = camera.world_from_camera.translation.vector;
        for row in 0..camera.height {
            let ray = |column: usize| camera.world_from_camera.rotation * Vector3::new(camera.x(column), camera.y(row), 1.0);
            let directions: Vec<[f64; 3]> = (0..camera.width).map(|column| ray(column).normalize().into()).collect();
            let (geoms, distances) = simulation.data.multi_ray(&eye.into(), &directions, None, true, None, 10.0, None);
            for (column, (geom, distance)) in geoms.iter().zip(&distances).enumerate() {
                let ours = picture.at(row, column);
                let depth = distance / ray(column).norm();
                if let (Some((_, ours)), Some(_)) = (ours, geom) {
                    compared += 1;
                    differ += usize::from((ours - depth).abs() > 1e-9);
                } else {
                    let met = eye + ray(column) * depth;
                    let seen = geom.is_some() && met.x.abs() < 0.7 && met.y.abs() < 0.7 && met.z < 0.9;
                    assert!(!seen, "row {row}, column {column}: {ours:?}, the simulator's {depth}");
                }
            }
        }
    }
    // A ray that just touches an edge may be told to miss it by one of both.
    assert!(compared > 100_000 && differ <= 5, "{differ} of {compared} differ");
}
