//! Every object of the catalogue, in every size: it compiles, comes to rest on the table, and keeps together.

use super::settled;
use super::support::configuration;
use crate::scene::{Owner, Scene, SceneConfig};
use crate::simulation::Simulation;
use vmao_core::catalogue::{INSTANCES, InstanceSet, NAMES, item};
use vmao_core::contact::PartId;
use vmao_core::object_centric::part_poses;

/// The object alone on the table.
fn alone(name: &str, set: InstanceSet, instance: u16) -> Scene {
    // Awake, so that its contacts are there to be looked at and a drift would show.
    let config = SceneConfig { sleep_tolerance: 0.0, ..configuration().0 };
    Scene::without_arms(&config, item(name, set, instance).unwrap()).unwrap()
}

/// Everything that lies deeper than a millimetre in something else.
fn penetrations(simulation: &Simulation<'_>) -> Vec<String> {
    let owner = |geom: i32| simulation.scene.owners[geom as usize];
    let contacts = simulation.data.contact();
    let deep = contacts.iter().filter(|contact| contact.exclude == 0 && contact.dist < -1e-3);
    deep.map(|contact| format!("{:?} {} m", contact.geom.map(owner), contact.dist)).collect()
}

/// Drops the object where trial `index` would start and checks where it comes to rest.
fn check_settles(scene: &Scene, what: &str, index: u64) {
    let mut simulation = settled(scene, index);
    let state = simulation.object_state();
    assert_eq!(penetrations(&simulation), Vec::<String>::new(), "{what}");
    let speed = simulation.object_speed();
    assert!(speed < 0.02, "{what} still moves at {speed} m/s or rad/s");
    for (joint, &position) in scene.object.joints.iter().zip(&state.joint_positions) {
        let [low, high] = joint.limits.unwrap();
        // A stop is soft: it gives way by a few thousandths.
        assert!((low - 0.01..=high + 0.01).contains(&position), "{what}: {} at {position}", joint.name);
    }
    let touches_table = simulation.data.contact().iter().any(|contact| {
        let owners = contact.geom.map(|geom| scene.owners[geom as usize]);
        owners.contains(&Owner::Table)
    });
    assert!(touches_table, "{what} does not lie on the table");
    // Constraints hold: the simulator's parts are where the joints say.
    let ours = part_poses(&scene.object, &scene.graph, PartId(0), &state.world_from_parts[0], &state.joint_positions);
    for (ours, theirs) in ours.iter().zip(&state.world_from_parts) {
        assert!((ours.translation.vector - theirs.translation.vector).norm() < 1e-9, "{what} comes apart");
    }
    let before = state.world_from_parts;
    simulation.wait(0.5);
    for (now, before) in simulation.object_state().world_from_parts.iter().zip(&before) {
        let drift = (now.translation.vector - before.translation.vector).norm() + now.rotation.angle_to(&before.rotation);
        assert!(drift < 5e-3, "{what} drifts by {drift} (m and rad) in half a second");
    }
}

#[test]
fn every_size_of_every_object_settles_whole_within_its_limits() {
    for name in NAMES {
        for set in [InstanceSet::Train, InstanceSet::HeldOut] {
            for instance in 0..INSTANCES {
                let scene = alone(name, set, instance);
                for index in 0..3 {
                    check_settles(&scene, &format!("{name} {set:?} {instance}, start {index}"), index);
                }
            }
        }
    }
}

#[test]
fn no_parts_overlap_anywhere_in_the_joints_range() {
    for name in NAMES {
        let scene = alone(name, InstanceSet::Train, 0);
        let joints = &scene.object.joints;
        // All corners of the joints' ranges.
        for corner in 0..1_u32 << joints.len() {
            let end = |(index, joint): (usize, &vmao_core::object::Joint)| joint.limits.unwrap()[(corner >> index & 1) as usize];
            let positions: Vec<f64> = joints.iter().enumerate().map(end).collect();
            let high = vmao_core::geometry::translation(0.0, 0.0, 1.0);
            let simulation = Simulation::new(&scene, configuration().1.osc, &high, &positions);
            assert_eq!(penetrations(&simulation), Vec::<String>::new(), "{name} at {positions:?}");
        }
    }
}
