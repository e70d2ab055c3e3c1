//! Objects and demonstrations from files, through the real program.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod tongs;

use serde_json::{Value, json};
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

fn vmao(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vmao")).current_dir(folder).args(arguments).output().unwrap()
}

#[track_caller]
fn answer(folder: &Path, arguments: &[&str]) -> Value {
    let output = vmao(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[track_caller]
fn refused(folder: &Path, arguments: &[&str], message: &str) {
    let output = vmao(folder, arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains(message) && !error.contains("panicked"), "expected {message}\nfound {error}");
    assert!(output.stdout.is_empty());
}

const SMALL: [&str; 8] = ["explore", "--successes", "99", "--max-trials", "6", "--set", "explore.round_size=3", "--json"];

#[test]
fn an_object_from_a_file_is_explored_and_its_run_repeats_after_the_file_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    tongs::write(&here.join("tools/tongs"), 0.16);
    let explored = answer(here, &[&SMALL[..], &["--set", "object.name=tools/tongs", "--out", "first"]].concat());
    assert_eq!(explored["trials"], 6);
    assert!(explored["successes"].as_u64().unwrap() >= 1, "tongs can be held and moved: {explored}");
    let copies: Vec<_> = fs::read_dir(here.join("first/inputs")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(copies.len(), 1, "{copies:?}");
    let shown = answer(here, &["object", "show", "tools/tongs/object.json"]);
    assert_eq!(
        (&shown["name"], &shown["parts"][1]["name"], &shown["grippers"]["panda"]["sizes_held"]),
        (&json!("tongs"), &json!("over"), &json!(1))
    );
    assert_eq!(answer(here, &["object", "list", "tools"]), json!(["tools/tongs/object.json"]));

    fs::remove_dir_all(here.join("tools")).unwrap();
    fs::rename(here.join("first"), here.join("moved")).unwrap();
    let again = answer(here, &[&SMALL[..], &["--config", "moved/config.toml", "--out", "second"]].concat());
    assert_eq!(again, explored, "the same records, from the copy");
    let texts = ["moved", "second"].map(|run| fs::read_to_string(here.join(run).join("config.toml")).unwrap());
    assert_eq!(texts[0], texts[1]);
}

#[test]
fn demonstrations_from_a_file_are_used_and_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    tongs::write(here, 0.16);
    // On the slopes of both handles, a bar's width apart.
    let (sine, cosine) = 0.7_f64.sin_cos();
    let side = |turn: f64, across: f64| [0.1 * cosine - across * turn * sine, 0.1 * turn * sine + across * cosine, 0.0];
    let half = 0.012 + (0.1 - 0.045) / (0.16 - 0.045) * (0.009 - 0.012);
    let points = |across: f64| json!({"under": {"left": side(-1.0, across), "right": side(-1.0, -across)}, "over": {"left": side(1.0, across), "right": side(1.0, -across)}});
    let grasp = |part: &str| json!({"part": part, "fingers": ["left", "right"]});
    let good = json!({"schema": 1, "points": points(half), "demonstrations": [{"grasps": [grasp("under"), grasp("over")]}]});
    let explore = |document: &Value, message: Option<&str>| {
        fs::write(here.join("holds.json"), document.to_string()).unwrap();
        let arguments =
            [&SMALL[..], &["--set", "object.name=./object.json", "--set", "explore.demonstrations=holds.json", "--out", "run"]]
                .concat();
        match message {
            Some(message) => refused(here, &arguments, message),
            None => drop(answer(here, &arguments)),
        }
    };
    let changed = |change: &dyn Fn(&mut Value)| {
        let mut document = good.clone();
        change(&mut document);
        document
    };
    let refuse = |change: &dyn Fn(&mut Value), message: &str| explore(&changed(change), Some(message));
    refuse(
        &|d| d["points"] = points(half + 0.01),
        "point `left` is 10.0 mm off the surface of part `under`, expected at most 2 mm",
    );
    refuse(&|d| d["points"] = points(0.0), "below the surface of part `under`");
    refuse(
        &|d| d["demonstrations"][0]["grasps"][1]["part"] = json!("lid"),
        "object `tongs` has no part `lid`; parts are: under, over",
    );
    refuse(
        &|d| d["demonstrations"][0]["grasps"][1]["fingers"][0] = json!("top"),
        "part `over` has no point `top`; points are: left, right",
    );
    refuse(&|d| d["demonstrations"][0]["grasps"] = json!([grasp("over")]), "demonstrations[0]: no grasp of part `under`");
    refuse(&|d| d["demonstrations"][0]["grasps"][1] = grasp("under"), "part `under` again");
    refuse(&|d| d["demonstrations"] = json!([]), "0 demonstrations, expected 1 to");
    refuse(&|d| d["schema"] = json!(2), "schema 2, expected 1");
    refuse(&|d| d["demonstrations"][0]["grasps"][0]["fingers"] = json!(["left", "left"]), "coincide");
    refuse(&|d| d["extra"] = json!(1), "unknown field `extra`");
    explore(&good, None);
    let copies = fs::read_dir(here.join("run/inputs")).unwrap().count();
    assert_eq!(copies, 2, "the object and the demonstrations");
    fs::write(here.join("holds.toml"), "schema = 1\npoints = {}\ndemonstrations = [{ grasps = 3 }]").unwrap();
    let arguments = ["scene", "--set", "explore.demonstrations=holds.toml"];
    refused(here, &arguments, "holds.toml: line 3");
}

#[test]
fn hostile_and_missing_object_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let mut broken = tongs::tongs(0.16);
    broken["parts"][1]["solids"][0]["shape"]["vertices"][3][1] = json!(1.0);
    for (name, text, message) in [
        ("dent.json", broken.to_string(), "dent.json: parts[1].solids[0].shape"),
        ("deep.json", "[".repeat(100_000), "deep.json: "),
        ("nan.json", tongs::tongs(0.16).to_string().replacen("0.12", "NaN", 1), "NaN and Infinity are not JSON numbers"),
        ("empty.json", String::new(), "empty.json: "),
        ("cut.json", tongs::tongs(0.16).to_string()[..300].to_owned(), "cut.json: "),
    ] {
        fs::write(here.join(name), text).unwrap();
        refused(here, &["object", "show", name], message);
        let setting = format!("object.name={name}");
        refused(here, &["scene", "--set", &setting], message);
    }
    refused(here, &["object", "show", "./nothing"], "nothing: cannot be read");
    refused(here, &["object", "show", "nothing"], "the catalogue has no object `nothing`");
    refused(here, &["scene", "--set", "object.name=./nothing/"], "cannot be read");
    refused(here, &["scene", "--set", "object.sizes=[\"a.json\"]"], "a.json: cannot be read");
    assert_eq!(fs::read_dir(here).unwrap().count(), 5, "nothing was written");
}

/// The first block of this language in a document.
fn block<'a>(text: &'a str, language: &str) -> &'a str {
    let (_, rest) = text.split_once(&format!("```{language}\n")).unwrap();
    rest.split_once("```").unwrap().0
}

#[test]
fn the_documented_files_work() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("bars.json"), block(include_str!("../../../docs/objects.md"), "json")).unwrap();
    fs::write(here.join("holds.toml"), block(include_str!("../../../docs/demonstrations.md"), "toml")).unwrap();
    assert_eq!(answer(here, &["object", "show", "bars.json"])["demonstrations"], 1);
    for demonstrations in ["own", "holds.toml"] {
        let setting = format!("explore.demonstrations={demonstrations}");
        answer(here, &["scene", "--json", "--set", "object.name=bars.json", "--set", &setting]);
    }
    let text = fs::read_to_string(here.join("scene.xml")).unwrap();
    assert!(text.contains(r#"type="mesh" mesh="object/loose/0""#));
}
