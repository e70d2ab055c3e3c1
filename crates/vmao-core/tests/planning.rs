//! Collision checks and plans, judged again by slow distances at a finer step.

mod robots;
mod slow;

use robots::{
    PANDA_HOME, panda_model,
    problems::{Problem, add_shelf, problem, ring},
};
use slow::slow_distance;
use vmao_core::{
    collision::{ArmCollisionModel, Collider, CollisionWorld, LinkSolid, Obstacle},
    geometry::{Pose, translation},
    planning::{PlanFailure, PlanOutcome, PlanSettings, first_collision, plan, time_path},
    random::Stream,
    shape::{Shape, Solid},
    time_parameterization::MotionLimits,
};

fn box_at(name: &str, half_extents: [f64; 3], place: Pose) -> Obstacle {
    let solid = Solid { shape: Shape::Box { half_extents }, carrier_from_solid: place, color: [0.5; 3] };
    Obstacle { name: name.to_owned(), solid }
}

/// Every solid in the world with (arm, link), obstacles as arm `usize::MAX`.
fn placed(world: &CollisionWorld, q: &[f64]) -> Vec<(usize, usize, (Shape, Pose))> {
    let mut all = Vec::new();
    for (index, (arm, own)) in world.arms.iter().zip(q.chunks(7)).enumerate() {
        let links = arm.chain.link_poses(own);
        for LinkSolid { link, solid } in &arm.solids {
            let base_from_link = if *link == 0 { Pose::identity() } else { links[(link - 1).min(6)] };
            all.push((index, *link, (solid.shape.clone(), arm.world_from_base * base_from_link * solid.carrier_from_solid)));
        }
    }
    all.extend(world.obstacles.iter().map(|o| (usize::MAX, 0, (o.solid.shape.clone(), o.solid.carrier_from_solid))));
    all
}

/// Whether the configuration is free of contact, by slow distances and the rules as documented.
fn slow_free(world: &CollisionWorld, q: &[f64]) -> bool {
    let solids = placed(world, q);
    let reach = |shape: &Shape| match *shape {
        Shape::Sphere { radius } => radius,
        Shape::Capsule { radius, half_length } | Shape::Cylinder { radius, half_length } => radius + half_length,
        Shape::Box { half_extents: [x, y, z] } => x + y + z,
        Shape::Convex(_) => f64::INFINITY,
    };
    for (i, (arm, link, a)) in solids.iter().enumerate() {
        if let (Some(floor), true) = (world.floor_height, *arm != usize::MAX && *link > 1) {
            let deep = (Shape::Box { half_extents: [10.0, 10.0, 10.0] }, translation(0.0, 0.0, floor - 10.0));
            if slow_distance(a, &deep) <= 1e-9 {
                return false;
            }
        }
        for (other, other_link, b) in &solids[i + 1..] {
            let (fixed, other_fixed) = (*link == 0, *other_link == 0); // an obstacle is fixed, too
            let excused = arm == other
                && (*arm == usize::MAX
                    || link.abs_diff(*other_link) < 2
                    || world.arms[*arm].ignored_links.contains(&(*link, *other_link)));
            let apart = (a.1.translation.vector - b.1.translation.vector).norm() > reach(&a.0) + reach(&b.0);
            if !(excused || apart || fixed && other_fixed) && slow_distance(a, b) <= 1e-9 {
                return false;
            }
        }
    }
    true
}

fn assert_valid(problem: &Problem, path: &[Vec<f64>], step: f64) {
    assert_eq!((&path[0], &path[path.len() - 1]), (&problem.start, &problem.goal));
    for edge in path.windows(2) {
        let turn = edge[0].iter().zip(&edge[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let count = (turn / step).ceil().max(1.0) as usize;
        for i in 0..=count {
            let t = i as f64 / count as f64;
            let q: Vec<f64> = edge[0].iter().zip(&edge[1]).map(|(a, b)| a + t * (b - a)).collect();
            assert!(problem.world.within_limits(&q), "outside the limits");
            assert!(slow_free(&problem.world, &q), "collides: {:?}", problem.world.check(&q, 0.0));
        }
    }
}

#[expect(clippy::panic, reason = "only tests call it")]
fn expect_path(outcome: PlanOutcome) -> Vec<Vec<f64>> {
    match outcome {
        PlanOutcome::Path(path) => path,
        PlanOutcome::Failed(failure) => panic!("{failure:?}"),
    }
}

#[test]
fn the_check_agrees_with_slow_distances_at_random_configurations() {
    let mut world = ring(2);
    add_shelf(&mut world);
    world.obstacles.pop(); // the cylinder is a prism here and exact there
    for arm in &mut world.arms {
        arm.solids.retain(|solid| !matches!(solid.solid.shape, Shape::Cylinder { .. }));
    }
    let mut stream = Stream::new(4, &[]);
    let mut free = 0;
    for trial in 0..400 {
        let q: Vec<f64> = world.arms.iter().flat_map(|arm| arm.chain.sample(&mut stream)).collect();
        let clearance = world.clearance(&q);
        if clearance.abs() < 2e-3 {
            continue; // within what the slow search resolves
        }
        assert_eq!(slow_free(&world, &q), clearance > 0.0, "{trial}: {clearance} {:?}", world.check(&q, 0.0));
        for margin in [0.0, 0.01, 0.1] {
            let hit = world.check(&q, margin);
            assert_eq!(hit.is_some(), clearance < margin, "{trial}: {clearance} {hit:?}");
            assert!(hit.is_none_or(|pair| pair.distance < margin && pair.distance >= clearance - 1e-9));
        }
        free += usize::from(clearance > 0.0);
    }
    assert!((20..380).contains(&free), "both outcomes occur, {free} free");
}

#[test]
fn homes_are_free_and_named_things_collide() {
    let mut world = ring(2);
    let home = [PANDA_HOME, PANDA_HOME].concat();
    let hit = world.check(&home, 0.0).expect("the hands meet in the middle");
    assert!(matches!((hit.first, hit.second), (Collider::Link { arm: 0, .. }, Collider::Link { arm: 1, .. })), "{hit}");
    world.arms[1].world_from_base = translation(0.0, 3.0, 0.0);
    assert_eq!(world.check(&home, 0.02), None);

    world.floor_height = Some(0.6);
    assert_eq!(world.check(&home, 0.0).expect("the floor is at the hands").second, Collider::Floor);
    world.floor_height = None;

    let tool = world.arms[0].world_from_base * world.arms[0].chain.tool_pose(&PANDA_HOME);
    world.obstacles.push(box_at("mug", [0.02, 0.02, 0.02], tool * translation(0.0, 0.0, -0.0534)));
    let hit = world.check(&home, 0.0).expect("the mug is in the palm");
    assert_eq!((hit.second, hit.names), (Collider::Obstacle(0), ["the hand of arm 0".to_owned(), "mug".to_owned()]));
    world.allowed.push((0, 0));
    assert_eq!(world.check(&home, 0.0), None, "the gripper may touch what it is to grasp");
    world.allowed = vec![(1, 0)];
    assert!(world.check(&home, 0.0).is_some(), "but not because the other may");
}

#[test]
fn what_is_held_collides_with_all_but_the_gripper_that_holds_it() {
    let mut world = CollisionWorld { arms: vec![panda_model(Pose::identity())], ..CollisionWorld::default() };
    let in_hand = world.arms[0].chain.last_from_tool * translation(0.0, 0.0, 0.1);
    let bar = Solid { shape: Shape::Box { half_extents: [0.02, 0.02, 0.1] }, carrier_from_solid: in_hand, color: [0.5; 3] };
    world.attached = vec![vec![bar]];
    assert_eq!(world.check(&PANDA_HOME, 0.0), None);
    world.obstacles.push(box_at("table", [0.1, 0.1, 0.05], translation(0.5545, 0.0, 0.4)));
    let hit = world.check(&PANDA_HOME, 0.0).expect("the bar reaches lower than the fingers");
    assert_eq!((hit.first, hit.second), (Collider::Held { arm: 0 }, Collider::Obstacle(0)));
    world.allowed.push((0, 0));
    assert_eq!(world.check(&PANDA_HOME, 0.0), None, "what is held may touch where the gripper may");
    world.allowed.clear();
    world.attached.clear();
    assert_eq!(world.check(&PANDA_HOME, 0.0), None, "without the bar");
}

#[test]
fn what_two_arms_hold_can_collide() {
    let mut world = ring(2);
    for arm in &mut world.arms {
        let back = arm.world_from_base.rotation * nalgebra::Vector3::new(-0.15, 0.0, 0.0);
        arm.world_from_base.translation.vector += back;
    }
    let home = [PANDA_HOME, PANDA_HOME].concat();
    let in_hand = world.arms[0].chain.last_from_tool * translation(0.0, 0.0, 0.1);
    let bar = |half: f64| {
        let shape = Shape::Box { half_extents: [half, half, 0.02] };
        vec![Solid { shape, carrier_from_solid: in_hand, color: [0.5; 3] }]
    };
    world.attached = vec![bar(0.1), bar(0.1)];
    assert_eq!(world.check(&home, 0.0), None, "0.29 m between the tools, 0.1 m to each side");
    world.attached = vec![bar(0.16), bar(0.16)];
    let hit = world.check(&home, 0.0).expect("0.16 m to each side");
    assert_eq!((hit.first, hit.second), (Collider::Held { arm: 0 }, Collider::Held { arm: 1 }));
    assert!((hit.distance - (2.0 * (0.7 - 0.5545) - 0.32)).abs() < 1e-3, "{hit}");
}

#[test]
fn a_free_straight_line_is_the_plan() {
    let world =
        CollisionWorld { arms: vec![panda_model(Pose::identity())], floor_height: Some(0.0), ..CollisionWorld::default() };
    let mut goal = PANDA_HOME.to_vec();
    goal[0] = 1.0;
    let path = expect_path(plan(&world, &PANDA_HOME, &goal, &PlanSettings::default(), &mut Stream::new(1, &[])));
    assert_eq!(path, [PANDA_HOME.to_vec(), goal]);
}

#[test]
fn hopeless_requests_say_why() {
    let mut world =
        CollisionWorld { arms: vec![panda_model(Pose::identity())], floor_height: Some(0.0), ..CollisionWorld::default() };
    let settings = PlanSettings { max_iterations: 50, ..PlanSettings::default() };
    let attempt =
        |world: &CollisionWorld, start: &[f64], goal: &[f64]| match plan(world, start, goal, &settings, &mut Stream::new(1, &[]))
        {
            PlanOutcome::Failed(failure) => failure,
            PlanOutcome::Path(path) => panic!("{path:?}"),
        };
    let mut low = PANDA_HOME.to_vec();
    low[1] = 1.7;
    assert!(matches!(attempt(&world, &PANDA_HOME, &low), PlanFailure::GoalInCollision(pair) if pair.second == Collider::Floor));
    assert!(matches!(attempt(&world, &low, &PANDA_HOME), PlanFailure::StartInCollision(pair) if pair.second == Collider::Floor));
    low[1] = 1.8;
    assert!(matches!(attempt(&world, &PANDA_HOME, &low), PlanFailure::OutOfLimits { at_goal: true, arm: 0, joint: 1, .. }));
    assert!(matches!(attempt(&world, &low, &PANDA_HOME), PlanFailure::OutOfLimits { at_goal: false, arm: 0, joint: 1, .. }));
    // walls on both sides and a roof: the arm cannot turn round within so few samples, if at all
    for side in [-1.0, 1.0] {
        world.obstacles.push(box_at("wall", [1.5, 0.02, 1.0], translation(0.0, side * 0.3, 0.5)));
    }
    world.obstacles.push(box_at("roof", [1.5, 1.5, 0.02], translation(0.0, 0.0, 0.87)));
    let mut round = PANDA_HOME.to_vec();
    round[0] = 2.8973;
    assert_eq!(attempt(&world, &PANDA_HOME, &round), PlanFailure::BudgetExhausted);
}

#[test]
fn two_arms_that_block_each_other_change_places() {
    let mut solved = 0;
    for seed in 0..12 {
        let problem = problem(ring(2), seed);
        let run = || plan(&problem.world, &problem.start, &problem.goal, &PlanSettings::default(), &mut Stream::new(seed, &[]));
        let path = expect_path(run());
        assert_eq!(PlanOutcome::Path(path.clone()), run(), "the same stream gives the same path");
        assert_valid(&problem, &path, 0.02);
        solved += usize::from(path.len() > 2);
    }
    assert!(solved >= 6, "most of these need more than a straight line, {solved} did");
}

#[test]
fn arms_reach_around_a_shelf_and_the_timed_path_stays_free() {
    for seed in 0..6 {
        let mut world = ring(1 + seed as usize % 2);
        add_shelf(&mut world);
        let problem = problem(world, seed);
        let settings = PlanSettings::default();
        let path = expect_path(plan(&problem.world, &problem.start, &problem.goal, &settings, &mut Stream::new(seed, &[])));
        assert_valid(&problem, &path, 0.02);
        let arms = problem.world.arms.len();
        let limits = MotionLimits { velocity: vec![2.1; 7 * arms], acceleration: vec![7.0; 7 * arms] };
        let timed = time_path(&problem.world, &path, &limits, &settings).expect("some corner cut is free");
        for i in 0..=400 {
            let q = timed.at(timed.duration() * f64::from(i) / 400.0).0;
            assert!(slow_free(&problem.world, &q), "collides on the way: {:?}", problem.world.check(&q, 0.0));
        }
    }
}

#[test]
fn a_frozen_arm_stays_is_avoided_and_keeps_its_contacts() {
    let settings = PlanSettings { frozen_arms: vec![1], ..PlanSettings::default() };
    let mut bent = 0;
    for seed in 0..20 {
        let Problem { mut world, start, goal } = problem(ring(2), seed);
        let frozen_goal: Vec<f64> = goal[..7].iter().chain(&start[7..]).copied().collect();
        if world.check(&frozen_goal, settings.margin).is_some() {
            continue;
        }
        // the resting arm touches something; that is none of the moving arm's business
        let tool = world.arms[1].world_from_base * world.arms[1].chain.tool_pose(&start[7..]);
        world.obstacles.push(box_at("handle", [0.005; 3], tool * translation(0.0, 0.0, -0.0734)));
        assert!(world.check(&start, 0.0).is_some());
        let path = expect_path(plan(&world, &start, &goal, &settings, &mut Stream::new(seed, &[])));
        assert!(path.iter().all(|q| q[7..] == start[7..]));
        world.obstacles.clear();
        bent += usize::from(path.len() > 2);
        assert_valid(&Problem { world, start, goal: frozen_goal }, &path, 0.02);
    }
    assert!(bent > 0, "some had to go round the resting arm");
}

#[test]
fn the_first_collision_of_a_path_is_named() {
    let mut world =
        CollisionWorld { arms: vec![panda_model(Pose::identity())], floor_height: Some(0.0), ..CollisionWorld::default() };
    let settings = PlanSettings::default();
    let turned = |angle: f64| [angle].iter().chain(&PANDA_HOME[1..]).copied().collect::<Vec<f64>>();
    let path = [turned(0.0), turned(1.0), turned(2.0)];
    assert_eq!(first_collision(&world, &path, &settings), None);
    let (sine, cosine) = 1.5_f64.sin_cos();
    world.obstacles.push(box_at("lamp", [0.01, 0.01, 1.0], translation(0.55 * cosine, 0.55 * sine, 1.0)));
    let (edge, pair) = first_collision(&world, &path, &settings).expect("the lamp is in the way");
    assert_eq!((edge, pair.second), (1, Collider::Obstacle(0)));
    assert_eq!(first_collision(&world, &path[1..], &settings).expect("still").0, 0);
    assert_eq!(first_collision(&world, &path[..2], &settings), None);
    assert!(first_collision(&world, &[turned(1.5)], &settings).is_some());
}

#[test]
fn an_arm_without_solids_never_collides() {
    let bare = ArmCollisionModel { solids: Vec::new(), ..panda_model(Pose::identity()) };
    let world = CollisionWorld { arms: vec![bare.clone(), bare], floor_height: Some(5.0), ..CollisionWorld::default() };
    assert_eq!(world.clearance(&[PANDA_HOME, PANDA_HOME].concat()), f64::INFINITY);
}
