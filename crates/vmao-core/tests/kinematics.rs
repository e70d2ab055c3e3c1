//! Forward kinematics against the published hand poses, the Jacobian against differences, inverse against forward.

mod robots;

use nalgebra::Vector3;
use robots::{PANDA_HOME, SAWYER_NEUTRAL, panda, sawyer};
use vmao_core::{
    geometry::{Pose, interpolate, pose, rotation_distance, rotation_log, translation},
    inverse_kinematics::{IkOutcome, IkSettings, posture_cost, solutions, solve, solve_nearest, track},
    kinematics::SerialChain,
    random::Stream,
};

fn robots() -> [(&'static str, SerialChain); 2] {
    [("panda", panda()), ("sawyer", sawyer())]
}

fn gap(a: &Pose, b: &Pose) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), rotation_distance(&a.rotation, &b.rotation))
}

#[test]
fn hands_are_where_the_published_models_put_them() {
    use std::f64::consts::PI;
    let ready = [0.0, -PI / 4.0, 0.0, -3.0 * PI / 4.0, 0.0, PI / 2.0, PI / 4.0];
    let cases = [
        (panda(), PANDA_HOME, [0.5545, 0.0, 0.6245]),
        (panda(), ready, [0.3069, 0.0, 0.5903]),
        (panda(), [0.0, PI / 16.0, 0.0, -5.0 * PI / 6.0, 0.0, PI - 0.2, PI / 4.0], [0.445, 0.0, 0.195]),
        (sawyer(), SAWYER_NEUTRAL, [0.4496, 0.1603, 0.2158]),
    ];
    for (chain, q, position) in cases {
        let hand = chain.tool_pose(&q);
        assert!((hand.translation.vector - Vector3::from(position)).norm() < 1e-3, "{hand} instead of {position:?}");
    }
    let down = panda().tool_pose(&ready).rotation;
    assert!((down * Vector3::z() + Vector3::z()).norm() < 1e-6, "the hand points down");
    assert!((down * Vector3::x() - Vector3::x()).norm() < 1e-6, "the hand's x is the world's");
    let home = panda().tool_pose(&PANDA_HOME).rotation;
    assert!((home * Vector3::x() - Vector3::y()).norm() < 1e-3, "the hand's x is the world's y");
}

#[test]
fn the_jacobian_is_the_derivative_of_the_tool_pose() {
    for (name, mut chain) in robots() {
        chain.last_from_tool *= pose([0.02, -0.05, 0.1], [0.8, 0.1, -0.3, 0.5]);
        let mut stream = Stream::new(11, &[]);
        for _ in 0..20 {
            let q = chain.sample(&mut stream);
            let jacobian = chain.jacobian(&q);
            assert_eq!(jacobian.shape(), (6, 7));
            for column in 0..7 {
                let shifted = |by: f64| {
                    let mut q = q.clone();
                    q[column] += by;
                    chain.tool_pose(&q)
                };
                let (h, low, high) = (1e-6, shifted(-1e-6), shifted(1e-6));
                let linear = (high.translation.vector - low.translation.vector) / (2.0 * h);
                let angular = rotation_log(&(high.rotation * low.rotation.inverse())) / (2.0 * h);
                let difference = (jacobian.fixed_view::<3, 1>(0, column) - linear).norm()
                    + (jacobian.fixed_view::<3, 1>(3, column) - angular).norm();
                assert!(difference < 1e-7, "{name} column {column}: {difference}");
            }
        }
    }
}

#[test]
fn limits_hold_their_ends_and_clamping_returns_to_them() {
    let chain = panda();
    let upper: Vec<f64> = chain.joints.iter().map(|joint| joint.upper).collect();
    assert!(chain.within_limits(&upper) && !chain.within_limits(&upper[..6]));
    let beyond: Vec<f64> = upper.iter().map(|angle| angle + 0.1).collect();
    assert!(!chain.within_limits(&beyond));
    assert_eq!(chain.clamp(&beyond), upper);
}

#[test]
fn every_reachable_pose_is_solved_inside_the_limits() {
    for (name, chain) in robots() {
        let mut stream = Stream::new(5, &[]);
        for trial in 0..1000 {
            let goal = chain.tool_pose(&chain.sample(&mut stream));
            let seed = chain.sample(&mut stream);
            let outcome = solve(&chain, &goal, &seed, &IkSettings::default(), &mut stream);
            let Some(q) = outcome.solution() else { panic!("{name} {trial}: {outcome:?}") };
            let (distance, angle) = gap(&chain.tool_pose(q), &goal);
            assert!(chain.within_limits(q) && distance < 1e-5 && angle < 1e-5, "{name} {trial}: {distance} m, {angle} rad");
        }
    }
}

#[test]
fn a_pose_out_of_reach_has_no_solution_and_says_how_far_it_stayed_away() {
    let chain = panda();
    let far = translation(2.0, 0.0, 0.333);
    match solve(&chain, &far, &PANDA_HOME, &IkSettings::default(), &mut Stream::new(1, &[])) {
        IkOutcome::NoSolution { closest, position_error, .. } => {
            let distance = (chain.tool_pose(&closest).translation.vector - far.translation.vector).norm();
            assert!((distance - position_error).abs() < 1e-9 && distance > 1.0 && chain.within_limits(&closest));
        }
        IkOutcome::Solved { .. } => panic!("two metres away"),
    }
}

#[test]
fn the_same_stream_gives_the_same_solution() {
    let chain = sawyer();
    let goal = chain.tool_pose(&chain.sample(&mut Stream::new(2, &[])));
    let run = || solve(&chain, &goal, &SAWYER_NEUTRAL, &IkSettings::default(), &mut Stream::new(3, &[]));
    assert_eq!(run(), run());
}

#[test]
fn the_nearest_solution_beats_the_first_one_and_finds_the_seed_itself() {
    let settings = IkSettings::default();
    for (name, chain) in robots() {
        let mut stream = Stream::new(8, &[]);
        let (mut first, mut nearest) = (0.0, 0.0);
        for _ in 0..50 {
            let goal = chain.tool_pose(&chain.sample(&mut stream));
            let seed = chain.sample(&mut stream);
            let cost = |outcome: &IkOutcome| posture_cost(&chain, outcome.solution().expect("reachable"), &seed);
            let a = cost(&solve(&chain, &goal, &seed, &settings, &mut stream.clone()));
            let b = cost(&solve_nearest(&chain, &goal, &seed, 12, &settings, &mut stream));
            assert!(b <= a + 1e-9, "{name}: {b} is worse than {a}");
            first += a;
            nearest += b;
        }
        assert!(nearest < 0.8 * first, "{name}: {nearest} against {first}");
        let home = if name == "panda" { PANDA_HOME } else { SAWYER_NEUTRAL };
        let outcome = solve_nearest(&chain, &chain.tool_pose(&home), &home, 8, &settings, &mut stream);
        let q = outcome.solution().expect("reachable");
        assert!(posture_cost(&chain, q, &home) <= posture_cost(&chain, &home, &home) + 1e-9, "{name}");
    }
}

#[test]
fn a_line_and_a_turn_are_tracked_without_jumps() {
    let settings = IkSettings::default();
    for (name, chain, start) in [("panda", panda(), PANDA_HOME), ("sawyer", sawyer(), SAWYER_NEUTRAL)] {
        let from = chain.tool_pose(&start);
        let to = Pose::from_parts(
            (from.translation.vector + Vector3::new(0.0, 0.15, 0.1)).into(),
            pose([0.0; 3], [1.0, 0.0, 0.0, 0.5]).rotation * from.rotation,
        );
        let poses: Vec<Pose> = (1..=100).map(|i| interpolate(&from, &to, f64::from(i) / 100.0)).collect();
        let path = track(&chain, &poses, &start, 0.1, &settings).unwrap_or_else(|index| panic!("{name} lost at {index}"));
        let mut last = start.to_vec();
        for (q, pose) in path.iter().zip(&poses) {
            let (distance, angle) = gap(&chain.tool_pose(q), pose);
            let step = q.iter().zip(&last).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(distance < 1e-5 && angle < 1e-5 && step <= 0.1 && chain.within_limits(q), "{name}: {distance} {step}");
            last.clone_from(q);
        }
    }
}

#[test]
fn tracking_names_the_first_pose_out_of_reach() {
    let chain = panda();
    let from = chain.tool_pose(&PANDA_HOME);
    let poses: Vec<Pose> = (0..40).map(|i| translation(0.025 * f64::from(i), 0.0, 0.0) * from).collect();
    let index = track(&chain, &poses, &PANDA_HOME, 0.5, &IkSettings::default()).expect_err("a metre further out");
    assert!((2..20).contains(&index), "{index}");
}

#[test]
fn several_distinct_solutions_come_cheapest_first() {
    let settings = IkSettings::default();
    for (chain, home) in [(panda(), PANDA_HOME), (sawyer(), SAWYER_NEUTRAL)] {
        let goal = translation(0.0, 0.05, -0.05) * chain.tool_pose(&home);
        let all = solutions(&chain, &goal, &home, 24, &settings, &mut Stream::new(6, &[]));
        assert!(all.len() >= 2, "{}", all.len());
        let nearest = solve_nearest(&chain, &goal, &home, 24, &settings, &mut Stream::new(6, &[]));
        assert_eq!(nearest.solution(), Some(&all[0][..]));
        for (i, q) in all.iter().enumerate() {
            let (distance, angle) = gap(&chain.tool_pose(q), &goal);
            assert!(distance < 1e-5 && angle < 1e-5 && chain.within_limits(q));
            for later in &all[i + 1..] {
                assert!(posture_cost(&chain, q, &home) <= posture_cost(&chain, later, &home));
                assert!(q.iter().zip(later).any(|(a, b)| (a - b).abs() > 0.1));
            }
        }
        let out_of_reach = translation(5.0, 0.0, 0.0);
        assert!(solutions(&chain, &out_of_reach, &home, 4, &settings, &mut Stream::new(6, &[])).is_empty());
    }
}
