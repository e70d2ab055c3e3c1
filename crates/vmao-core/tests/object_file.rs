//! Object files: every catalogue object survives the way through one, and whatever is wrong is refused with its place.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use serde_json::{Value, json};
use vmao_core::{
    catalogue::{InstanceSet, NAMES, item},
    contact::PartId,
    object_file::ObjectFile,
};

fn two_bars() -> Value {
    let bar = json!({"shape": {"type": "box", "half_extents": [0.06, 0.01, 0.01]}, "pose": {"position": [0.07, 0, 0]}, "color": [1, 0, 0]});
    json!({
        "schema": 1, "name": "two-bars", "source": "drawn by hand",
        "parts": [
            {"name": "fixed", "mass": 0.1, "solids": [bar]},
            {"name": "loose", "mass": 0.1, "solids": [bar], "meshes": [{"file": "visual/loose.obj", "pose": {}}]},
        ],
        "joints": [{"name": "hinge", "type": "revolute", "parent": "fixed", "child": "loose", "anchor": [0, 0, 0], "axis": [0, 0, 2],
                    "limits": [0, 2], "damping": 0.01}],
        "demonstrations": [[{"part": "fixed", "fingers": [[0.1, 0.01, 0], [0.1, -0.01, 0]]},
                            {"part": "loose", "fingers": [[0.1, 0.01, 0], [0.1, -0.01, 0]]}]],
    })
}

/// What is said of the two bars after `change`.
#[track_caller]
fn refused(change: impl FnOnce(&mut Value)) -> String {
    let mut document = two_bars();
    change(&mut document);
    match serde_json::from_value::<ObjectFile>(document) {
        Ok(file) => file.item().unwrap_err().to_string(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn a_plain_document_is_an_object() {
    let file: ObjectFile = serde_json::from_value(two_bars()).unwrap();
    let read = file.item().unwrap();
    assert_eq!((read.object.parts.len(), read.object.joints[0].child, read.demonstrations.len()), (2, PartId(1), 1));
    assert!((read.object.joints[0].axis.norm() - 1.0).abs() < 1e-15, "made unit");
    assert_eq!(serde_json::from_str::<ObjectFile>(&serde_json::to_string(&file).unwrap()).unwrap(), file);
}

#[test]
fn every_catalogue_object_survives_the_way_through_a_document() {
    for name in NAMES {
        for set in [InstanceSet::Train, InstanceSet::HeldOut] {
            let before = item(name, set, 3).unwrap();
            let after = ObjectFile::new(&before.object, &before.demonstrations).item().unwrap();
            assert_eq!(after.demonstrations, before.demonstrations, "{name}");
            assert_eq!((&after.object.name, after.object.joints.len()), (&before.object.name, before.object.joints.len()));
            for (before, after) in before.object.parts.iter().zip(&after.object.parts) {
                assert_eq!((&after.name, after.mass, after.solids.len()), (&before.name, before.mass, before.solids.len()));
                for (before, after) in before.solids.iter().zip(&after.solids) {
                    assert_eq!((&after.shape, after.color), (&before.shape, before.color));
                    let difference = before.carrier_from_solid.inverse() * after.carrier_from_solid;
                    assert!(difference.translation.vector.norm() + difference.rotation.angle() < 1e-7, "{name}");
                }
            }
            for (before, after) in before.object.joints.iter().zip(&after.object.joints) {
                assert_eq!(
                    (after.kind, after.limits, after.parent, after.child),
                    (before.kind, before.limits, before.parent, before.child)
                );
                assert!((after.axis.into_inner() - before.axis.into_inner()).norm() < 1e-15 && after.anchor == before.anchor);
            }
        }
    }
}

#[test]
fn whatever_is_wrong_is_refused_with_its_place() {
    let part = |index: usize| move |document: &mut Value, key: &str, value: Value| document["parts"][index][key] = value;
    for (expected, found) in [
        ("schema: 2, expected 1", refused(|d| d["schema"] = json!(2))),
        ("name: `../x`, expected", refused(|d| d["name"] = json!("../x"))),
        ("name: ``, expected", refused(|d| d["name"] = json!(""))),
        ("parts: no parts", refused(|d| d["parts"] = json!([]))),
        ("parts: 65 parts, expected at most 64", refused(|d| d["parts"] = json!(vec![d["parts"][0].clone(); 65]))),
        ("parts[1].name: `fixed` again, already the name of number 0", refused(|d| part(1)(d, "name", json!("fixed")))),
        ("parts[1].name: `a\\u{1b}\\\"><`, expected", refused(|d| part(1)(d, "name", json!("a\u{1b}\"><")))),
        ("parts[0].mass: 0.0, expected a number from", refused(|d| part(0)(d, "mass", json!(0)))),
        ("parts[0].mass: -1.0, expected", refused(|d| part(0)(d, "mass", json!(-1)))),
        ("parts[0].mass: 1e300, expected", refused(|d| part(0)(d, "mass", json!(1e300)))),
        ("parts[1].solids: no solids", refused(|d| part(1)(d, "solids", json!([])))),
        (
            "parts: 1025 solids, expected at most 1024",
            refused(|d| part(1)(d, "solids", json!(vec![d["parts"][0]["solids"][0].clone(); 1024]))),
        ),
        (
            "parts[1].solids[0].shape.half_extents: 0.0, expected",
            refused(|d| d["parts"][1]["solids"][0]["shape"]["half_extents"][2] = json!(0)),
        ),
        (
            "parts[0].solids[0].pose.position[1]: 100000.0, expected",
            refused(|d| d["parts"][0]["solids"][0]["pose"]["position"][1] = json!(1e5)),
        ),
        (
            "parts[0].solids[0].pose.quaternion: zero",
            refused(|d| d["parts"][0]["solids"][0]["pose"]["quaternion"] = json!([0, 0, 0, 0])),
        ),
        (
            "parts[0].solids[0].color[2]: 2.0, expected a number from 0 to 1",
            refused(|d| d["parts"][0]["solids"][0]["color"][2] = json!(2)),
        ),
        ("unknown variant `cone`", refused(|d| d["parts"][0]["solids"][0]["shape"]["type"] = json!("cone"))),
        (
            "3 vertices, expected 4 to 256",
            refused(|d| {
                d["parts"][0]["solids"][0]["shape"] =
                    json!({"type": "convex", "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]});
            }),
        ),
        ("unknown field `wings`", refused(|d| d["parts"][0]["wings"] = json!(2))),
        (
            "joints[0].parent: object has no part `lid`; parts are: fixed, loose",
            refused(|d| d["joints"][0]["parent"] = json!("lid")),
        ),
        ("joints: joint 0 connects part 1 to itself", refused(|d| d["joints"][0]["parent"] = json!("loose"))),
        ("joints: parts [PartId(1)] are not connected", refused(|d| d["joints"] = json!([]))),
        ("joints[1].name: `hinge` again", refused(|d| d["joints"] = json!([d["joints"][0], d["joints"][0]]))),
        ("joints[0]: no anchor, expected one of a revolute joint", refused(|d| d["joints"][0]["anchor"] = Value::Null)),
        ("joints[0].axis: zero, expected a direction", refused(|d| d["joints"][0]["axis"] = json!([0, 0, 0]))),
        ("joints[0].limits: [0.5, 2.0] without zero", refused(|d| d["joints"][0]["limits"] = json!([0.5, 2]))),
        (
            "joints[0].limits: [2.0, 2.0], expected [low, high] with low < high",
            refused(|d| d["joints"][0]["limits"] = json!([2, 2])),
        ),
        ("joints[0].damping: -1.0, expected", refused(|d| d["joints"][0]["damping"] = json!(-1))),
        (
            "demonstrations[0]: no contact on part `loose`",
            refused(|d| drop(d["demonstrations"][0].as_array_mut().unwrap().pop())),
        ),
        ("demonstrations[0][1].part: `fixed` again", refused(|d| d["demonstrations"][0][1]["part"] = json!("fixed"))),
        ("demonstrations[0][0].part: object has no part `x`", refused(|d| d["demonstrations"][0][0]["part"] = json!("x"))),
        ("source: 5000 bytes", refused(|d| d["source"] = json!("x".repeat(5000)))),
    ] {
        assert!(found.contains(expected), "expected {expected}\nfound {found}");
    }
    for path in ["/etc/a.obj", "../a.obj", "a/../b.obj", "a\\b.obj", "c:a.obj", "a//b.obj", "./a.obj", "a.stl", "", "a\n.obj"] {
        let found = refused(|d| d["parts"][1]["meshes"][0]["file"] = json!(path));
        assert!(found.contains("parts[1].meshes[0].file: ") && found.contains("within the object's folder"), "{path}: {found}");
    }
}
