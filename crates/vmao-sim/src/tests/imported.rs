//! Objects from files, dropped on the table.

use super::catalogue::check_settles;
use super::support::configuration;
use crate::scene::Scene;
use std::path::Path;
use std::process::Command;
use vmao_core::object_file::ObjectFile;
use vmao_import::{Options, import};

#[path = "../../../vmao-import/tests/fixture/mod.rs"]
mod fixture;

/// Imports, goes through the document as commands do, and drops the object from a few starts.
fn check_drops(path: &Path) {
    let imported = import(path, &Options::default()).unwrap();
    let item = ObjectFile::new(&imported.object, &[]).item().unwrap();
    let scene = Scene::without_arms(&configuration().0, item).unwrap();
    for index in 0..4 {
        check_settles(&scene, &format!("{}, start {index}", imported.object.name), index);
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
