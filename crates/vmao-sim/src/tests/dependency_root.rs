//! The dependency root: it changes the way, never the goal; whom `auto` chooses; in which order parts are grasped from it.

use super::object_trees::random_tree;
use super::support::{SEED, configuration, demonstrated_trial, with_tiny_cameras};
use crate::dependency_root::{Root, choose_root, grasp_sequence, predict, step_goal};
use crate::layout::Layout;
use crate::scene::{Scene, SceneConfig};
use crate::trial::{Recording, run_trial};
use vmao_core::catalogue::{InstanceSet, NAMES, item};
use vmao_core::contact::PartId;
use vmao_core::contact_model::FixedTuple;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::object::{ObjectGoal, ObjectState};
use vmao_core::object_centric::part_poses;
use vmao_core::object_graph::ObjectGraph;
use vmao_core::order::GraspOrder;
use vmao_core::random::Stream;
use vmao_core::robots::panda;

const ORDERS: [GraspOrder; 3] = [GraspOrder::Parallel, GraspOrder::SequentialParallel, GraspOrder::Sequential];

fn chain(root: &str) -> Scene {
    let physics = SceneConfig { layout: Layout::Ring, ..configuration().0 };
    let item = item("three-sticks-chain", InstanceSet::Train, 0).unwrap();
    Scene::new(&physics, vec![panda(); 3], item).unwrap().with_root(root).unwrap()
}

#[test]
fn roots_are_named_first_auto_or_by_a_part_and_nothing_else() {
    let root = |name: &str| chain(name).root;
    assert_eq!(["first", "red", "blue"].map(root), [0, 0, 2].map(|part| Root::Part(PartId(part))));
    assert_eq!(root("auto"), Root::Auto);
    let error = chain("first").with_root("green").unwrap_err().to_string();
    assert_eq!(error, "object `three-sticks-chain` has no part `green`; a root is one of: first, auto, red, white, blue");
}

#[test]
fn from_the_first_part_the_catalogue_is_grasped_in_the_order_of_its_parts() {
    for name in NAMES {
        let object = item(name, InstanceSet::Train, 0).unwrap().object;
        let parts: Vec<PartId> = (0..object.parts.len()).map(|part| PartId(part as u16)).collect();
        let graph = ObjectGraph::of(&object).unwrap();
        assert!(ORDERS.iter().all(|&order| grasp_sequence(&graph, PartId(0), order) == parts), "{name}");
    }
    let graph = chain("first").graph;
    assert_eq!(grasp_sequence(&graph, PartId(2), GraspOrder::Sequential), [2, 1, 0].map(PartId));
    assert_eq!(grasp_sequence(&graph, PartId(2), GraspOrder::SequentialParallel), [2, 0, 1].map(PartId));
    assert_eq!(grasp_sequence(&graph, PartId(2), GraspOrder::Parallel), [0, 1, 2].map(PartId));
}

#[test]
fn what_is_held_is_joined_and_every_step_keeps_it_at_its_goal() {
    let mut stream = Stream::new(51, &[]);
    for case in 0..60 {
        let object = random_tree(&mut stream, 1 + case % 12);
        let graph = ObjectGraph::of(&object).unwrap();
        let joints = |share: f64| -> Vec<f64> {
            let kinds = object.joints.iter().map(|joint| joint.kind);
            let count = kinds.map(vmao_core::object::JointKind::coordinates).sum::<usize>();
            (0..count).map(|index| share * (0.1 + 0.07 * index as f64)).collect()
        };
        let place =
            |lift: f64, joints: &[f64]| part_poses(&object, &graph, PartId(0), &Pose::translation(0.0, 0.0, lift), joints);
        let drawn =
            ObjectGoal { root: PartId(0), world_from_root: Pose::translation(0.0, 0.0, 0.2), joint_positions: joints(1.0) };
        let goal_parts = place(0.2, &drawn.joint_positions);
        for root in (0..object.parts.len()).map(|part| PartId(part as u16)) {
            let goal = drawn.with_root(&object, &graph, root);
            for order in ORDERS {
                let sequence = grasp_sequence(&graph, root, order);
                let mut now = ObjectState { world_from_parts: place(0.0, &joints(-1.0)), joint_positions: joints(-1.0) };
                for step in order.steps(sequence.len()) {
                    let held = &sequence[..step.end];
                    assert!(held.contains(&root), "{order:?}: the root is not held first");
                    let inside = object.joints.iter().filter(|joint| held.contains(&joint.parent) && held.contains(&joint.child));
                    assert_eq!(inside.count() + 1, held.len(), "{order:?}: what is held is not joined");
                    let to = step_goal(&object, (&goal, &goal_parts), held, &now);
                    let parts = part_poses(&object, &graph, to.root, &to.world_from_root, &to.joint_positions);
                    for part in held {
                        let (is, wanted) = (&parts[usize::from(part.0)], &goal_parts[usize::from(part.0)]);
                        let off = (is.translation.vector - wanted.translation.vector).norm();
                        assert!(
                            off < 1e-9 && rotation_distance(&is.rotation, &wanted.rotation) < 1e-7,
                            "{order:?}: part {}",
                            part.0
                        );
                    }
                    now = ObjectState { world_from_parts: parts, joint_positions: to.joint_positions };
                }
            }
        }
    }
}

#[test]
fn all_roots_meet_the_same_starts_and_goals_and_hold_the_root_first() {
    let config = with_tiny_cameras(&configuration().1);
    let mut met: Option<(ObjectState, Vec<Pose>)> = None;
    for (part, root) in ["red", "white", "blue"].into_iter().enumerate() {
        let scene = chain(root);
        // One grasp is asked for; more would take time and say no more.
        let contact = scene.demonstrations[0][part];
        let record =
            run_trial(&scene, &config, &FixedTuple(vec![contact]), GraspOrder::Sequential, (SEED, 3), Recording::Off).record;
        let goal = &record.goal;
        assert_eq!((goal.root, record.grasps[0].contact.part), (PartId(part as u16), PartId(part as u16)));
        let parts = part_poses(&scene.object, &scene.graph, goal.root, &goal.world_from_root, &goal.joint_positions);
        let (start, goal_parts) = met.get_or_insert_with(|| (record.start.clone(), parts.clone()));
        assert_eq!(record.start, *start);
        for (a, b) in parts.iter().zip(goal_parts) {
            assert!((a.translation.vector - b.translation.vector).norm() < 1e-12, "{root} asks for another goal");
            assert!(rotation_distance(&a.rotation, &b.rotation) < 1e-7, "{root} asks for another goal");
        }
    }
}

#[test]
fn auto_is_the_trial_of_the_root_it_chose() {
    let config = configuration().1;
    let trial = |scene: &Scene, index| format!("{:?}", demonstrated_trial(scene, &config, GraspOrder::Sequential, index).record);
    let (auto, fixed) = (chain("auto"), ["red", "white", "blue"].map(chain));
    let mut chosen = [0; 3];
    for index in 0..12 {
        let nothing = run_trial(
            &auto,
            &with_tiny_cameras(&config),
            &FixedTuple(vec![]),
            GraspOrder::Sequential,
            (SEED, index),
            Recording::Off,
        );
        let (start, goal) = (nothing.record.start, nothing.record.goal);
        assert_eq!(
            choose_root(&auto, &config, GraspOrder::Sequential, &start, &goal.with_root(&auto.object, &auto.graph, PartId(0))),
            goal.root
        );
        chosen[usize::from(goal.root.0)] += 1;
        if index < 2 {
            assert!(trial(&auto, index) == trial(&fixed[usize::from(goal.root.0)], index), "auto differs from its choice");
        }
    }
    assert!(chosen.iter().filter(|&&count| count > 0).count() > 1, "auto has no choice to make: {chosen:?}");
}

#[test]
fn predicted_ways_are_those_of_plain_motions() {
    let scene = chain("first");
    let (graph, object) = (&scene.graph, &scene.object);
    let joints = vec![1.0, 1.0];
    let parts = part_poses(object, graph, PartId(0), &Pose::translation(0.0, 0.0, 0.02), &joints);
    let start = ObjectState { world_from_parts: parts.clone(), joint_positions: joints.clone() };
    let motion = configuration().1.motion;
    // Everything 24 cm up takes 2 s at the mean speed of 12 cm/s, and a minimum-jerk motion is 1.875 times as fast in its middle.
    for root in 0..3 {
        let world_from_root = Pose::translation(0.0, 0.0, 0.24) * parts[root];
        let goal = ObjectGoal { root: PartId(root as u16), world_from_root, joint_positions: joints.clone() };
        let at_once = predict(&scene, &motion, GraspOrder::Parallel, &start, &goal);
        assert!((at_once.hand_path - 0.72).abs() < 1e-9 && (at_once.longest_hand_path - 0.24).abs() < 1e-9, "{at_once:?}");
        assert!((at_once.swing - 0.72).abs() < 1e-9);
        assert!(at_once.hand_speed < 0.12 * 1.875 && at_once.hand_speed > 0.12 * 1.8, "{at_once:?}");
        // One after the other: the first goes all the way, and when the others are held the object is there already.
        let in_turn = predict(&scene, &motion, GraspOrder::Sequential, &start, &goal);
        assert!((in_turn.hand_path - 0.24).abs() < 1e-9 && (in_turn.swing - 0.72).abs() < 1e-9, "{in_turn:?}");
    }
    let moment = |root: usize| {
        let goal = ObjectGoal {
            root: PartId(root as u16),
            world_from_root: Pose::translation(0.0, 0.0, 0.24) * parts[root],
            joint_positions: joints.clone(),
        };
        assert!(predict(&scene, &motion, GraspOrder::Parallel, &start, &goal).moment == 0.0, "all is held");
        predict(&scene, &motion, GraspOrder::Sequential, &start, &goal).moment
    };
    let weight = 9.81 * object.parts.iter().map(|part| part.mass).sum::<f64>();
    assert!(moment(1) < 0.7 * moment(0), "a chain is lighter by its middle: {} and {} N·m", moment(1), moment(0));
    // Nearly straight: half the middle stick, and three quarters of the end stick.
    assert!((0.15..0.17).contains(&(moment(0) / weight)), "held by its end, {} m from its middle", moment(0) / weight);
    // A hinge that turns by half a turn about the standing root takes its hand along a half circle.
    let still = Pose::translation(0.0, 0.0, 0.02);
    let turned = ObjectGoal { root: PartId(0), world_from_root: still, joint_positions: vec![0.0, 1.0] };
    let before = ObjectState {
        world_from_parts: part_poses(object, graph, PartId(0), &still, &[2.0, 1.0]),
        joint_positions: vec![2.0, 1.0],
    };
    let places = |joint: f64| {
        let parts = part_poses(object, graph, PartId(0), &still, &[joint, 1.0]);
        [1, 2].map(|part| parts[part] * scene.hold_centers[part])
    };
    let hinge = still * object.joints[0].anchor;
    let arcs: f64 = places(2.0).iter().map(|place| 2.0 * (place - hinge).norm()).sum();
    let predicted = predict(&scene, &motion, GraspOrder::Parallel, &before, &turned);
    assert!((predicted.hand_path / arcs - 1.0).abs() < 0.02, "{predicted:?}, arcs of {arcs} m");
}

#[test]
fn auto_takes_no_root_that_cannot_carry_the_others() {
    let (physics, config) = configuration();
    let item = item("cabinet", InstanceSet::Train, 0).unwrap();
    let scene = Scene::new(&SceneConfig { layout: Layout::Ring, ..physics }, vec![panda(); 3], item).unwrap();
    let scene = scene.with_root("auto").unwrap();
    let mut chosen = [0; 3];
    for index in 0..40 {
        let trial =
            |order| run_trial(&scene, &with_tiny_cameras(&config), &FixedTuple(vec![]), order, (SEED, index), Recording::Off);
        chosen[usize::from(trial(GraspOrder::Sequential).record.goal.root.0)] += 1;
    }
    let [body, door, drawer] = chosen;
    assert!(door == 0 && body > 0 && drawer > 0, "{chosen:?}");
}
