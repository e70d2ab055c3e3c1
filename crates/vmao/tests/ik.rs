//! `vmao ik` through the real binary: the answer for both robots and frames, and every refusal with its place.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod program;

use serde_json::{Value, json};
use std::process::{Command, Output};
use vmao_core::{
    geometry::{Pose, position_quaternion, rotation_distance},
    kinematics::SerialChain,
    random::Stream,
    robots::RobotModel,
};

fn ik(arguments: &[&str], request: impl AsRef<[u8]>) -> Output {
    program::run("ik", arguments, request)
}

const PANDA_TOOL: [&str; 5] = ["--robot", "panda", "--frame", "tool", "--json"];

fn answers(arguments: &[&str], request: &Value) -> Vec<Value> {
    serde_json::from_value(program::answer(&ik(arguments, request.to_string()))).unwrap()
}

#[track_caller]
fn check_refused(arguments: &[&str], request: impl AsRef<[u8]>, message: &str) {
    program::check_refusal(ik(arguments, request), message);
}

fn target(pose: &Pose) -> Value {
    let (position, quaternion) = position_quaternion(pose);
    json!({"position": position, "quaternion": quaternion})
}

fn chain(robot: &str, frame: &str) -> SerialChain {
    let robot = RobotModel::named(robot).unwrap();
    if frame == "tool" { robot.tool_chain() } else { robot.flange_chain() }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The angles put the frame at the pose, inside the limits.
#[track_caller]
fn check_reaches(chain: &SerialChain, q: &[f64], goal: &Pose) {
    let reached = chain.tool_pose(q);
    let distance = (reached.translation.vector - goal.translation.vector).norm();
    let angle = rotation_distance(&reached.rotation, &goal.rotation);
    assert!(chain.within_limits(q) && distance < 1e-3 && angle < 0.01, "{distance} m, {angle} rad, {q:?}");
}

#[test]
fn random_reachable_poses_are_solved_for_both_robots_and_frames() {
    for robot in ["panda", "sawyer"] {
        for frame in ["flange", "tool"] {
            let (chain, mut stream) = (chain(robot, frame), Stream::new(21, &[]));
            let goals: Vec<Pose> = (0..100).map(|_| chain.tool_pose(&chain.sample(&mut stream))).collect();
            let request = json!({"targets": goals.iter().map(target).collect::<Vec<_>>()});
            let answers = answers(&["--robot", robot, "--frame", frame, "--json"], &request);
            assert_eq!(answers.len(), goals.len());
            for (answer, goal) in answers.iter().zip(&goals) {
                assert_eq!(answer["success"], true, "{robot} {frame}: {answer}");
                check_reaches(&chain, &numbers(&answer["joint_positions"]), goal);
                assert!(answer["position_error"].as_f64().unwrap() < 1e-5 && answer["rotation_error"].as_f64().unwrap() < 1e-5);
                assert!(answer.get("reason").is_none() && answer.get("branches").is_none());
            }
        }
    }
}

#[test]
fn one_target_has_the_same_answer_alone_among_others_and_on_any_number_of_threads() {
    let (chain, mut stream) = (chain("panda", "tool"), Stream::new(22, &[]));
    let targets: Vec<Value> = (0..40).map(|_| target(&chain.tool_pose(&chain.sample(&mut stream)))).collect();
    let together = answers(&PANDA_TOOL, &json!({"targets": targets}));
    let single = ik(&[&PANDA_TOOL[..], &["--workers", "1"]].concat(), json!({"targets": targets}).to_string());
    assert_eq!(serde_json::from_slice::<Vec<Value>>(&single.stdout).unwrap(), together);
    let reversed: Vec<&Value> = targets.iter().rev().collect();
    let mut backwards = answers(&PANDA_TOOL, &json!({"targets": reversed}));
    backwards.reverse();
    assert_eq!(backwards, together);
    assert_eq!(answers(&PANDA_TOOL, &json!({"targets": [targets[17]]})), together[17..18]);
}

#[test]
fn a_seed_that_solves_the_target_is_the_answer_and_one_outside_the_limits_is_moved_inside() {
    let (chain, mut stream) = (chain("sawyer", "flange"), Stream::new(23, &[]));
    let arguments = ["--robot", "sawyer", "--frame", "flange", "--json"];
    for _ in 0..10 {
        let q = chain.sample(&mut stream);
        let request = json!({"targets": [target(&chain.tool_pose(&q))], "seed_positions": q});
        let found = numbers(&answers(&arguments, &request)[0]["joint_positions"]);
        assert!(found.iter().zip(&q).all(|(found, q)| (found - q).abs() < 1e-3), "{found:?}, seed {q:?}");
    }
    let request = json!({"targets": [target(&chain.tool_pose(&[0.3; 7]))], "seed_positions": [9, -9, 1e300, 0, 0, 0, 0]});
    check_reaches(&chain, &numbers(&answers(&arguments, &request)[0]["joint_positions"]), &chain.tool_pose(&[0.3; 7]));
}

#[test]
fn all_branches_reach_the_target_and_differ() {
    let (chain, mut stream) = (chain("panda", "tool"), Stream::new(24, &[]));
    let goal = chain.tool_pose(&chain.sample(&mut stream));
    let answer = &answers(&[&PANDA_TOOL[..], &["--all"]].concat(), &json!({"targets": [target(&goal)]}))[0];
    let branches: Vec<Vec<f64>> = answer["branches"].as_array().unwrap().iter().map(numbers).collect();
    assert!(branches.len() >= 2);
    for (index, q) in branches.iter().enumerate() {
        check_reaches(&chain, q, &goal);
        assert!(branches[..index].iter().all(|other| other.iter().zip(q).any(|(a, b)| (a - b).abs() > 0.01)));
    }
}

#[test]
fn targets_out_of_reach_fail_with_the_reason_and_the_nearest_miss() {
    let far = json!({"position": [2, 0, 0.5]});
    for position in [json!([2, 0, 0.5]), json!([0, 0, 1e300]), json!([f64::MAX, f64::MAX, f64::MAX])] {
        let answer = &answers(&PANDA_TOOL, &json!({"targets": [{"position": position}]}))[0];
        assert_eq!((&answer["success"], &answer["reason"]), (&json!(false), &json!("unreachable")), "{answer}");
        let limits = &chain("panda", "tool");
        assert!(limits.within_limits(&numbers(&answer["joint_positions"])));
        assert!(answer["position_error"].as_f64().unwrap() > 0.5 && answer["rotation_error"].is_number());
    }
    let all = &answers(&[&PANDA_TOOL[..], &["--all"]].concat(), &json!({"targets": [far]}))[0];
    assert_eq!(all["branches"], json!([]));
}

#[test]
fn people_get_a_table_and_no_target_no_answer() {
    let output = ik(
        &PANDA_TOOL[..4],
        r#"{"targets": [{"position": [0.4, 0, 0.4], "quaternion": [0, 1, 0, 0]}, {"position": [9, 9, 9]}]}"#,
    );
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(output.status.success() && lines.len() == 3, "{text}");
    assert!(
        lines[0].contains("joint positions (rad)") && lines[1].contains("solved") && lines[2].contains("unreachable"),
        "{text}"
    );
    assert_eq!(answers(&PANDA_TOOL, &json!({"targets": []})), Vec::<Value>::new());
}

#[test]
fn the_answer_is_written_beside_the_configuration_when_a_directory_is_given() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("run");
    let request = json!({"targets": [{"position": [0.4, 0, 0.4], "quaternion": [0, 1, 0, 0]}]});
    let printed = answers(&[&PANDA_TOOL[..], &["--out", out.to_str().unwrap()]].concat(), &request);
    let written: Vec<Value> = serde_json::from_slice(&std::fs::read(out.join("ik.json")).unwrap()).unwrap();
    assert_eq!(written, printed);
    assert!(out.join("config.toml").exists() && out.join("run.json").exists());
}

#[test]
fn bad_requests_are_refused_with_file_place_found_and_expected() {
    let refused = |request: &str, message: &str| check_refused(&PANDA_TOOL, request, message);
    refused("", "<stdin>: line 1, column 1: not JSON");
    refused("[]", "invalid type: sequence, expected an object");
    refused("{}", "missing field `targets`");
    refused(r#"{"targets": {}}"#, "targets (line 1, column 12): invalid type: map, expected a list of at most 100000 poses");
    refused(r#"{"targets": [[0, 0, 0]]}"#, "targets[0]");
    refused(r#"{"targets": [{"position": [0, 0]}]}"#, "targets[0].position");
    refused(r#"{"targets": [{"position": [0, 0, NaN]}]}"#, "NaN and Infinity are not JSON numbers");
    refused(r#"{"targets": [{"position": [0, 0, 1e999]}]}"#, "number out of range, expected a finite double");
    refused(r#"{"targets": [{}, {"quaternion": [0, 0, 0, 0]}]}"#, "targets[1].quaternion (line 1, column 33): a zero quaternion");
    refused(
        r#"{"targets": [{"orientation": [1, 0, 0, 0]}]}"#,
        "unknown field `orientation`, expected `position` or `quaternion`",
    );
    refused(r#"{"targets": [], "seed_positions": [0, 0]}"#, "seed_positions (line 1, column 35): 2 joint positions, expected 7");
    refused(r#"{"targets": [], "seed_positions": [0, 0, 0, 0, 0, 0, null]}"#, "seed_positions[6]");
    refused(r#"{"targets": [], "seeds": []}"#, "unknown field `seeds`");
    refused(&format!("{}{}", r#"{"targets": "#, "[".repeat(100_000)), "targets");
    let many = format!(r#"{{"targets": [{}{{}}]}}"#, "{},".repeat(100_000));
    refused(&many, "more than 100000 targets, the most of one request");
}

#[test]
fn robots_frames_and_files_that_do_not_exist_are_refused_with_what_exists() {
    let request = r#"{"targets": []}"#;
    let with = |robot, frame| ["--robot", robot, "--frame", frame, "--json"];
    check_refused(&with("pandda", "tool"), request, "the program has no robot `pandda`; robots are: panda, sawyer");
    check_refused(&with("panda", "hand"), request, "[possible values: flange, tool]");
    check_refused(&["--robot", "panda"], request, "--frame");
    let output = Command::new(env!("CARGO_BIN_EXE_vmao")).args(["ik", "no/such.json"]).args(PANDA_TOOL).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("no/such.json: cannot be read"));
}
