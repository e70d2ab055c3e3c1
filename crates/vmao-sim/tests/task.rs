//! Where objects start and where they shall go, over many draws.

mod support;

use nalgebra::Vector3;
use support::{SEED, WorldPoints, configuration, scene, with_tiny_cameras};
use vmao_core::contact_model::{FixedTuple, JitteredTuple};
use vmao_core::object::ObjectState;
use vmao_core::order::GraspOrder;
use vmao_core::record::TrialRecord;
use vmao_sim::{Recording, Scene, run_trial};

const DRAWS: u64 = 50;

/// Start and goal of many trials on all sizes; nothing is grasped.
fn drawn() -> Vec<(Scene, Vec<TrialRecord>)> {
    let (_, config) = configuration();
    let config = with_tiny_cameras(&config);
    (0..6)
        .map(|instance| {
            let scene = scene(instance);
            let draw = |index| {
                let ids = (SEED, u64::from(instance) * DRAWS + index);
                run_trial(&scene, &config, &WorldPoints(None), GraspOrder::Parallel, ids, Recording::Off).record
            };
            let records = (0..DRAWS).map(draw).collect();
            (scene, records)
        })
        .collect()
}

/// Height of the lowest point of the object (m).
fn lowest_point(scene: &Scene, state: &ObjectState) -> f64 {
    let parts = scene.object.parts.iter().zip(&state.world_from_parts);
    let solids = parts.flat_map(|(part, pose)| part.solids.iter().map(move |solid| (solid, pose * solid.carrier_from_solid)));
    let lowest = solids.map(|(solid, world_from_solid)| {
        let up = world_from_solid.inverse_transform_vector(&Vector3::z());
        world_from_solid.translation.z - solid.shape.extent_along(&up)
    });
    lowest.fold(f64::INFINITY, f64::min)
}

/// Smallest and largest.
fn span(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

/// All values lie in [low, high] and fill it up to `slack` of its length at both ends.
#[track_caller]
fn check_fills(what: &str, values: &[f64], [low, high]: [f64; 2], slack: f64) {
    let [smallest, largest] = span(values);
    assert!(smallest >= low - 1e-9 && largest <= high + 1e-9, "{what}: {smallest}..{largest} leaves {low}..{high}");
    let slack = slack * (high - low);
    assert!(smallest <= low + slack && largest >= high - slack, "{what}: {smallest}..{largest} does not fill {low}..{high}");
}

#[test]
fn starts_rest_on_the_table_and_goals_follow_the_stated_distribution() {
    let (mut lifts, mut moves, mut yaws, mut tilts, mut changes) = (vec![], vec![], vec![], vec![], vec![]);
    let mut headings = [0; 4];
    for (scene, records) in drawn() {
        let [low, high] = scene.object.joints[0].limits.unwrap();
        for record in records {
            let (start, goal) = (&record.start, &record.goal);
            let height = lowest_point(&scene, start);
            assert!((-1e-3..1e-3).contains(&height), "trial {} starts {height} m above the table", record.index);
            let now = start.joint_positions[0];
            // A stop is soft: it gives way by a few thousandths of a radian.
            assert!((low - 0.01..=high + 0.01).contains(&now), "trial {} starts with its joint at {now}", record.index);
            let root = &start.world_from_parts[usize::from(goal.root.0)];
            assert!(root.translation.vector.xy().amax() < 0.06 + 0.02, "starts within the start area");

            let step = goal.world_from_root.translation.vector - root.translation.vector;
            lifts.push(step.z);
            moves.push(step.xy().norm());
            headings[usize::from(step.x > 0.0) + 2 * usize::from(step.y > 0.0)] += 1;
            let turn = goal.world_from_root.rotation * root.rotation.inverse();
            yaws.push(2.0 * (turn.k / turn.w).atan());
            tilts.push((turn * Vector3::z()).angle(&Vector3::z()));
            let wanted = goal.joint_positions[0];
            assert!((low..=high).contains(&wanted), "the goal asks for {wanted} outside {low}..{high}");
            changes.push((wanted - now).abs());
            // Final errors of a trial that does nothing are those of its start.
            let [position, _, joint, _] = record.final_errors;
            assert!(position > 0.02 && joint > 5_f64.to_radians(), "trial {} starts at its goal", record.index);
        }
    }
    assert_eq!(lifts.len(), 300);
    check_fills("lift", &lifts, [0.08, 0.20], 0.05);
    check_fills("sideways move", &moves, [0.0, 0.15], 0.1);
    check_fills("yaw", &yaws, [-45_f64.to_radians(), 45_f64.to_radians()], 0.05);
    check_fills("tilt", &tilts, [0.0, 15_f64.to_radians()], 0.05);
    check_fills("joint change", &changes, [15_f64.to_radians(), 60_f64.to_radians()], 0.2);
    assert!(headings.iter().all(|&count| count > 45), "directions are uneven: {headings:?}");
    let mean = lifts.iter().sum::<f64>() / 300.0;
    // Uniform: standard deviation of the mean is 0.12 / √12 / √300 = 2 mm.
    assert!((mean - 0.14).abs() < 0.008, "mean lift {mean}");
    let share = moves.iter().filter(|&&distance| distance < 0.15 / 2_f64.sqrt()).count();
    assert!((115..=185).contains(&share), "the sideways move is not uniform over the disc: {share} of 300 in its inner half");
}

#[test]
fn contact_models_and_orders_meet_the_same_starts_and_goals() {
    let (_, config) = configuration();
    let scene = scene(0);
    let tuple = scene.demonstrations[0].clone();
    let far = WorldPoints(Some([[3.0, 0.0, 0.1].into(), [3.0, 0.02, 0.1].into()]));
    let models: [&dyn vmao_core::contact_model::ContactModel; 4] =
        [&WorldPoints(None), &far, &FixedTuple(tuple.clone()), &JitteredTuple { tuple, radius: 0.02 }];
    let mut first: Option<TrialRecord> = None;
    for model in models {
        for order in [GraspOrder::Parallel, GraspOrder::Sequential] {
            let record = run_trial(&scene, &config, model, order, (SEED, 5), Recording::Off).record;
            let first = first.get_or_insert_with(|| record.clone());
            assert_eq!((&record.start, &record.goal), (&first.start, &first.goal), "{order:?}");
        }
    }
}

#[test]
fn contact_models_see_the_same_first_picture() {
    let (_, config) = configuration();
    let scene = scene(0);
    let far = WorldPoints(Some([[3.0, 0.0, 0.1].into(), [3.0, 0.02, 0.1].into()]));
    let wide = WorldPoints(Some([[0.0, -0.1, 0.1].into(), [0.0, 0.1, 0.1].into()]));
    let look = |model: &WorldPoints| run_trial(&scene, &config, model, GraspOrder::Sequential, (SEED, 7), Recording::Off).record;
    let (a, b) = (look(&far), look(&wide));
    assert_eq!(a.grasps[0].observation, b.grasps[0].observation);
    assert!(!a.grasps[0].observation.is_empty());
}
