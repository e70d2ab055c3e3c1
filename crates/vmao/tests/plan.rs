//! `vmao plan` through the real binary: paths, reasons, and every refusal with its place.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod program;

use serde_json::{Value, json};
use std::process::Output;
use vmao_core::robots::RobotModel;

const HOME: [f64; 7] = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785];

fn run(request: impl AsRef<[u8]>, options: &[&str]) -> Output {
    program::run("plan", options, request)
}

fn answer(request: &Value) -> Value {
    program::answer(&run(request.to_string(), &["--json"]))
}

#[track_caller]
fn check_refused(request: impl AsRef<[u8]>, message: &str) {
    assert_eq!(program::check_refusal(run(request, &["--json"]), message).lines().count(), 1);
}

/// A quarter turn to the right, and back again for the second arm if there is one.
fn turned(angle: f64) -> Vec<f64> {
    [angle].into_iter().chain(HOME[1..].iter().copied()).collect()
}

fn one_arm(obstacles: &Value) -> Value {
    json!({"arms": [{"robot": "panda", "base": {}, "start": turned(0.8), "goal": turned(-0.8)}], "obstacles": obstacles})
}

fn post() -> Value {
    json!({"type": "box", "pose": {"position": [0.36, 0, 0.5]}, "half_extents": [0.03, 0.03, 0.5]})
}

fn waypoints(answer: &Value) -> Vec<Vec<f64>> {
    serde_json::from_value(answer["path"].clone()).unwrap()
}

/// The request with the value at `pointer` replaced or added.
fn with(mut request: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = request.pointer_mut(parent).unwrap();
    match parent {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        other => other[key] = value,
    }
    request
}

#[test]
fn a_free_way_is_a_straight_line() {
    let answer = answer(&one_arm(&json!([])));
    assert_eq!(answer["success"], true);
    assert_eq!(waypoints(&answer), [turned(0.8), turned(-0.8)]);
    assert!(answer.get("reason").is_none() && answer["duration"].as_f64().unwrap() > 0.5);
}

#[test]
fn a_post_is_gone_round_from_the_same_seed_the_same_way() {
    let request = one_arm(&json!([post()]));
    let first = answer(&request);
    let path = waypoints(&first);
    assert_eq!((&path[0], &path[path.len() - 1]), (&turned(0.8), &turned(-0.8)));
    assert!(path.len() > 2 && path.iter().all(|q| q.len() == 7));
    assert_eq!(first, answer(&request));
    let words = run(request.to_string(), &[]);
    assert!(words.status.success());
    let text = String::from_utf8(words.stdout).unwrap();
    assert!(text.starts_with("a path of ") && text.lines().count() == 1, "{text}");
}

#[test]
fn robots_of_both_kinds_share_one_path_within_their_limits() {
    let sawyer = RobotModel::named("sawyer").unwrap();
    let mut goal = sawyer.home.clone();
    goal[0] = 0.6;
    let request = json!({
        "arms": [{"robot": "panda", "base": {"position": [0, -0.6, 0]}, "start": turned(0.8), "goal": turned(-0.8), "opening": 0.02},
                 {"robot": "sawyer", "base": {"position": [0, 0.9, 0]}, "start": sawyer.home, "goal": goal}],
        "obstacles": [post()], "floor": -0.01, "margin": 0.003, "time_step": 0.01,
    });
    let answer = answer(&request);
    assert_eq!((&answer["success"], &answer["margin"]), (&json!(true), &json!(0.003)));
    assert!(waypoints(&answer).iter().all(|q| q.len() == 14));
    let of = |key: &str| serde_json::from_value::<Vec<Vec<f64>>>(answer["trajectory"][key].clone()).unwrap();
    let times: Vec<f64> = serde_json::from_value(answer["trajectory"]["times"].clone()).unwrap();
    let (positions, velocities) = (of("positions"), of("velocities"));
    assert_eq!((times[0], times[times.len() - 1]), (0.0, answer["duration"].as_f64().unwrap()));
    assert_eq!((positions.len(), velocities.len()), (times.len(), times.len()));
    assert_eq!(positions[0], waypoints(&answer)[0]);
    let robots = [RobotModel::named("panda").unwrap(), sawyer];
    let limits: Vec<f64> = robots.iter().flat_map(|robot| &robot.joints).map(|joint| joint.max_velocity).collect();
    assert!(velocities.iter().flat_map(|v| v.iter().zip(&limits)).all(|(v, limit)| v.abs() <= limit + 1e-9));
    let fastest = velocities.iter().flat_map(|v| v.iter().zip(&limits)).map(|(v, limit)| v.abs() / limit).fold(0.0, f64::max);
    assert!(fastest > 0.5, "some joint is near its limit, {fastest}");
}

#[test]
fn what_has_no_path_says_why_and_is_still_an_answer() {
    let reason = |request: &Value| {
        let answer = answer(request);
        assert_eq!((&answer["success"], &answer["path"]), (&json!(false), &json!([])));
        answer["reason"].as_str().unwrap().to_owned()
    };
    let hand = json!({"type": "sphere", "pose": {"position": [0.214, -0.22, 0.5]}, "radius": 0.05});
    let blocked = reason(&one_arm(&json!([post(), hand])));
    assert!(blocked.starts_with("at the end, ") && blocked.contains("of arm 0 and obstacles[1] are"), "{blocked}");
    let beyond = reason(&with(one_arm(&json!([])), "/arms/0/start/1", json!(1.9)));
    assert!(beyond.contains("at the start, joint 2 of arm 0 is at 1.9 rad, outside its limits [-1.7628, 1.7628]"), "{beyond}");
    let low = reason(&with(one_arm(&json!([])), "/floor", json!(0.5)));
    assert!(low.contains("and the floor are"), "{low}");
    let near = with(one_arm(&json!([])), "/margin", json!(0.3));
    assert!(reason(&near).contains(" are 0."), "apart, but nearer than asked for");
}

#[test]
fn a_start_a_hair_outside_its_limits_starts_at_the_limit() {
    let answer = answer(&with(one_arm(&json!([])), "/arms/0/start/0", json!(2.8983)));
    assert_eq!(answer["path"][0][0], 2.8973);
    let answer = answer_success(&with(one_arm(&json!([])), "/arms/0/goal/0", json!(2.8983)));
    assert!(!answer, "a goal must be inside");
}

fn answer_success(request: &Value) -> bool {
    answer(request)["success"].as_bool().unwrap()
}

#[test]
fn ends_closer_than_the_usual_margin_lower_it_and_are_no_failure() {
    // 1.9 cm of air between the finger tips of the home pose and the floor, then a millimetre
    let mut height = [0.0, 1.0];
    for _ in 0..40 {
        let middle = f64::midpoint(height[0], height[1]);
        height[usize::from(!answer_success(&with(one_arm(&json!([])), "/floor", json!(middle))))] = middle;
    }
    let close = answer(&with(one_arm(&json!([])), "/floor", json!(height[0] - 0.001)));
    assert_eq!(close["success"], true);
    assert!((close["margin"].as_f64().unwrap() - 0.0009).abs() < 1e-6, "{}", close["margin"]);
}

#[test]
fn requests_that_make_no_sense_are_refused_with_their_place() {
    let good = || one_arm(&json!([post()]));
    check_refused("{", "(line 1, column 1): not JSON: EOF");
    check_refused("[]", "expected an object");
    check_refused(json!({"arms": []}).to_string(), "arms (line 1, column 9): 0 arms, expected 1 to 6");
    let arm = good()["arms"][0].clone();
    check_refused(json!({"arms": vec![arm; 7]}).to_string(), "7 arms, expected 1 to 6");
    for (pointer, value, message) in [
        ("/arms/0/robot", json!("pnda"), "arms[0].robot (line 1, column "),
        ("/arms/0/robot", json!("pnda"), "the program has no robot `pnda`; robots are: panda, sawyer"),
        ("/arms/0/goal", json!([0, 0]), "arms[0].goal (line 1, column "),
        ("/arms/0/goal", json!([0, 0]), "2 angles, expected 7: one for each joint of panda"),
        ("/arms/0/goal/3", json!("a"), "invalid type: string"),
        ("/arms/0/base", json!({"quaternion": [0, 0, 0, 0]}), "a zero quaternion"),
        ("/arms/0/base", json!({"position": [0, 0, 1e9]}), "1000000000 m, expected within 100 m of the origin"),
        ("/arms/0/opening", json!(0.2), "0.2 m, expected 0 to 0.08 m"),
        ("/arms/0/speed", json!(1), "unknown field `speed`"),
        ("/obstacles/0/type", json!("cone"), "`cone`, expected one of: box, sphere, cylinder, capsule"),
        ("/obstacles/0/type", json!("sphere"), "a sphere has no half_extents"),
        ("/obstacles/0/half_extents", json!(null), "obstacles[0] (line 1"),
        ("/obstacles/0/half_extents", json!([1, 0, 1]), "0 m, expected more than 0"),
        ("/obstacles/0/half_extents", json!([1, -1, 1]), "-1 m, expected more than 0"),
        ("/obstacles/0/pose", json!([0, 0, 0]), "expected an object"),
        ("/margin", json!(-0.1), "margin (line 1, column "),
        ("/floor", json!(1e300), "expected within 100 m"),
        ("/time_step", json!(0.0), "0 s, expected 0.001 to 10 s"),
    ] {
        check_refused(with(good(), pointer, value).to_string(), message);
    }
    check_refused(with(good(), "/obstacles", json!(vec![post(); 1001])).to_string(), "1001 obstacles, expected at most 1000");
    check_refused(good().to_string().replace("0.8,", "NaN,"), "not JSON");
}
