//! Our kinematics against the simulator's, which knows nothing of ours but the written scene.

use super::settled;
use super::support::{configuration, mixed_scene, scene};
use crate::convention::{Data, body_pose, free_joint_position, hinge_jacobian};
use crate::layout::{BasePlacement, Layout};
use crate::scene::{Owner, Scene, SceneConfig};
use crate::simulation::Grip;
use mujoco_rs::wrappers::mj_model::MjtObjBase;
use nalgebra::{Matrix3, Vector3};
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::contact::PartId;
use vmao_core::geometry::{Pose, rotation_distance, rotation_exp};
use vmao_core::object_centric::{joint_positions, part_poses};
use vmao_core::random::Stream;
use vmao_core::robots::{panda, sawyer};

#[track_caller]
fn check_same(ours: &Pose, theirs: &Pose, what: &str) {
    let gap = (ours.translation.vector - theirs.translation.vector).norm();
    let turn = rotation_distance(&ours.rotation, &theirs.rotation);
    assert!(gap < 1e-9 && turn < 1e-7, "{what}: {gap} m and {turn} rad apart");
}

/// Sets both arms to `q` and computes all body poses.
fn set_arms(scene: &Scene, data: &mut Data, q: &[Vec<f64>]) {
    for (arm, q) in scene.arms.iter().zip(q) {
        data.qpos_mut()[arm.qpos..arm.qpos + 7].copy_from_slice(q);
    }
    data.forward();
}

#[test]
fn chains_and_jacobians_are_the_simulators_on_random_configurations() {
    let scene = mixed_scene();
    let mut data = Data::new(scene.model.clone());
    let nv = data.qvel().len();
    let mut stream = Stream::new(11, &[]);
    for _ in 0..200 {
        let q: Vec<Vec<f64>> = scene.robots.iter().map(|robot| robot.tool_chain().sample(&mut stream)).collect();
        set_arms(&scene, &mut data, &q);
        for (index, (arm, robot)) in scene.arms.iter().zip(&scene.robots).enumerate() {
            let (chain, world_from_base) = (robot.tool_chain(), scene.world_from_bases[index]);
            for (link, pose) in chain.link_poses(&q[index]).iter().enumerate() {
                check_same(&(world_from_base * pose), &body_pose(&data, arm.bodies[link + 1]), &format!("link {}", link + 1));
            }
            let hand = body_pose(&data, arm.hand_body);
            let world_from_tool = world_from_base * chain.tool_pose(&q[index]);
            check_same(&world_from_tool, &(hand * robot.gripper.hand_from_tool), "tool");

            let site = scene.model.name_to_id(MjtObjBase::mjOBJ_SITE, &format!("arm{index}/tool")).unwrap();
            let (linear, angular) = data.jac_site(true, true, site);
            let ours = chain.jacobian(&q[index]);
            let running = hinge_jacobian(&data, &arm.joints, &world_from_tool.translation.vector);
            for joint in 0..7 {
                let column = |rows: &[f64]| Vector3::from_fn(|row, _| rows[row * nv + arm.dof + joint]);
                let turned = |first: usize| world_from_base.rotation * ours.fixed_view::<3, 1>(first, joint).into_owned();
                for (first, theirs) in [(0, column(&linear)), (3, column(&angular))] {
                    assert!((turned(first) - theirs).amax() < 1e-9, "column {joint} of the chain's Jacobian");
                    let running = running.fixed_view::<3, 1>(first, joint);
                    assert!((running - theirs).amax() < 1e-9, "column {joint} of the controller's Jacobian");
                }
            }
        }
    }
}

#[test]
fn the_compiled_arm_has_the_robots_limits_and_inertias() {
    let scene = mixed_scene();
    let model = &scene.model;
    for (arm, robot) in scene.arms.iter().zip(&scene.robots) {
        for (&id, joint) in arm.joints.iter().zip(&robot.joints) {
            assert_eq!(model.jnt_range()[id], joint.range);
            assert!(model.jnt_limited()[id]);
            let dof = model.jnt_dofadr()[id] as usize;
            assert_eq!((model.dof_damping()[dof], model.dof_armature()[dof]), (joint.damping, joint.armature));
        }
        let links = [&robot.base].into_iter().chain(robot.joints.iter().map(|joint| &joint.link));
        let links = links.chain([&robot.gripper.hand]).chain(robot.gripper.fingers.iter().map(|finger| &finger.link));
        for (&body, link) in arm.bodies.iter().zip(links) {
            assert!((model.body_mass()[body] - link.inertial.mass).abs() < 1e-9, "{}", link.name);
            assert!((Vector3::from(model.body_ipos()[body]) - link.inertial.center.coords).amax() < 1e-9, "{}", link.name);
            let [w, x, y, z] = model.body_iquat()[body];
            let turn = vmao_core::geometry::pose([0.0; 3], [w, x, y, z]).rotation.to_rotation_matrix().into_inner();
            let inertia = turn * Matrix3::from_diagonal(&Vector3::from(model.body_inertia()[body])) * turn.transpose();
            assert!((inertia - link.inertial.inertia).amax() < 1e-6, "{}: {inertia} {}", link.name, link.inertial.inertia);
        }
    }
}

#[test]
fn arms_at_home_touch_nothing_and_their_fingers_move_together() {
    let scene = mixed_scene();
    let mut simulation = settled(&scene, 2);
    for arm in 0..2 {
        let gripper = &scene.robots[arm].gripper;
        for opening in [gripper.closed_gap, gripper.max_opening(), 0.5 * (gripper.closed_gap + gripper.max_opening())] {
            simulation.grips[arm] = Grip::Open(opening);
            simulation.wait(1.0);
            assert!((simulation.opening(arm) - opening).abs() < 1e-3, "{opening} m asked, {} m", simulation.opening(arm));
            let at = scene.arms[arm].finger_qpos;
            let [first, second] = [simulation.data.qpos()[at], simulation.data.qpos()[at + 1]];
            assert!((first - second).abs() < 2e-4, "arm {arm}: one finger at {first} m, the other at {second} m");
        }
    }
    let owners = |geoms: [i32; 2]| geoms.map(|geom| scene.owners[geom as usize]);
    let of_arm = |owner: &Owner| matches!(owner, Owner::Link(_) | Owner::Pad(..));
    let touching: Vec<_> = simulation.data.contact().iter().map(|contact| owners(contact.geom)).collect();
    assert!(!touching.iter().flatten().any(of_arm), "{touching:?}");
}

#[test]
fn part_poses_are_the_simulators_for_any_root() {
    let mut stream = Stream::new(12, &[]);
    for instance in 0..6 {
        let scene = scene(instance);
        let mut data = Data::new(scene.model.clone());
        for _ in 0..50 {
            let [low, high] = scene.object.joints[0].limits.unwrap();
            let joint = stream.range(low, high);
            let turn = rotation_exp(&Vector3::from_fn(|_, _| stream.range(-2.0, 2.0)));
            let shift = Vector3::from_fn(|_, _| stream.range(-1.0, 1.0));
            let world_from_root = Pose::from_parts(shift.into(), turn);
            let at = scene.object_qpos;
            data.qpos_mut()[at..at + 7].copy_from_slice(&free_joint_position(&world_from_root));
            let (qpos, _) = scene.joint_addresses[0].unwrap();
            data.qpos_mut()[qpos] = joint;
            data.forward();
            let theirs: Vec<Pose> = scene.part_bodies.iter().map(|&body| body_pose(&data, body)).collect();
            for root in 0..2 {
                let ours = part_poses(&scene.object, &scene.graph, PartId(root), &theirs[usize::from(root)], &[joint]);
                for (part, (ours, theirs)) in ours.iter().zip(&theirs).enumerate() {
                    check_same(ours, theirs, &format!("part {part} from root {root}"));
                }
            }
            assert!((joint_positions(&scene.object, &theirs)[0] - joint).abs() < 1e-9);
        }
    }
}

#[test]
fn the_objects_state_is_read_back_as_it_was_set() {
    let scene = scene(3);
    let simulation = settled(&scene, 4);
    let state = simulation.object_state();
    let measured = joint_positions(&scene.object, &state.world_from_parts);
    assert!((measured[0] - state.joint_positions[0]).abs() < 1e-9, "joint coordinate and part poses disagree");
    for arm in 0..2 {
        assert!((simulation.opening(arm) - 0.08).abs() < 5e-4, "an opened gripper is {} m wide", simulation.opening(arm));
        let home = &scene.robots[arm].home;
        let moved = simulation.joint_positions(arm).iter().zip(home).map(|(q, home)| (q - home).abs()).fold(0.0, f64::max);
        assert!(moved < 1e-3, "arm {arm} left home by {moved} rad while the object settled");
    }
}

#[test]
fn arms_that_stand_in_each_other_or_in_the_table_are_refused() {
    let (physics, _) = configuration();
    let refused = |second: [f64; 3]| {
        let base = |position, yaw_deg| BasePlacement { position, yaw_deg };
        let bases = vec![base([-0.58, 0.0, 0.0], 0.0), base(second, 180.0)];
        let config = SceneConfig { layout: Layout::Explicit, bases, ..physics.clone() };
        Scene::new(&config, vec![panda(), sawyer(2)], item("pliers", InstanceSet::Train, 0).unwrap()).err().map(|e| e.to_string())
    };
    assert!(refused([-0.58, 0.0, 0.0]).unwrap().contains("arm 0 and arm 1 overlap by"));
    assert!(refused([0.58, 0.0, -5.0]).unwrap().contains("the table"));
    assert_eq!(refused([0.58, 0.0, 0.0]), None);
}
