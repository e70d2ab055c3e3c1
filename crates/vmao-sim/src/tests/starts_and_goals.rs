//! Starts and goals of every object of the catalogue, and of one with a ball joint: as stated, and never outside limits.

use super::support::{SEED, configuration};
use crate::scene::Scene;
use crate::task::{GoalConfig, goal_errors, lowest_point, sample_goal, sample_start, threshold_factor};
use nalgebra::{Point3, Vector3};
use vmao_core::catalogue::{CatalogueItem, InstanceSet, NAMES, item};
use vmao_core::contact::PartId;
use vmao_core::geometry::{Pose, rotation_distance};
use vmao_core::object::{Joint, JointKind, ObjectGoal, ObjectState};
use vmao_core::object_centric::{joint_errors, part_poses};
use vmao_core::random::Stream;

const DRAWS: u64 = 200;

/// Three sticks, the blue one on a ball joint.
fn with_a_ball() -> CatalogueItem {
    let mut item = item("three-sticks-chain", InstanceSet::Train, 0).unwrap();
    let hinge = &item.object.joints[1];
    item.object.joints[1] = Joint { kind: JointKind::Ball, limits: Some([0.0, 0.9]), ..hinge.clone() };
    item
}

/// The least change the configuration asks of a joint (rad or m).
fn least_change(config: &GoalConfig, joint: &Joint) -> f64 {
    let [low, high] = joint.limits.unwrap();
    let share = config.joint_change_share * (high - low);
    if joint.kind == JointKind::Prismatic { share } else { share.max(config.joint_change_deg.to_radians()) }
}

/// Starts, unsettled, and goals from them.
fn draws(scene: &Scene) -> Vec<(ObjectState, ObjectGoal)> {
    let (_, config) = configuration();
    let draw = |index| {
        let mut stream = Stream::new(SEED, &[index]);
        let (world_from_root, joint_positions) = sample_start(scene, &config.start, &mut stream);
        let height = lowest_point(scene, &world_from_root, &joint_positions);
        assert!((height - 0.002).abs() < 1e-9, "{}: starts {height} m above the table", scene.object.name);
        let world_from_parts = part_poses(&scene.object, &scene.graph, PartId(0), &world_from_root, &joint_positions);
        let start = ObjectState { world_from_parts, joint_positions };
        let goal = sample_goal(scene, &config.goal, &start, &mut stream);
        (start, goal)
    };
    (0..DRAWS).map(draw).collect()
}

fn check_joints(scene: &Scene, draws: &[(ObjectState, ObjectGoal)]) {
    let (_, config) = configuration();
    let name = &scene.object.name;
    let mut nearest = vec![f64::INFINITY; scene.object.joints.len()];
    for (start, goal) in draws {
        let changes = joint_errors(&scene.object, &goal.joint_positions, &start.joint_positions);
        let both = scene.object.positions_by_joint(&start.joint_positions);
        let both = both.zip(scene.object.positions_by_joint(&goal.joint_positions));
        for (index, ((joint, now), (_, wanted))) in both.enumerate() {
            let [low, high] = joint.limits.unwrap();
            let size = |position: &[f64]| match joint.kind {
                JointKind::Ball => Vector3::from_column_slice(position).norm(),
                JointKind::Revolute | JointKind::Prismatic | JointKind::Fixed => position[0],
            };
            for position in [now, wanted] {
                assert!((low..=high + 1e-12).contains(&size(position)), "{name}: {} at {position:?}", joint.name);
            }
            let (change, least) = (changes[index], least_change(&config.goal, joint));
            let no_room = size(now) - low < least && high - size(now) < least;
            assert!(change >= least - 1e-9 || no_room, "{name}: {} changes by {change}, not {least}", joint.name);
            nearest[index] = nearest[index].min(change);
        }
    }
    for (nearest, joint) in nearest.iter().zip(&scene.object.joints) {
        let least = least_change(&config.goal, joint);
        assert!(*nearest < 1.15 * least, "{name}: {} never changes by little: {nearest}, least {least}", joint.name);
    }
}

#[test]
fn joints_start_and_end_within_their_limits_and_change_as_stated() {
    let items = NAMES.map(|name| item(name, InstanceSet::Train, 0).unwrap());
    for item in items.into_iter().chain([with_a_ball()]) {
        let scene = Scene::without_arms(&configuration().0, item).unwrap();
        let draws = draws(&scene);
        check_joints(&scene, &draws);
        // No start meets its goal.
        let thresholds = configuration().1.thresholds;
        for (start, goal) in &draws {
            let goal_parts = part_poses(&scene.object, &scene.graph, goal.root, &goal.world_from_root, &goal.joint_positions);
            let factor = threshold_factor(&thresholds, &goal_errors(&scene, &goal_parts, goal, start));
            assert!(factor > 1.0, "{}: a start is within {factor} of its thresholds", scene.object.name);
        }
    }
}

#[test]
fn roots_move_alike_whatever_the_object() {
    let moved = |name: &str| -> Vec<(Vector3<f64>, f64)> {
        let scene = Scene::without_arms(&configuration().0, item(name, InstanceSet::Train, 0).unwrap()).unwrap();
        let step = |(start, goal): (ObjectState, ObjectGoal)| {
            let root: &Pose = &start.world_from_parts[usize::from(goal.root.0)];
            let step = goal.world_from_root.translation.vector - root.translation.vector;
            (step, rotation_distance(&root.rotation, &goal.world_from_root.rotation))
        };
        draws(&scene).into_iter().map(step).collect()
    };
    let goal = configuration().1.goal;
    for name in NAMES {
        let (steps, turns): (Vec<Vector3<f64>>, Vec<f64>) = moved(name).into_iter().unzip();
        assert!(steps.iter().all(|step| (goal.lift[0]..=goal.lift[1]).contains(&step.z)), "{name}");
        assert!(steps.iter().all(|step| step.xy().norm() <= goal.sideways + 1e-12), "{name}");
        let largest = (goal.yaw_deg + goal.tilt_deg).to_radians();
        assert!(turns.iter().all(|&turn| turn <= largest), "{name}");
        let mean = steps.iter().sum::<Vector3<f64>>() / DRAWS as f64;
        // Uniform over the lift and over a disc: standard deviations of the means are 2.5 mm and 5.3 mm.
        let expected = Vector3::new(0.0, 0.0, (goal.lift[0] + goal.lift[1]) / 2.0);
        assert!((mean.z - expected.z).abs() < 0.01 && mean.xy().norm() < 0.03, "{name}: {mean}");
    }
}

#[test]
fn errors_of_turning_and_sliding_joints_are_kept_apart_and_judged_by_their_own_thresholds() {
    let scene = Scene::without_arms(&configuration().0, item("cabinet", InstanceSet::Train, 0).unwrap()).unwrap();
    let place = |joints: &[f64]| part_poses(&scene.object, &scene.graph, PartId(0), &Pose::identity(), joints);
    let goal = ObjectGoal { root: PartId(0), world_from_root: Pose::identity(), joint_positions: vec![0.4, 0.03] };
    let thresholds = configuration().1.thresholds;
    let judged = |joints: [f64; 2]| {
        let state = ObjectState { world_from_parts: place(&joints), joint_positions: joints.to_vec() };
        let errors = goal_errors(&scene, &place(&goal.joint_positions), &goal, &state);
        (errors, threshold_factor(&thresholds, &errors))
    };
    let (errors, factor) = judged([0.4, 0.018]);
    assert!(errors[2].abs() < 1e-12 && (errors[3] - 0.012).abs() < 1e-12 && (factor - 1.2).abs() < 1e-9, "{errors:?} {factor}");
    let (errors, factor) = judged([0.45, 0.03]);
    assert!((errors[2] - 0.05).abs() < 1e-12 && errors[3].abs() < 1e-12 && factor < 1.0, "{errors:?} {factor}");
    // The door's anchor is not its origin: its part moves as well as turns.
    let hinge = scene.object.joints[0].anchor;
    assert!(hinge != Point3::origin() && errors[0] > 1e-3);
}
