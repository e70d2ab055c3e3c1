//! The fused cloud: every point on the surface it is labelled with, seen from several sides, in the asked shares.

use super::settled;
use super::support::{configuration, scene};
use crate::cameras::{CameraConfig, TABLE_PLANE_HEIGHT, observe};
use crate::convention::body_pose;
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::viewpoints::Viewpoint;
use nalgebra::Point3;
use vmao_core::depth_noise::DepthNoise;
use vmao_core::distance::Convex;
use vmao_core::geometry::Pose;
use vmao_core::observation::{Observation, PointLabel};
use vmao_core::random::Stream;
use vmao_core::shape::{Shape, Solid};

fn look(simulation: &mut Simulation<'_>, config: &CameraConfig, seed: u64) -> Observation {
    observe(simulation, config, &mut Stream::new(seed, &[]), |camera| Stream::new(seed, &[1, camera as u64]))
}

/// All solids of the scene by what they belong to, with their world poses.
fn solids(scene: &Scene, simulation: &Simulation<'_>) -> Vec<(PointLabel, Solid)> {
    let place = |carrier: &Pose, solid: &Solid| Solid { carrier_from_solid: carrier * solid.carrier_from_solid, ..solid.clone() };
    let mut all = Vec::new();
    let state = simulation.object_state();
    for (part, (description, pose)) in scene.object.parts.iter().zip(&state.world_from_parts).enumerate() {
        all.extend(description.solids.iter().map(|solid| (PointLabel::Part(part as u16), place(pose, solid))));
    }
    for (arm, (index, robot)) in scene.arms.iter().zip(&scene.robots).enumerate() {
        let mut links: Vec<Vec<Solid>> = vec![robot.base.solids.clone()];
        links.extend(robot.joints.iter().map(|joint| joint.link.solids.clone()));
        links.push(robot.gripper.hand.solids.clone());
        let fingers = robot.gripper.fingers.iter();
        links.extend(fingers.map(|finger| finger.link.solids.iter().chain([&finger.pad]).cloned().collect()));
        for (&body, solids) in index.bodies.iter().zip(&links) {
            let pose = body_pose(&simulation.data, body);
            all.extend(solids.iter().map(|solid| (PointLabel::Arm(arm as u16), place(&pose, solid))));
        }
    }
    all
}

/// Distance of a point to the surface of the nearest solid of its label (m).
fn distance_to_label(point: &Point3<f64>, label: PointLabel, solids: &[(PointLabel, Solid)]) -> f64 {
    if label == PointLabel::Table {
        return point.z.abs();
    }
    let dot = Convex::new(&Shape::Sphere { radius: 0.0 }, &Pose::translation(point.x, point.y, point.z));
    let of_label = solids.iter().filter(|(owner, _)| *owner == label);
    let distances = of_label.map(|(_, solid)| Convex::new(&solid.shape, &solid.carrier_from_solid).signed_distance(&dot).abs());
    distances.fold(f64::INFINITY, f64::min)
}

#[test]
fn every_point_lies_on_what_it_is_labelled_with() {
    let (_, config) = configuration();
    let mut arms_seen = 0;
    for instance in 0..3 {
        let scene = scene(instance);
        let mut simulation = settled(&scene, u64::from(instance));
        // A larger workspace sees the arms as well.
        let wide = CameraConfig { workspace_half_width: 0.6, workspace_height: 0.9, ..config.cameras.clone() };
        for cameras in [&config.cameras, &wide] {
            let observation = look(&mut simulation, cameras, 1);
            let solids = solids(&scene, &simulation);
            for (point, &label) in observation.points.iter().zip(&observation.labels) {
                let point = Point3::from(point.map(f64::from));
                let distance = distance_to_label(&point, label, &solids);
                assert!(distance < 1e-3, "{label:?} at {point} is {distance} m from it");
                let half = cameras.workspace_half_width + 1e-6;
                assert!(point.x.abs() <= half && point.y.abs() <= half && point.z <= cameras.workspace_height + 1e-6);
            }
            let seen = |label: PointLabel| observation.labels.iter().filter(|&&other| other == label).count();
            assert!(seen(PointLabel::Part(0)) > 50 && seen(PointLabel::Part(1)) > 50, "both parts are seen");
            assert!(seen(PointLabel::Table) > 50);
            arms_seen += seen(PointLabel::Arm(0)).min(seen(PointLabel::Arm(1)));
            assert_eq!((observation.len(), observation.colors.len()), (observation.labels.len(), observation.labels.len()));
            assert!(observation.colors.iter().flatten().all(|value| (0.0..=1.0).contains(value)));
        }
    }
    assert!(arms_seen > 50, "the arms were never seen: the case shows nothing about them");
}

/// How many points lie on the rest, the arms and the table's plane.
fn counts(observation: &Observation) -> [usize; 3] {
    let mut counts = [0; 3];
    for (point, label) in observation.points.iter().zip(&observation.labels) {
        let kind = match label {
            PointLabel::Arm(_) => 1,
            _ if f64::from(point[2]) <= TABLE_PLANE_HEIGHT => 2,
            _ => 0,
        };
        counts[kind] += 1;
    }
    counts
}

#[test]
fn the_sample_has_the_asked_count_and_shares() {
    let (_, config) = configuration();
    let scene = scene(0);
    let mut simulation = settled(&scene, 0);
    for half_width in [0.25, 0.6] {
        let cameras = CameraConfig { workspace_half_width: half_width, workspace_height: 0.9, ..config.cameras.clone() };
        let everything = look(&mut simulation, &CameraConfig { points: 1_000_000, ..cameras.clone() }, 1);
        let [rest, arms, table] = counts(&everything);
        let seen = rest + arms + table;
        assert!(rest > 1000 && table > 1000 && (half_width < 0.3 || arms > 1000), "{rest} {arms} {table}");
        for points in [64, 1024, 4096] {
            let observation = look(&mut simulation, &CameraConfig { points, ..cameras.clone() }, 2);
            assert_eq!(observation.len(), points.min(seen));
            let [kept_rest, kept_arms, kept_table] = counts(&observation);
            let share = (points as f64 * 0.15) as usize;
            assert!(kept_arms >= share.min(arms) && kept_table >= share.min(table), "{kept_arms} {kept_table} of {points}");
            if rest >= points {
                assert_eq!((kept_arms, kept_table), (share.min(arms), share.min(table)), "{points} of {rest}");
            } else {
                assert_eq!(kept_rest, rest.min(points - share.min(arms) - share.min(table)));
            }
        }
    }
}

#[test]
fn opposite_flanks_of_a_bar_are_seen_so_that_one_camera_cannot_have_seen_all() {
    let (_, config) = configuration();
    let scene = scene(0);
    for index in 0..4 {
        let mut simulation = settled(&scene, index);
        let observation = look(&mut simulation, &config.cameras, index);
        let state = simulation.object_state();
        for (part, world_from_part) in state.world_from_parts.iter().enumerate() {
            let handle = &scene.object.parts[part].solids[1];
            let Shape::Box { half_extents } = handle.shape else { panic!("the handle is a box") };
            let solid_from_world = (world_from_part * handle.carrier_from_solid).inverse();
            let mut flanks = [0; 2];
            for (point, label) in observation.points.iter().zip(&observation.labels) {
                let local = solid_from_world * Point3::from(point.map(f64::from));
                let inside = local.x.abs() < half_extents[0] - 1e-3 && local.z.abs() < half_extents[2] - 1e-3;
                if *label == PointLabel::Part(part as u16) && inside && (local.y.abs() - half_extents[1]).abs() < 1e-5 {
                    flanks[usize::from(local.y > 0.0)] += 1;
                }
            }
            assert!(flanks.iter().all(|&count| count >= 3), "trial {index}, part {part}: flanks seen {flanks:?} times");
        }
    }
}

#[test]
fn the_same_stream_gives_the_same_cloud_and_another_gives_another() {
    let (_, config) = configuration();
    let scene = scene(0);
    let mut simulation = settled(&scene, 1);
    let first = look(&mut simulation, &config.cameras, 5);
    assert_eq!(first, look(&mut simulation, &config.cameras, 5));
    assert_ne!(first, look(&mut simulation, &config.cameras, 6));
    assert_eq!(first, look(&mut settled(&scene, 1), &config.cameras, 5), "another simulation in the same state");
}

#[test]
fn a_perfect_camera_draws_nothing_and_a_noisy_one_leaves_labels_and_moves_points_along_their_rays() {
    let (_, config) = configuration();
    let scene = scene(0);
    let mut simulation = settled(&scene, 2);
    let everything = CameraConfig { points: 65_536, ..config.cameras.clone() };
    let with = |noise: DepthNoise| CameraConfig { noise, ..everything.clone() };
    let off = DepthNoise { edge_step: 0.01, ..DepthNoise::default() };
    let perfect = look(&mut simulation, &everything, 1);
    assert_eq!(perfect, look(&mut simulation, &with(off), 1));
    let solids = solids(&scene, &simulation);
    let noisy = look(&mut simulation, &with(DepthNoise { deviation: 0.0014, ..off }), 1);
    let mut squares = 0.0;
    for (point, &label) in noisy.points.iter().zip(&noisy.labels) {
        // Off its surface by no more than along its ray: the distance to the true surface has at most the depth's deviation.
        let distance = distance_to_label(&Point3::from(point.map(f64::from)), label, &solids);
        squares += distance * distance / noisy.len() as f64;
        assert!(distance < 0.0014 * 6.0, "{label:?} is {distance} m from its surface");
    }
    assert!((2e-4..1.4e-3).contains(&squares.sqrt()), "{} m off the surfaces", squares.sqrt());
    let lossy = look(&mut simulation, &with(DepthNoise { dropout: 0.25, ..off }), 1);
    let kept = lossy.len() as f64 / perfect.len() as f64;
    assert!((kept - 0.75).abs() < 5.0 * (0.1875 / perfect.len() as f64).sqrt(), "{kept} of the points are kept");
    let edgeless = look(&mut simulation, &with(DepthNoise { edge_dropout: 1.0, ..off }), 1);
    assert!(edgeless.len() < perfect.len() && edgeless.len() > perfect.len() / 2, "{} of {}", edgeless.len(), perfect.len());
}

#[test]
fn cameras_stand_where_they_are_put() {
    let (_, config) = configuration();
    let scene = scene(0);
    let mut simulation = settled(&scene, 2);
    let with = |viewpoints: &[([f64; 3], [f64; 3])]| CameraConfig {
        viewpoints: viewpoints.iter().map(|&(position, target)| Viewpoint { position, target }).collect(),
        points: 65_536,
        ..config.cameras.clone()
    };
    // Straight down, nothing below what it sees first is seen: no two points lie on one vertical ray.
    let above = look(&mut simulation, &with(&[([0.0, 0.0, 1.5], [0.0, 0.0, 0.0])]), 1);
    assert!(above.len() > 1000);
    let low = above.points.iter().map(|point| point[0].hypot(point[1])).fold(0.0_f32, f32::max);
    assert!(low > 0.3, "the whole workspace is seen");
    // Those of the ring, put there by hand, see the same.
    let cameras = &config.cameras;
    let by_hand: Vec<([f64; 3], [f64; 3])> = (0..cameras.count)
        .map(|camera| {
            let azimuth = std::f64::consts::TAU * (camera as f64 + 0.5) / cameras.count as f64;
            let height = cameras.elevations[camera % cameras.elevations.len()];
            ([cameras.distance * azimuth.cos(), cameras.distance * azimuth.sin(), height], [0.0, 0.0, 0.05])
        })
        .collect();
    let ring = CameraConfig { points: 65_536, ..cameras.clone() };
    assert_eq!(look(&mut simulation, &with(&by_hand), 1), look(&mut simulation, &ring, 1));
}
