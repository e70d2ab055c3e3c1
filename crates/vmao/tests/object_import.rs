//! `vmao object import` through the real program: its answer, its folder, and what it leaves when it refuses.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

#[path = "../../vmao-import/tests/fixture/mod.rs"]
mod fixture;

use fixture::Chest;
use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};
use vmao_core::object_file::ObjectFile;

fn vmao(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vmao")).args(arguments).current_dir(directory).output().unwrap()
}

#[track_caller]
fn answer(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[track_caller]
fn check_refused(output: &Output, message: &str) {
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains(message) && !error.contains("panicked") && output.stdout.is_empty(), "{error}");
}

#[test]
fn an_object_appears_whole_with_its_report_and_pictures() {
    let chest = Chest::new();
    let out = tempfile::tempdir().unwrap();
    let path = chest.path().to_str().unwrap();
    let found = answer(&vmao(out.path(), &["object", "import", path, "--out", "objects/chest", "--name", "chest", "--json"]));
    assert_eq!(
        (&found["object"], &found["parts"], &found["joints"]),
        (&"objects/chest/object.json".into(), &2.into(), &1.into())
    );
    assert!(found["repairs"].as_array().unwrap().iter().any(|repair| repair["quirk"] == "up-axis"), "{found}");
    assert_eq!(found["grippers"]["panda"]["refused"], Value::Array(Vec::new()));
    let folder = out.path().join("objects/chest");
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    let document: ObjectFile = serde_json::from_str(&read("object.json")).unwrap();
    let item = document.item().unwrap();
    assert_eq!((item.object.name.as_str(), item.object.parts.len()), ("chest", 2));
    for mesh in document.parts.iter().flat_map(|part| &part.meshes) {
        assert!(folder.join(&mesh.file).is_file(), "{}", mesh.file);
    }
    let report: Value = serde_json::from_str(&read("repairs.json")).unwrap();
    assert_eq!(report["repairs"], found["repairs"]);
    assert!(read("run.json").contains("import") && read("config.toml").contains("[object]"));
    // Nothing half written stays, and nothing is written over.
    let left: Vec<_> = fs::read_dir(out.path().join("objects")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["chest"]);
    check_refused(&vmao(out.path(), &["object", "import", path, "--out", "objects/chest"]), "objects/chest: is there already");
    let again = vmao(out.path(), &["object", "import", path, "--out", "objects/again", "--name", "chest"]);
    assert!(again.status.success());
    assert_eq!(fs::read(out.path().join("objects/again/object.json")).unwrap(), fs::read(folder.join("object.json")).unwrap());
}

#[test]
fn what_is_refused_leaves_nothing() {
    let chest = Chest::new();
    let out = tempfile::tempdir().unwrap();
    let path = chest.path().to_str().unwrap();
    let import = |arguments: &[&str]| vmao(out.path(), &[&["object", "import"], arguments].concat());
    check_refused(&import(&[path]), "--out DIR is missing");
    check_refused(&import(&[path, "--out", "o", "--size", "0"]), "expected a number from 0.001 to 3");
    check_refused(&import(&[path, "--out", "o", "--mass", "NaN"]), "expected a number from 0.001 to 100");
    check_refused(&import(&[path, "--out", "o", "--hulls", "65"]), "--hulls");
    check_refused(&import(&["nowhere", "--out", "o"]), "nowhere: cannot be found");
    chest.write("textured_objs/original-1.obj", "v 0 0 0\nf 1 2 3\n");
    check_refused(&import(&[path, "--out", "o"]), "textured_objs/original-1.obj: line 2: a face names `2`");
    assert_eq!(fs::read_dir(out.path()).unwrap().count(), 0);
}

#[test]
fn an_imported_object_is_explored_as_any_other() {
    let chest = Chest::new();
    let out = tempfile::tempdir().unwrap();
    let path = chest.path().to_str().unwrap();
    answer(&vmao(out.path(), &["object", "import", path, "--out", "chest", "--json"]));
    let name = "object.name=\"chest/object.json\"";
    let explore = ["explore", "--set", name, "--max-trials", "2", "--out", "data", "--json", "--set", "explore.round_size=2"];
    let found = answer(&vmao(out.path(), &explore));
    assert_eq!(found["trials"], 2);
    assert_eq!(found["digest"].as_str().unwrap().len(), 64);
}
