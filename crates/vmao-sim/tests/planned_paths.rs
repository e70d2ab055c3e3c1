//! Paths of the planning problem sets, judged by MuJoCo's collision detection, and their timing by finite differences.

mod support;

use vmao_core::{
    planning::{PlanOutcome, PlanSettings, plan, time_path},
    planning_problems::{Family, PlanningProblem},
    random::Stream,
    robots::RobotModel,
    time_parameterization::MotionLimits,
};
use vmao_sim::CollisionJudge;

const STEP: f64 = 0.01; // rad

fn judge(problem: &PlanningProblem) -> CollisionJudge {
    let openings: Vec<f64> = problem.robots.iter().map(|robot| robot.gripper.max_opening()).collect();
    let (scene, _) = support::configuration();
    CollisionJudge::new(&scene, &problem.robots, &problem.world_from_bases, &openings, &problem.obstacles)
        .expect("the simulator takes the model")
}

fn robots(names: &str) -> Vec<RobotModel> {
    names.split(',').map(|name| RobotModel::named(name).expect("a known robot")).collect()
}

/// Speeds and accelerations of the timed path stay within the limits, measured from its positions alone.
fn check_limits(problem: &PlanningProblem, path: &[Vec<f64>], judge: &mut CollisionJudge) {
    const PERIOD: f64 = 0.002;
    let limits = MotionLimits::of(&problem.robots);
    let timed = time_path(&problem.world(), path, &limits, &PlanSettings::default()).expect("some corner cut is free");
    let count = (timed.duration() / PERIOD).ceil() as usize;
    let samples: Vec<Vec<f64>> = (0..=count + 1).map(|i| timed.at(i as f64 * PERIOD).0).collect();
    for three in samples.windows(3) {
        for joint in 0..three[0].len() {
            let velocity = (three[2][joint] - three[0][joint]) / (2.0 * PERIOD);
            let acceleration = (three[2][joint] - 2.0 * three[1][joint] + three[0][joint]) / (PERIOD * PERIOD);
            assert!(velocity.abs() <= limits.velocity[joint] * (1.0 + 1e-6), "joint {joint}: {velocity} rad/s");
            assert!(acceleration.abs() <= limits.acceleration[joint] * (1.0 + 1e-4), "joint {joint}: {acceleration} rad/s²");
        }
    }
    for q in samples.iter().step_by(5) {
        assert_eq!(judge.overlap(q), None, "where a corner is cut");
    }
}

/// Problems solved and problems tried.
fn run(family: Family, names: &str, indices: std::ops::Range<u64>) -> (usize, usize) {
    let robots = robots(names);
    let tried = indices.end - indices.start;
    let mut solved = 0;
    for index in indices {
        let problem = PlanningProblem::new(family, &robots, index);
        let mut judge = judge(&problem);
        assert_eq!(judge.first_overlap(&problem.witness, STEP), None, "the witness of problem {index} of {names}");
        let outcome =
            plan(&problem.world(), &problem.start, &problem.goal, &PlanSettings::default(), &mut Stream::new(index, &[]));
        let PlanOutcome::Path(path) = outcome else { continue };
        assert_eq!((&path[0], &path[path.len() - 1]), (&problem.start, &problem.goal));
        assert!(path.iter().all(|q| problem.world().within_limits(q)));
        assert_eq!(judge.first_overlap(&path, STEP), None, "problem {index} of {names}");
        check_limits(&problem, &path, &mut judge);
        solved += 1;
    }
    (solved, tried as usize)
}

#[test]
fn paths_into_shelves_are_free_and_within_the_limits() {
    let sets = [("panda", 0..40), ("panda,panda", 0..20), ("sawyer", 0..20), ("panda,sawyer", 0..10)];
    let (solved, tried) = sets.into_iter().map(|(names, indices)| run(Family::Shelf, names, indices)).fold((0, 0), add);
    assert_eq!(solved, tried, "every one of these was solved when they were chosen, and nothing in them is random");
}

#[test]
fn paths_of_arms_that_cross_are_free_and_within_the_limits() {
    let sets = [("panda", 0..40), ("panda,panda", 0..40), ("panda,panda,panda", 0..12), ("sawyer,sawyer", 0..12)];
    let (solved, tried) = sets.into_iter().map(|(names, indices)| run(Family::Crossed, names, indices)).fold((0, 0), add);
    assert_eq!(solved, tried, "every one of these was solved when they were chosen, and nothing in them is random");
}

fn add(a: (usize, usize), b: (usize, usize)) -> (usize, usize) {
    (a.0 + b.0, a.1 + b.1)
}

#[test]
fn judge_and_planner_agree_on_random_configurations() {
    for (names, family) in [("panda,panda", Family::Shelf), ("sawyer,panda", Family::Crossed)] {
        let problem = PlanningProblem::new(family, &robots(names), 1);
        let (mut judge, world) = (judge(&problem), problem.world());
        let mut stream = Stream::new(8, &[]);
        let (mut overlapping, mut free) = (0, 0);
        for _ in 0..1500 {
            let q: Vec<f64> = world.arms.iter().flat_map(|arm| arm.chain.sample(&mut stream)).collect();
            let (theirs, ours) = (judge.overlap(&q), world.clearance(&q));
            let theirs_overlap = theirs.is_some();
            // Cylinders are prisms here, up to 3.5 % of their radius larger. Where a capsule's axis passes right through a
            // thin box MuJoCo finds nothing; no path gets there without being found on its way in.
            const THROUGH: f64 = 0.05; // m, the table's half thickness
            let doubtful = if names.contains("sawyer") { 0.004 } else { 1e-6 };
            match theirs {
                Some(overlap) => assert!(ours < 1e-6, "{overlap:?}, but {ours} m clear by our measure"),
                None => assert!(ours > -doubtful || ours < -THROUGH, "nothing overlaps at {q:?}, but {:?}", world.check(&q, 0.0)),
            }
            (overlapping, free) = (overlapping + usize::from(theirs_overlap), free + usize::from(ours > 0.0));
        }
        assert!(overlapping > 300 && free > 300, "{overlapping} overlapping, {free} free");
    }
}
