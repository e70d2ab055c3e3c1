//! The conventions of every command, through the real binary: exit codes, streams, saved configuration.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
};

const REQUEST: &str = r#"{"object": {"parts": [{"name": "a", "pose": {}}]}, "root": "a", "goal": {"root_pose": {}}}"#;

fn vmao(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vmao")).args(arguments).current_dir(directory).stdin(Stdio::null()).output().unwrap()
}

#[track_caller]
fn check_refused(arguments: &[&str], message: &str) {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("a.json"), REQUEST).unwrap();
    fs::write(directory.path().join("bad.toml"), "[goal]\nlfit = [0.1, 0.2]\n").unwrap();
    let output = vmao(directory.path(), arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains(message), "{error}");
    assert!(output.stdout.is_empty());
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 2, "a refused command writes nothing");
}

#[test]
fn bad_usage_and_bad_input_exit_with_two_and_say_what_exists() {
    check_refused(&["fold"], "unrecognized subcommand 'fold'");
    check_refused(&["ocao"], "<FILE>");
    check_refused(&["ocao", "a.json", "--seed=-1"], "--seed");
    check_refused(&["ocao", "a.json", "--workers", "0"], "--workers");
    check_refused(&["ocao", "b.json", "--out", "o"], "error: b.json: cannot be read: ");
    check_refused(&["ocao", ".", "--out", "o"], "error: .: cannot be read: ");
    check_refused(
        &["ocao", "a.json", "--out", "o", "--set", "goal.lfit=1"],
        "section [goal] has no key `lfit`; keys are: joint_change_deg",
    );
    check_refused(
        &["ocao", "a.json", "--out", "o", "--config", "bad.toml"],
        "bad.toml: line 2, column 1: section [goal] has no key `lfit`",
    );
    check_refused(&["robot", "meshes", "ur5", "--from", "."], "the program has no robot `ur5`; robots are: panda, sawyer");
    check_refused(&["robot", "meshes", "panda", "--from", ".", "--out", "o"], "no model of `panda` with meshes below ");
    check_refused(&["scene", "--meshes", "none", "--out", "a.xml"], "error: none/meshes.json: cannot be read: ");
    check_refused(&["ocao", "a.json", "--config", "none.toml"], "none.toml: cannot be read: ");
    check_refused(
        &["scene", "--out", "o.xml", "--set", "object.root=jaw"],
        "object.root: object `pliers` has no part `jaw`; a root is one of: first, auto, lever-a, lever-b",
    );
}

#[test]
fn help_and_version_are_answers() {
    for arguments in [&["--help"][..], &["--version"], &["ocao", "--help"]] {
        let output = vmao(Path::new("."), arguments);
        assert!(output.status.success() && output.stderr.is_empty() && !output.stdout.is_empty(), "{arguments:?}");
    }
}

#[test]
fn outputs_lie_beside_the_resolved_configuration_and_the_program() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("a.json"), REQUEST).unwrap();
    let output = vmao(directory.path(), &["ocao", "a.json", "--out", "deep/run", "--set", "goal.lift=[0.1, 0.3]", "--seed", "7"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let run = directory.path().join("deep/run");
    let read = |name: &str| fs::read_to_string(run.join(name)).unwrap();
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&read("ocao.json")).unwrap(),
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    );
    let info: serde_json::Value = serde_json::from_str(&read("run.json")).unwrap();
    assert_eq!(
        (info["seed"].as_u64(), info["command"][0].as_str(), info["command"][1].as_str()),
        (Some(7), Some("vmao"), Some("ocao"))
    );
    assert_eq!(info["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(info["config_sha256"], vmao::provenance::sha256_hex(read("config.toml").as_bytes()));
    // The saved file is a configuration: given back, it resolves to itself.
    let again = vmao(directory.path(), &["ocao", "a.json", "--out", "again", "--config", "deep/run/config.toml"]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    assert_eq!(fs::read_to_string(directory.path().join("again/config.toml")).unwrap(), read("config.toml"));
    assert!(read("config.toml").contains("lift = [0.1, 0.3]"));
}

#[test]
fn a_scene_lies_beside_its_configuration_for_one_arm_and_explicit_bases() {
    let directory = tempfile::tempdir().unwrap();
    let bases = "scene.bases=[{position=[-0.5, 0.1, 0.0], yaw_deg=0.0}]";
    let one_arm =
        ["--set", "object.name=sticks-1", "--set", "robots.names=[\"sawyer\"]", "--set", "scene.layout=explicit", "--set", bases];
    let output = vmao(directory.path(), &[&["scene", "--out", "one.xml"], &one_arm[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| fs::read_to_string(directory.path().join(name)).unwrap();
    assert!(read("one.xml").contains("arm0/right_l6") && !read("one.xml").contains("arm1/"));
    assert!(read("one.run.json").contains(env!("CARGO_PKG_VERSION")) && read("one.config.toml").contains("-0.5"));
    let again = vmao(directory.path(), &["scene", "--out", "again.xml", "--config", "one.config.toml"]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    assert_eq!(read("again.xml"), read("one.xml"));
    check_refused(&["scene", "--out", "."], "is a directory, expected the name of a file");
}

#[test]
fn a_full_disk_is_a_failure_of_the_work_and_a_closed_pipe_is_none() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("a.json"), REQUEST).unwrap();
    let with_stdout = |stdout: Stdio| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vmao"));
        let child = command.args(["ocao", "a.json"]).current_dir(directory.path()).stdout(stdout).stderr(Stdio::piped());
        child.spawn().unwrap().wait_with_output().unwrap()
    };
    if Path::new("/dev/full").exists() {
        let full = with_stdout(fs::File::options().write(true).open("/dev/full").unwrap().into());
        assert_eq!(full.status.code(), Some(1));
        assert!(String::from_utf8(full.stderr).unwrap().starts_with("error: stdout: No space left on device"));
    }
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let closed = with_stdout(writer.into());
    assert!(closed.status.success() && closed.stderr.is_empty(), "{}", String::from_utf8_lossy(&closed.stderr));
    // A file where the output directory should be.
    let output = vmao(directory.path(), &["ocao", "a.json", "--out", "a.json"]);
    assert_eq!((output.status.code(), output.stdout.is_empty()), (Some(1), true));
}

#[test]
fn an_arm_that_stands_by_needs_no_network() {
    let directory = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let settings = ["--set", r#"object.name="sticks-1""#, "--set", "train.epochs=1", "--json"];
        let output = vmao(directory.path(), &[arguments, &settings].concat());
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        output
    };
    run(&["explore", "--successes", "2", "--max-trials", "8", "--out", "data"]);
    let trained = run(&["train", "--data", "data", "--model", "top1", "--device", "cuda", "--out", "top1"]);
    let said = String::from_utf8(trained.stderr).unwrap();
    assert!(said.starts_with("training on the ") && said.lines().count() == 1, "one line says on what: {said}");
    let name = if said.contains("on the first CUDA device") { "cuda" } else { "cpu" };
    assert!(name == "cuda" || said.contains("as there is no CUDA device: "), "and why: {said}");
    assert!(String::from_utf8(trained.stdout).unwrap().contains(&format!(r#""device":"{name}""#)));
    let kept = fs::read_to_string(directory.path().join("top1/grasp-0/config.json")).unwrap();
    assert!(kept.contains(&format!(r#""device": "{name}""#)), "{kept}");
    run(&["sample", "--checkpoint", "top1", "--scenes", "1", "--out", "maps"]);
    assert_eq!(fs::read_dir(directory.path().join("maps/maps")).unwrap().count(), 1, "Top-1 has one map");
    assert!(!directory.path().join("top1/grasp-1").exists(), "one part, one grasp");
}
