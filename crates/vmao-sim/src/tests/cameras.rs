//! The fused cloud: every point on the surface it is labelled with, seen from several sides, in the asked shares.

use super::settled;
use super::support::{configuration, scene};
use crate::cameras::{CameraConfig, TABLE_PLANE_HEIGHT, observe};
use crate::convention::body_pose;
use crate::scene::Scene;
use crate::simulation::Simulation;
use nalgebra::Point3;
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
