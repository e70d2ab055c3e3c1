//! `vmao ocao` through the real binary: the answer, and every refusal with its place.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod program;

use serde_json::{Value, json};
use std::process::Output;

fn ocao(request: impl AsRef<[u8]>) -> Output {
    program::run("ocao", &["--json"], request)
}

fn answer(request: &Value) -> Value {
    program::answer(&ocao(request.to_string()))
}

#[track_caller]
fn check_refused(request: impl AsRef<[u8]>, message: &str) {
    assert_eq!(program::check_refusal(ocao(request), message).lines().count(), 1);
}

/// The example of the interface description.
fn example() -> Value {
    json!({
        "object": {
            "parts": [{"name": "a", "pose": {"position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}}, {"name": "b", "pose": {}}],
            "joints": [{"name": "hinge", "type": "revolute", "parent": "a", "child": "b",
                        "anchor": [0, 0, 0], "axis": [0, 0, 1], "position": 0.3, "limits": [-1.5, 1.5]}]
        },
        "root": "b",
        "grippers": [{"name": "left", "part": "a", "pose": {}}],
        "goal": {"root_pose": {}, "joint_positions": {"hinge": 0.9}}
    })
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[track_caller]
fn check_close(value: &Value, expected: &[f64]) {
    let found = numbers(value);
    let close = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9);
    assert!(found.len() == expected.len() && close, "{found:?}, expected {expected:?}");
}

#[test]
fn the_documented_example_turns_the_parent_back_about_the_hinge() {
    let answer = answer(&example());
    // The child is the root and stands still, so the parent turns by −0.6 about z, and its gripper with it.
    let turned = [0.3_f64.cos(), 0.0, 0.0, -(0.3_f64.sin())];
    assert_eq!(answer["parts"][0]["name"], "a");
    check_close(&answer["parts"][0]["pose"]["quaternion"], &turned);
    assert_eq!(
        answer["parts"][1],
        json!({"name": "b", "pose": {"position": [0.0, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}})
    );
    assert_eq!((&answer["grippers"][0]["name"], &answer["grippers"][0]["part"]), (&json!("left"), &json!("a")));
    check_close(&answer["grippers"][0]["pose"]["quaternion"], &turned);
}

#[test]
fn a_mixed_tree_has_its_hand_computed_goal() {
    // base -slide-> tray -weld-> bowl, and base -hinge-> lid; the root is the bowl, moved up by 1 and turned 90° about z.
    let half = 0.5_f64.sqrt();
    let request = json!({
        "object": {
            "parts": [{"name": "base", "pose": {}}, {"name": "tray", "pose": {"position": [1, 0, 0]}},
                      {"name": "bowl", "pose": {"position": [1, 0, 1]}}, {"name": "lid", "pose": {"position": [0, 2, 0]}}],
            "joints": [{"name": "slide", "type": "prismatic", "parent": "base", "child": "tray", "axis": [3, 0, 0], "position": 0.25},
                       {"name": "weld", "type": "fixed", "parent": "tray", "child": "bowl"},
                       {"name": "hinge", "type": "revolute", "parent": "base", "child": "lid",
                        "anchor": [0, 1, 0], "axis": [1e-300, 0, 0], "position": 10, "limits": [0, 4]}]
        },
        "root": "bowl",
        "goal": {"root_pose": {"position": [1, 0, 2], "quaternion": [2e300, 0, 0, 2e300]},
                 "joint_positions": {"slide": 0.75, "hinge": 10.0 - std::f64::consts::PI - 2.0 * std::f64::consts::PI}}
    });
    let answer = answer(&request);
    // The tray slid 0.5 along x from the base, so the base went back by 0.5 before the turn about the bowl.
    check_close(&answer["parts"][0]["pose"]["position"], &[1.0, -1.5, 1.0]);
    check_close(&answer["parts"][1]["pose"]["position"], &[1.0, 0.0, 1.0]);
    check_close(&answer["parts"][2]["pose"]["position"], &[1.0, 0.0, 2.0]);
    check_close(&answer["parts"][2]["pose"]["quaternion"], &[half, 0.0, 0.0, half]);
    // The lid swung half around its anchor (0, 1, 0): in the base frame from (0, 2, 0) to (0, 0, 0).
    check_close(&answer["parts"][3]["pose"]["position"], &[1.0, -1.5, 1.0]);
    assert_eq!(answer["grippers"], json!([]));
}

/// A tip on a ball at the end of an arm that is turned by 90° about z; the ball is at zero.
fn with_a_ball() -> Value {
    let half = 0.5_f64.sqrt();
    json!({
        "object": {
            "parts": [{"name": "arm", "pose": {"quaternion": [half, 0, 0, half]}}, {"name": "tip", "pose": {"position": [0, 2, 0]}}],
            "joints": [{"name": "ball", "type": "ball", "parent": "arm", "child": "tip", "anchor": [0, 1, 0],
                        "position": [0, 0, 0], "limits": [0, 2]}]
        },
        "root": "arm",
        "goal": {"root_pose": {"quaternion": [half, 0, 0, half]},
                 "joint_positions": {"ball": [0, -std::f64::consts::FRAC_PI_2, 0]}}
    })
}

#[test]
fn a_ball_joint_turns_by_rotation_vectors_in_its_parents_frame() {
    let mut request = with_a_ball();
    // -y of the turned arm is +x of the world: a quarter turn about it takes the tip from +y to +z of the anchor.
    check_close(&answer(&request)["parts"][1]["pose"]["position"], &[0.0, 1.0, 1.0]);
    request["root"] = json!("tip");
    request["goal"]["root_pose"] = json!({"position": [0, 2, 0]});
    // With the tip at rest the arm turns back: its origin from 1 below the anchor along y to 1 above it along z.
    check_close(&answer(&request)["parts"][0]["pose"]["position"], &[0.0, 1.0, 1.0]);
}

#[test]
fn bad_positions_of_ball_joints_are_refused() {
    let with = |pointer: &str, value: Value| {
        let mut request = with_a_ball();
        *request.pointer_mut(pointer).unwrap() = value;
        request.to_string()
    };
    let goal = "/goal/joint_positions/ball";
    check_refused(with(goal, json!(0.5)), "0.5 for ball joint `ball`, expected a rotation vector [x, y, z]");
    check_refused(with(goal, json!([0.5, 1])), "goal.joint_positions.ball");
    check_refused(with(goal, json!([0, 0, 1, 0])), "goal.joint_positions.ball");
    check_refused(with(goal, json!([0, "a", 1])), "goal.joint_positions.ball");
    check_refused(with(goal, json!([2, 0.01, 0])), "goal [2.0, 0.01, 0.0] of joint `ball` is outside its limits [0, 2]");
    check_refused(with(goal, json!([1e300, 0, 0])), "outside its limits");
    check_refused(
        with("/object/joints/0/limits", json!([-1, 2])),
        "limits of ball joint `ball` are [-1, 2], expected [0, largest angle]",
    );
    check_refused(with("/object/joints/0/position", json!(0)), "0 for ball joint `ball`, expected a rotation vector");
    check_refused(with("/object/joints/0/anchor", Value::Null), "ball joint `ball` has no `anchor`");
    let mut hinge = example();
    hinge["goal"]["joint_positions"]["hinge"] = json!([0, 0, 1]);
    check_refused(hinge.to_string(), "[0.0, 0.0, 1.0] for revolute joint `hinge`, expected a number");
}

#[test]
fn one_part_without_joints_carries_its_grippers() {
    let request = json!({"object": {"parts": [{"name": "a", "pose": {"position": [1, 2, 3]}}], "joints": []}, "root": "a",
        "grippers": [{"name": "g", "part": "a", "pose": {"position": [1, 2, 4]}}],
        "goal": {"root_pose": {"position": [0, 0, 0], "quaternion": [0, 1, 0, 0]}, "joint_positions": {}}});
    let answer = answer(&request);
    check_close(&answer["grippers"][0]["pose"]["position"], &[0.0, 0.0, -1.0]);
}

#[test]
fn numbers_round_trip_and_the_answer_is_the_same_with_a_byte_order_mark() {
    let mut request = example();
    let value = 0.1 + 0.2;
    request["goal"]["root_pose"] = json!({"position": [value, 1e22, -5e-324]});
    let plain = ocao(request.to_string());
    let answer: Value = serde_json::from_slice(&plain.stdout).unwrap();
    assert_eq!(numbers(&answer["parts"][1]["pose"]["position"]), [value, 1e22, -5e-324]);
    assert_eq!(ocao(format!("\u{feff}{request}")).stdout, plain.stdout);
}

/// The example with the value at `pointer` replaced.
fn with(pointer: &str, value: Value) -> String {
    let mut request = example();
    *request.pointer_mut(pointer).unwrap() = value;
    request.to_string()
}

#[test]
fn graphs_that_are_no_tree_are_refused() {
    let joint = |name: &str, parent: &str, child: &str| json!({"name": name, "type": "fixed", "parent": parent, "child": child});
    let parts = json!([{"name": "a", "pose": {}}, {"name": "b", "pose": {}}, {"name": "c", "pose": {}}]);
    let object = |joints: Value| with("/object", json!({"parts": parts, "joints": joints}));
    check_refused(
        object(json!([joint("x", "a", "b"), joint("y", "b", "c"), joint("z", "c", "a")])),
        "joints x, y, z form a cycle through parts a, b, c, expected a tree",
    );
    check_refused(object(json!([joint("x", "a", "b"), joint("y", "b", "a")])), "object.joints[1] (line 1, column ");
    check_refused(object(json!([joint("x", "c", "c")])), "joint `x` connects part `c` to itself");
    check_refused(object(json!([joint("x", "a", "b")])), "no chain of joints connects part `a` to: c; expected one tree");
    check_refused(with("/object/joints", json!([])), "object.parts[1] (line 1");
    check_refused(with("/object/parts", json!([])), "0 parts, expected 1 to 65535");
}

#[test]
fn unknown_and_duplicate_names_are_refused_with_what_exists() {
    check_refused(with("/root", json!("lid")), "object has no part `lid`; parts are: a, b");
    check_refused(with("/object/joints/0/child", json!("lid")), "<stdin>: object.joints[0].child (line 1, column ");
    check_refused(with("/object/joints/0/parent", json!("A")), "object has no part `A`; parts are: a, b");
    check_refused(with("/grippers/0/part", json!("lid")), "grippers[0].part (line 1");
    check_refused(with("/goal/joint_positions", json!({"hinge": 1, "hnge": 1})), "object has no joint `hnge`; joints are: hinge");
    check_refused(
        with("/object/parts/1/name", json!("a")),
        "a second part `a`, expected unique names; the first is object.parts[0]",
    );
    let gripper = json!({"name": "g", "part": "a", "pose": {}});
    check_refused(with("/grippers", json!([gripper, gripper])), "grippers[1].name (line 1");
    let hinge = example()["object"]["joints"][0].clone();
    check_refused(with("/object/joints", json!([hinge, hinge])), "a second joint `hinge`");
    let twice = example().to_string().replace("{\"hinge\":0.9}", "{\"hinge\":0.9,\n \"hi\\u006ege\":0.8}");
    check_refused(twice, "goal.joint_positions.hinge (line 2, column 15): a second goal for joint `hinge`");
    check_refused(example().to_string().replace("\"root\":\"b\"", "\"root\":\"b\",\"root\":\"a\""), "duplicate field `root`");
}

#[test]
fn degenerate_and_non_finite_numbers_are_refused() {
    check_refused(with("/object/joints/0/axis", json!([0, 0, -0.0])), "object.joints[0].axis (line 1, column ");
    check_refused(with("/object/joints/0/axis", json!([0, 0, 0])), "a zero axis, expected a direction");
    for pointer in ["/object/parts/1/pose", "/grippers/0/pose", "/goal/root_pose"] {
        check_refused(with(pointer, json!({"quaternion": [0, 0, 0, 0]})), "a zero quaternion, expected a rotation");
    }
    let text = example().to_string();
    for (literal, message) in [
        ("1e999", "number out of range, expected a finite double"),
        ("-1e999", "number out of range, expected a finite double"),
        ("NaN", "not JSON"),
        ("Infinity", "NaN and Infinity are not JSON numbers"),
        ("\"NaN\"", "invalid type: string \"NaN\", expected a number, or a rotation vector"),
        ("null", "goal.joint_positions.hinge (line 1, column "),
        ("[1]", "invalid length 1, expected an array of length 3"),
    ] {
        check_refused(text.replace("0.9", literal), message);
    }
    let mut overflowing = example();
    overflowing["object"]["joints"][0]["anchor"] = json!([1.7e308, 1.7e308, 0]);
    overflowing["goal"]["root_pose"] = json!({"position": [1.7e308, 0, 0], "quaternion": [1, 0, 0, 1]});
    check_refused(overflowing.to_string(), "the goal pose of part `a` overflows");
    overflowing = example();
    overflowing["object"]["joints"][0]["limits"] = json!(null);
    overflowing["object"]["joints"][0]["position"] = json!(-1.7e308);
    overflowing["goal"]["joint_positions"]["hinge"] = json!(1.7e308);
    check_refused(overflowing.to_string(), "overflows");
}

#[test]
fn goals_outside_limits_missing_or_of_fixed_joints_are_refused() {
    check_refused(with("/goal/joint_positions/hinge", json!(1.6)), "goal 1.6 of joint `hinge` is outside its limits [-1.5, 1.5]");
    check_refused(with("/goal/joint_positions/hinge", json!(-1.5000000001)), "outside its limits");
    check_refused(with("/goal/joint_positions", json!({})), "no goal for joint `hinge`");
    check_refused(with("/object/joints/0/limits", json!([1, -1])), "object.joints[0].limits (line 1");
    check_refused(with("/object/joints/0/limits", json!([1])), "object.joints[0].limits (line 1");
    check_refused(with("/object/joints/0/type", json!("fixed")), "goal 0.9 of fixed joint `hinge`, which stays at 0.3");
    for request in [
        with("/goal/joint_positions/hinge", json!(1.5)),
        with("/object/joints/0/position", json!(7)),
        with("/object/joints/0/limits", json!(null)),
    ] {
        assert!(ocao(&request).status.success(), "{request}");
    }
}

#[test]
fn malformed_documents_are_refused_with_their_place() {
    check_refused("", "<stdin>: line 1, column 1: not JSON: EOF while parsing a value");
    check_refused("[]", "invalid type: sequence, expected an object");
    check_refused(with("/object/parts/0/pose", json!([[0, 0, 0], [1, 0, 0, 0]])), "object.parts[0].pose (line 1, column ");
    check_refused(with("/object/parts", json!({"a": {}})), "invalid type: map, expected a sequence");
    check_refused(with("/object/joints/0", json!(["hinge", "fixed", "a", "b"])), "expected an object");
    check_refused(with("/object/joints/0/type", json!({"fixed": null})), "object.joints[0].type (line 1");
    check_refused(format!("{} x", example()), "trailing characters");
    check_refused("\u{feff}{\"object\":\n 7}", "object (line 2, column 2): invalid type: integer `7`");
    check_refused(b"{\"root\": \"\xff\"}", "line 1, column 11: byte 0xff is not UTF-8 text");
    check_refused(b"\xff\xfe{\0", "UTF-16 text, expected UTF-8");
    check_refused("[".repeat(1 << 20), "expected an object");
    check_refused(format!("{{\"object\": {{\"parts\": {}", "[".repeat(1 << 20)), "object.parts[0]");
    check_refused(
        with("/object/joints/0/type", json!("screw")),
        "a joint has no type `screw`; types are: revolute, prismatic, ball, fixed",
    );
    for (pointer, message) in [
        ("", "unknown field `extra`, expected one of `object`, `root`, `grippers`, `goal`"),
        ("/object", "unknown field `extra`, expected `parts` or `joints`"),
        ("/object/parts/0/pose", "unknown field `extra`, expected `position` or `quaternion`"),
        ("/goal", "unknown field `extra`"),
    ] {
        let mut request = example();
        request.pointer_mut(pointer).unwrap()["extra"] = json!(1);
        check_refused(request.to_string(), message);
    }
    for (pointer, field) in [("", "goal"), ("/object/joints/0", "child"), ("/goal", "root_pose"), ("/object/parts/0", "pose")] {
        let mut request = example();
        request.pointer_mut(pointer).unwrap().as_object_mut().unwrap().remove(field);
        check_refused(request.to_string(), &format!("missing field `{field}`"));
    }
    for field in ["anchor", "axis", "position"] {
        let mut request = example();
        request["object"]["joints"][0].as_object_mut().unwrap().remove(field);
        check_refused(request.to_string(), &format!("revolute joint `hinge` has no `{field}`"));
    }
}

#[test]
fn a_chain_of_a_thousand_parts_is_answered_from_its_end() {
    let parts: Vec<Value> = (0..1000).map(|i| json!({"name": format!("p{i}"), "pose": {"position": [i, 0, 0]}})).collect();
    let joints: Vec<Value> = (1..1000)
        .map(|i| {
            json!({"name": format!("j{i}"), "type": "revolute", "parent": format!("p{}", i - 1), "child": format!("p{i}"),
                   "anchor": [f64::from(i) - 0.5, 0, 0], "axis": [0, 0, 1], "position": 0})
        })
        .collect();
    let goals: Value = (1..1000)
        .map(|i| (format!("j{i}"), json!(if i == 500 { std::f64::consts::PI } else { 0.0 })))
        .collect::<serde_json::Map<_, _>>()
        .into();
    let request = json!({"object": {"parts": parts, "joints": joints}, "root": "p999",
        "goal": {"root_pose": {"position": [999, 0, 0]}, "joint_positions": goals}});
    // Everything before joint 500 is reflected about its axis at x = 499.5.
    check_close(&answer(&request)["parts"][0]["pose"]["position"], &[999.0, 0.0, 0.0]);
}
