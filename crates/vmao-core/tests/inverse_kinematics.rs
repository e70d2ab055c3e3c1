//! Inverse kinematics against forward kinematics: solutions, the nearest, all branches, proofs, tracking.

mod robots;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use robots::{PANDA_HOME, SAWYER_NEUTRAL, panda, sawyer};
use vmao_core::{
    geometry::{Pose, interpolate, pose, rotation_distance, translation},
    inverse_kinematics::{IkOutcome, IkSettings, InverseKinematics, posture_cost, solutions, track},
    kinematics::SerialChain,
    random::Stream,
};

fn arms() -> [(&'static str, InverseKinematics, [f64; 7]); 2] {
    let prepared = |chain| InverseKinematics::new(chain, &IkSettings::default());
    [("panda", prepared(panda()), PANDA_HOME), ("sawyer", prepared(sawyer()), SAWYER_NEUTRAL)]
}

fn gap(a: &Pose, b: &Pose) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), rotation_distance(&a.rotation, &b.rotation))
}

/// The angles reach the pose inside the limits.
#[track_caller]
fn check_solves(chain: &SerialChain, q: &[f64], goal: &Pose) {
    let (distance, angle) = gap(&chain.tool_pose(q), goal);
    assert!(chain.within_limits(q) && distance < 1e-5 && angle < 1e-5, "{distance} m, {angle} rad, {q:?}");
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn every_reachable_pose_is_solved_inside_the_limits_and_none_is_called_unreachable() {
    for (name, arm, _) in arms() {
        let (chain, mut stream) = (arm.chain(), Stream::new(5, &[]));
        for trial in 0..20_000 {
            let goal = chain.tool_pose(&chain.sample(&mut stream));
            let outcome = arm.solve(&goal, &chain.sample(&mut stream));
            let Some(q) = outcome.solution() else { panic!("{name} {trial}: {outcome:?}") };
            check_solves(chain, q, &goal);
        }
    }
}
#[test]
fn a_pose_out_of_reach_is_proven_so_and_says_how_far_the_arm_stayed_away() {
    for (name, arm, home) in arms() {
        // further than any length, with the wrist out of reach, at the base, and not a place at all
        let up = arm.chain().tool_pose(&home).rotation;
        for far in [
            translation(2.0, 0.0, 0.333),
            Pose::from_parts(Vector3::new(0.0, 1.1, 0.9).into(), up),
            translation(1e200, -1e300, 0.0),
        ] {
            let outcome = arm.solve(&far, &home);
            let IkOutcome::Unreachable { closest, position_error, .. } = outcome else { panic!("{name}: {outcome:?}") };
            let [x, y, z] = (arm.chain().tool_pose(&closest).translation.vector - far.translation.vector).into();
            assert!((x.hypot(y).hypot(z) / position_error - 1.0).abs() < 1e-9 && arm.chain().within_limits(&closest), "{name}");
            assert!(arm.branches(&far, &home).is_empty());
            assert!(matches!(arm.nearest(&far, &home), IkOutcome::Unreachable { .. }));
        }
    }
}

#[test]
fn targets_and_seeds_that_are_no_numbers_end_without_a_solution_and_without_a_panic() {
    let turn = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    for (name, arm, home) in arms() {
        for bad in [
            translation(f64::NAN, 0.0, 0.0),
            translation(0.0, f64::NEG_INFINITY, 0.0),
            Pose::from_parts(Vector3::zeros().into(), turn),
        ] {
            let outcome = arm.solve(&bad, &home);
            let IkOutcome::Unreachable { closest, position_error, rotation_error } = outcome else {
                panic!("{name}: {outcome:?}")
            };
            assert!(arm.chain().within_limits(&closest) && position_error.is_finite() && rotation_error.is_finite());
            assert!(arm.branches(&bad, &home).is_empty());
            assert!(solutions(arm.chain(), &bad, &home, 2, &IkSettings::default(), &mut Stream::new(1, &[])).is_empty());
            assert_eq!(track(arm.chain(), &[bad], &home, 0.5, &IkSettings::default()), Err(0));
        }
        let goal = arm.chain().tool_pose(&home);
        for seed in [[f64::NAN; 7], [f64::INFINITY; 7], [-1e300; 7]] {
            for outcome in [arm.solve(&goal, &seed), arm.nearest(&goal, &seed)] {
                check_solves(arm.chain(), outcome.solution().unwrap_or_else(|| panic!("{name}: {outcome:?}")), &goal);
            }
        }
    }
}

#[test]
fn the_nearest_solution_beats_the_first_one_and_every_one_of_a_search_and_finds_the_seed_itself() {
    for (name, arm, home) in arms() {
        let (chain, mut stream) = (arm.chain(), Stream::new(8, &[]));
        for _ in 0..40 {
            let goal = chain.tool_pose(&chain.sample(&mut stream));
            let seed = chain.sample(&mut stream);
            let outcome = arm.nearest(&goal, &seed);
            let nearest = outcome.solution().expect("reachable");
            check_solves(chain, nearest, &goal);
            let first = arm.solve(&goal, &seed);
            let found = solutions(chain, &goal, &seed, 30, &IkSettings::default(), &mut stream);
            for other in found.iter().map(Vec::as_slice).chain(first.solution()) {
                let (a, b) = (apart(nearest, &seed), apart(other, &seed));
                assert!(a <= b + 1e-3, "{name}: {a} rad away, another only {b}");
            }
        }
        let outcome = arm.nearest(&chain.tool_pose(&home), &home);
        assert!(apart(outcome.solution().expect("reachable"), &home) < 1e-4, "{name}");
    }
}

/// Solutions that a search from many random starts finds.
fn searched(chain: &SerialChain, goal: &Pose, starts: usize, stream: &mut Stream) -> Vec<Vec<f64>> {
    let found = |_| track(chain, &[*goal], &chain.sample(stream), 10.0, &IkSettings::default()).ok();
    (0..starts).filter_map(found).flatten().collect()
}

#[test]
fn branches_are_connected_solutions_and_hold_what_a_long_search_finds() {
    for (name, arm, home) in arms() {
        let (chain, mut stream) = (arm.chain(), Stream::new(10, &[]));
        let (mut branches_found, mut outside, mut all) = (0, 0, 0);
        for _ in 0..30 {
            let goal = chain.tool_pose(&chain.sample(&mut stream));
            let branches = arm.branches(&goal, &home);
            branches_found += branches.len();
            let mut last = 0.0;
            for branch in &branches {
                check_solves(chain, &branch.joint_positions, &goal);
                assert!(apart(&branch.joint_positions, &home) >= last, "{name}: not the nearest first");
                last = apart(&branch.joint_positions, &home);
                branch.path.iter().for_each(|q| check_solves(chain, q, &goal));
                assert!(branch.path.windows(2).all(|pair| apart(&pair[0], &pair[1]) < 0.15), "{name}: a path jumps");
                let ends = (&branch.path[0], &branch.path[branch.path.len() - 1]);
                assert!(!branch.closed || apart(ends.0, ends.1) < 0.15, "{name}: a closed path is open");
                let nearest = branch.path.iter().map(|q| apart(q, &home)).fold(f64::INFINITY, f64::min);
                assert!(last < nearest + 1e-4, "{name}: {last} from home, the path comes to {nearest}");
                for other in branches.iter().filter(|other| !std::ptr::eq(*other, branch)) {
                    let meets = |q: &Vec<f64>| other.path.iter().any(|p| apart(p, q) < 1e-3);
                    assert!(!branch.path.iter().any(meets), "{name}: two branches are one");
                }
            }
            for q in searched(chain, &goal, 300, &mut stream) {
                all += 1;
                outside += usize::from(!branches.iter().any(|branch| branch.path.iter().any(|p| apart(p, &q) < 0.08)));
            }
        }
        // a curve with few starts that lead to it can be missed: 1 in 300 branches here
        assert!(all > 3000 && outside * 200 <= all, "{name}: {outside} of {all} solutions on no branch");
        assert!(branches_found > 100, "{name}: {branches_found}");
    }
}

#[test]
fn a_joint_that_turns_further_than_once_gives_branches_whole_turns_apart() {
    let arm = InverseKinematics::new(sawyer(), &IkSettings::default());
    let goal = arm.chain().tool_pose(&SAWYER_NEUTRAL);
    let mut other = SAWYER_NEUTRAL;
    other[6] -= std::f64::consts::TAU;
    for seed in [SAWYER_NEUTRAL, other] {
        let found = &arm.branches(&goal, &seed)[0];
        assert!(apart(&found.joint_positions, &seed) < 1e-4, "{found:?}");
    }
}

#[test]
fn chains_of_other_lengths_are_solved_and_have_isolated_branches() {
    for count in [1, 2, 3, 4, 5, 6, 8] {
        let mut chain = panda();
        let extra = chain.joints[1];
        chain.joints.resize(count, extra);
        let arm = InverseKinematics::new(chain.clone(), &IkSettings::default());
        let mut stream = Stream::new(11, &[count as u64]);
        for trial in 0..50 {
            let goal = chain.tool_pose(&chain.sample(&mut stream));
            let seed = chain.sample(&mut stream);
            let outcome = arm.solve(&goal, &seed);
            check_solves(&chain, outcome.solution().unwrap_or_else(|| panic!("{count} joints, {trial}: {outcome:?}")), &goal);
            let branches = arm.branches(&goal, &seed);
            assert!(!branches.is_empty() && branches.iter().all(|branch| branch.path.len() == 1), "{count} joints");
            branches.iter().for_each(|branch| check_solves(&chain, &branch.joint_positions, &goal));
        }
    }
}

#[test]
fn a_batch_answers_each_target_as_if_it_were_alone_in_any_order() {
    for (_, arm, home) in arms() {
        let mut stream = Stream::new(9, &[]);
        let mut goals: Vec<Pose> = (0..50).map(|_| arm.chain().tool_pose(&arm.chain().sample(&mut stream))).collect();
        goals.push(translation(0.4, 0.0, 5.0));
        let together = arm.solve_batch(&goals, &home);
        assert_eq!(together, goals.iter().map(|goal| arm.solve(goal, &home)).collect::<Vec<_>>());
        goals.reverse();
        let mut backwards = arm.solve_batch(&goals[..20], &home);
        backwards.reverse();
        assert_eq!(backwards, together[31..]);
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
