//! Convex hulls in the simulator: the same masses, distances and surfaces as ours.

use super::support::configuration;
use crate::convention::{Data, free_joint_position};
use crate::scene::{Owner, Scene};
use nalgebra::{Matrix3, Point3, Unit, Vector3};
use vmao_core::catalogue::CatalogueItem;
use vmao_core::contact::PartId;
use vmao_core::convex_hull::ConvexHull;
use vmao_core::distance::Convex;
use vmao_core::geometry::{Pose, pose};
use vmao_core::object::{ArticulatedObject, Joint, JointKind, Part};
use vmao_core::random::Stream;
use vmao_core::shape::{Shape, Solid};

fn normal(stream: &mut Stream) -> Vector3<f64> {
    Vector3::new(stream.normal(), stream.normal(), stream.normal())
}

/// A hull of about `count` vertices, its frame beside it.
fn stone(seed: u64, count: usize) -> Solid {
    let mut stream = Stream::new(seed, &[]);
    let middle = normal(&mut stream) * 0.05;
    let points: Vec<Point3<f64>> = (0..count).map(|_| Point3::from(middle + normal(&mut stream).normalize() * 0.04)).collect();
    let carrier_from_solid = pose([0.02, -0.01, 0.03], [0.6, 0.3, -0.5, 0.2]);
    Solid { shape: Shape::Convex(ConvexHull::around(&points, 256).unwrap()), carrier_from_solid, color: [0.4; 3] }
}

/// Two stones that slide along an oblique axis.
fn two_stones(seed: u64, count: usize) -> Scene {
    let part = |name: &str, solid: Solid| Part { name: name.to_owned(), solids: vec![solid], mass: 0.3 };
    let joint = Joint {
        name: "slide".to_owned(),
        kind: JointKind::Prismatic,
        parent: PartId(0),
        child: PartId(1),
        anchor: Point3::origin(),
        axis: Unit::new_normalize(Vector3::new(1.0, 2.0, -1.0)),
        limits: Some([0.0, 0.4]),
        damping: 0.1,
        friction: 0.0,
    };
    let parts = vec![part("a", stone(seed, count)), part("b", stone(seed + 1, count))];
    let object = ArticulatedObject { name: "stones".to_owned(), parts, joints: vec![joint] };
    Scene::without_arms(&configuration().0, CatalogueItem { object, demonstrations: Vec::new() }).unwrap()
}

fn geom_of(scene: &Scene, part: u16) -> usize {
    scene.owners.iter().position(|owner| *owner == Owner::Part(PartId(part))).unwrap()
}

/// The scene at a random pose with the slide at `position`, and where its parts are.
fn placed(scene: &Scene, position: f64, stream: &mut Stream) -> (Data, [Pose; 2]) {
    let turn = normal(stream);
    let world_from_first = pose([0.1, -0.2, 0.5], [stream.normal(), turn.x, turn.y, turn.z]);
    let mut data = Data::new(scene.model.clone());
    let qpos = data.qpos_mut();
    qpos[scene.object_qpos..scene.object_qpos + 7].copy_from_slice(&free_joint_position(&world_from_first));
    scene.set_object_joints(qpos, &[position]);
    data.forward();
    let along = Pose::from_parts((scene.object.joints[0].axis.into_inner() * position).into(), Default::default());
    (data, [world_from_first, world_from_first * along])
}

#[test]
fn hulls_weigh_and_turn_as_ours() {
    for (seed, count) in [(1, 6), (2, 30), (3, 200)] {
        let scene = two_stones(seed, count);
        for (part, &body) in scene.object.parts.iter().zip(&scene.part_bodies) {
            let solid = &part.solids[0];
            assert!((scene.model.body_mass()[body] - part.mass).abs() < 1e-9);
            let center = solid.carrier_from_solid * solid.shape.centroid();
            let found = Point3::from(scene.model.body_ipos()[body]);
            assert!((found - center).norm() < 1e-6, "{found} not {center}");
            let turn = pose([0.0; 3], scene.model.body_iquat()[body]).rotation.to_rotation_matrix();
            let diagonal = Matrix3::from_diagonal(&Vector3::from(scene.model.body_inertia()[body]));
            let found = turn.matrix() * diagonal * turn.matrix().transpose();
            let own = solid.carrier_from_solid.rotation.to_rotation_matrix();
            let expected = own.matrix() * solid.shape.inertia(part.mass) * own.matrix().transpose();
            assert!((found - expected).norm() < 1e-4 * expected.norm(), "{found} not {expected}");
        }
    }
}

#[test]
fn hulls_are_as_far_apart_as_the_simulator_says() {
    let mut compared = 0;
    for (seed, count) in [(10, 5), (20, 12), (30, 60)] {
        let scene = two_stones(seed, count);
        let mut stream = Stream::new(seed, &[]);
        for step in 0..40 {
            let (mut data, parts) = placed(&scene, 0.01 * f64::from(step), &mut stream);
            let [first, second] = [0, 1].map(|part| {
                let solid = &scene.object.parts[part].solids[0];
                Convex::new(&solid.shape, &(parts[part] * solid.carrier_from_solid))
            });
            let ours = first.signed_distance(&second);
            let theirs = data.geom_distance(geom_of(&scene, 0), geom_of(&scene, 1), 1.0, None);
            if ours > 1e-4 {
                assert!((ours - theirs).abs() < 1e-5, "seed {seed}, step {step}: {ours} not {theirs}");
                compared += 1;
            } else {
                assert!(theirs < 2e-4, "seed {seed}, step {step}: overlap {ours} not {theirs}");
            }
        }
    }
    assert!(compared > 30, "only {compared} pairs were apart");
}

#[test]
fn rays_meet_hulls_where_ours_do() {
    let scene = two_stones(5, 40);
    let mut stream = Stream::new(7, &[]);
    let (mut data, parts) = placed(&scene, 0.2, &mut stream);
    let eye = Point3::new(0.6, 0.3, 1.0);
    let mut hits = 0;
    for _ in 0..400 {
        let target = parts[stream.index(2)] * Point3::from(normal(&mut stream) * 0.04);
        let direction = Unit::new_normalize(target - eye);
        let passages =
            scene.object.parts.iter().zip(&parts).filter_map(|(part, at)| part.solids[0].passage(at, &eye, &direction));
        let expected = passages.min_by(|a, b| a.along[0].total_cmp(&b.along[0]));
        let directions = [<[f64; 3]>::from(direction.into_inner())];
        let mut normals = vec![[0.0; 3]];
        let (geoms, distances) = data.multi_ray(&eye.into(), &directions, None, true, None, 10.0, Some(&mut normals));
        let geom = geoms[0].filter(|&geom| matches!(scene.owners[geom], Owner::Part(_)));
        match (geom, expected) {
            (Some(_), Some(expected)) => {
                hits += 1;
                assert!((distances[0] - expected.along[0]).abs() < 1e-5, "{} not {}", distances[0], expected.along[0]);
                assert!((Vector3::from(normals[0]) - expected.normals[0]).norm() < 1e-2);
            }
            (None, None) => {}
            // Rays along the rim may fall on either side.
            (_, Some(expected)) => assert!(expected.along[1] - expected.along[0] < 1e-3, "missed {expected:?}"),
            (Some(_), None) => panic!("met nothing of ours at {}", distances[0]),
        }
    }
    assert!(hits > 100, "{hits} hits");
}
