//! Objects from files, dropped on the table.

use super::settled;
use super::support::configuration;
use crate::scene::Scene;
use std::path::Path;
use std::process::Command;
use vmao_core::object_file::ObjectFile;
use vmao_import::{Options, import};

#[path = "../../../vmao-import/tests/fixture/mod.rs"]
mod fixture;

/// Imports, goes through the document as commands do, and drops the object for two seconds from a few starts.
fn check_drops(path: &Path) {
    let imported = import(path, &Options::default()).unwrap();
    let item = ObjectFile::new(&imported.object, &[]).item().unwrap();
    let scene = Scene::without_arms(&configuration().0, item).unwrap();
    for index in 0..4 {
        let mut simulation = settled(&scene, index);
        simulation.wait(1.4);
        let (state, speed) = (simulation.object_state(), simulation.object_speed());
        println!("start {index}: {speed:.2e} m/s or rad/s, joints at {:?}", state.joint_positions);
        // A round thing may still roll; what explodes moves at metres per second.
        assert!(speed < 0.5, "start {index}: still moves at {speed} m/s or rad/s");
        for (part, world_from_part) in scene.object.parts.iter().zip(&state.world_from_parts) {
            let lowest = part.solids.iter().map(|solid| solid.lowest_point(world_from_part)).fold(f64::INFINITY, f64::min);
            let away = world_from_part.translation.vector.norm();
            assert!(
                lowest > -0.002 && away < 0.5,
                "start {index}: {} is {away} m away, its lowest point at {lowest} m",
                part.name
            );
        }
        for (joint, &position) in scene.object.joints.iter().zip(&state.joint_positions) {
            let Some([low, high]) = joint.limits else { continue };
            assert!((low - 0.01..=high + 0.01).contains(&position), "start {index}: {} at {position}", joint.name);
        }
    }
}

#[test]
fn an_imported_chest_comes_to_rest_whole_within_its_limits() {
    check_drops(fixture::Chest::new().path());
}

#[test]
#[ignore = "downloads a package of 84 MB"]
fn the_bottle_of_the_genesis_package_comes_to_rest() {
    let directory = tempfile::tempdir().unwrap();
    let python = |arguments: &[&str]| {
        let status = Command::new("python3").args(arguments).current_dir(directory.path()).status().unwrap();
        assert!(status.success(), "python3 {arguments:?}");
    };
    python(&["-m", "pip", "download", "--quiet", "--no-deps", "genesis-world==1.4.5"]);
    python(&["-m", "zipfile", "-e", "genesis_world-1.4.5-py3-none-any.whl", "unpacked"]);
    check_drops(&directory.path().join("unpacked/genesis/assets/urdf/3763"));
}
