//! Grasps hold by closing force and friction alone: without either, the trial that succeeds fails.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod support;

use mujoco_rs::wrappers::mj_data::MjData;
use mujoco_rs::wrappers::mj_model::{MjModel, MjtEq, MjtJoint, MjtObjBase, MjtTrn};
use support::{configuration, demonstrated_trial, failed_at, first_successes, mixed_scene, scene, scene_with, slippery};
use vmao_core::order::GraspOrder;
use vmao_core::outcome::FailureStage;
use vmao_core::robots::{DEFAULT_SLOT, panda, sawyer};
use vmao_sim::{SceneConfig, TrialConfig};

/// Friction at which the grasps must fail.
const ICE: f64 = 0.05;

/// Force of a pad (N) at which two grippers cannot carry the pliers on ice, and the time that closing so gently takes.
const GENTLE: f64 = 7.0;
const GENTLE_SECONDS: f64 = 1.2;

fn check_that_grasping_matters(order: GraspOrder, physics: &SceneConfig, config: &TrialConfig) {
    let scene = scene_with(physics, 0);
    let icy = scene_with(&slippery(physics, ICE), 0);
    let mut never_closed = config.clone();
    never_closed.grasp.closing_force = 0.0;
    for success in first_successes(&scene, config, order, 3) {
        let index = success.record.index;
        assert!(success.threshold_factor <= 1.0 && success.record.detail.is_empty());

        let ice = demonstrated_trial(&icy, config, order, index);
        let lost = [FailureStage::Slip, FailureStage::NoContact, FailureStage::Threshold];
        assert!(lost.contains(&failed_at(&ice)), "trial {index} on ice: {:?} {}", ice.record.outcome, ice.record.detail);

        let open = demonstrated_trial(&scene, &never_closed, order, index);
        assert_eq!(failed_at(&open), FailureStage::NoContact, "trial {index}: {}", open.record.detail);
        assert_eq!(open.record.goal, success.record.goal, "the same trial");
        assert!(open.record.grasps[0].world_from_gripper.is_some(), "the open gripper went to its grasp");
    }
}

#[test]
fn two_gentle_grippers_carry_the_object_by_friction_and_not_on_ice_by_coulombs_law() {
    let (physics, _) = configuration();
    for instance in 0..6 {
        let weight = 9.81 * scene(instance).object.parts.iter().map(|part| part.mass).sum::<f64>();
        // Two grippers, two pads each.
        let carried = |friction: f64| 4.0 * friction * GENTLE;
        assert!(carried(ICE) < weight, "four pads with {GENTLE} N carry {weight} N on ice: the icy trials show nothing");
        assert!(carried(physics.pad_friction.sliding) > 2.0 * weight);
    }
}

#[test]
fn in_parallel_order_nothing_holds_without_friction_or_without_closing() {
    // Pressed with the shipped 17.5 N a pad, two grippers may carry so light a thing even on ice, as Coulomb says.
    let (physics, mut config) = configuration();
    config.grasp.closing_force = GENTLE;
    config.grasp.closing_seconds = GENTLE_SECONDS;
    check_that_grasping_matters(GraspOrder::Parallel, &physics, &config);
}

#[test]
fn in_sequential_order_nothing_holds_without_friction_or_without_closing() {
    let (physics, config) = configuration();
    check_that_grasping_matters(GraspOrder::Sequential, &physics, &config);
}

fn model() -> MjModel {
    MjModel::from_xml_string(&scene(0).mjcf).unwrap()
}

fn name_of(model: &MjModel, kind: MjtObjBase, id: usize) -> String {
    model.id_to_name(kind, id).unwrap_or("").to_owned()
}

#[test]
fn nothing_is_welded_carried_or_glued() {
    let model = model();
    for (index, kind) in model.eq_type().iter().enumerate() {
        assert_eq!(*kind, MjtEq::mjEQ_JOINT);
        for joint in [model.eq_obj1id()[index], model.eq_obj2id()[index]] {
            let name = name_of(&model, MjtObjBase::mjOBJ_JOINT, joint as usize);
            assert!(name.contains("finger"), "equality {index} is on {name}");
        }
    }
    assert_eq!(model.eq_type().len(), 2, "one coupling a gripper");
    assert!(model.body_mocapid().iter().all(|&id| id < 0), "no mocap body");
    assert!(model.geom_adhesion().iter().all(|&force| force == 0.0), "no sticky geom");
    assert!(model.geom_surfacevel().iter().flatten().all(|&speed| speed == 0.0), "no conveyor");
    assert!(model.body_gravcomp().iter().all(|&share| share == 0.0), "all weight is carried");
    assert!(model.actuator_trntype().iter().all(|&kind| kind == MjtTrn::mjTRN_JOINT), "actuators drive joints only");
    assert!(model.jnt_stiffness().iter().all(|&stiffness| stiffness == 0.0), "no springs");
    let free = model.jnt_type().iter().filter(|&&kind| kind == MjtJoint::mjJNT_FREE).count();
    assert_eq!(free, 1, "the object is free and nothing else");
    assert_eq!(model.ffi().ntendon, 0);
    assert_eq!(model.ffi().nplugin, 0);
}

#[test]
fn friction_and_gravity_are_those_of_the_world() {
    let model = model();
    for (geom, [sliding, torsional, rolling]) in model.geom_friction().iter().enumerate() {
        let name = name_of(&model, MjtObjBase::mjOBJ_GEOM, geom);
        assert!((0.1..=1.0).contains(sliding), "{name} slides at {sliding}");
        assert!(*torsional <= 0.003, "{name} resists turning by {torsional} m");
        assert!(*rolling <= 0.0001, "{name} resists rolling by {rolling} m");
    }
    assert_eq!(model.opt().gravity, [0.0, 0.0, -9.81]);
    assert_eq!(model.opt().disableflags, 0, "nothing of the physics is switched off");
    assert_eq!((model.opt().viscosity, model.opt().density, model.opt().wind), (0.0, 0.0, [0.0; 3]));
}

#[test]
fn contacts_are_on_between_everything_that_may_touch() {
    let model = model();
    for geom in 0..model.geom_bodyid().len() {
        let name = name_of(&model, MjtObjBase::mjOBJ_GEOM, geom);
        assert_eq!((model.geom_contype()[geom], model.geom_conaffinity()[geom]), (1, 1), "{name}");
        assert_eq!((model.geom_margin()[geom], model.geom_gap()[geom]), (0.0, 0.0), "{name} acts at a distance");
    }
}

#[test]
fn narrow_pads_get_the_solver_that_keeps_things_from_turning_in_them() {
    let (config, _) = configuration();
    let iterations = |mjcf: &str| MjModel::from_xml_string(mjcf).unwrap().opt().noslip_iterations;
    assert!(panda().gripper.pad_width() > config.noslip_pad_width);
    assert!(sawyer(DEFAULT_SLOT).gripper.pad_width() < config.noslip_pad_width && config.noslip_iterations > 0);
    assert_eq!(iterations(&scene(0).mjcf), 0, "two Pandas");
    assert_eq!(u32::try_from(iterations(&mixed_scene().mjcf)), Ok(config.noslip_iterations), "one Sawyer is enough");
}

#[test]
fn actuators_are_as_strong_as_the_robot_and_no_stronger() {
    let model = model();
    let robot = panda();
    for arm in 0..2 {
        for (index, joint) in robot.joints.iter().enumerate() {
            let name = format!("arm{arm}/joint{}", index + 1);
            let actuator = model.name_to_id(MjtObjBase::mjOBJ_ACTUATOR, &name).unwrap();
            assert_eq!(model.actuator_ctrlrange()[actuator], [-joint.max_torque, joint.max_torque], "{name}");
        }
        let actuator = model.name_to_id(MjtObjBase::mjOBJ_ACTUATOR, &format!("arm{arm}/finger1")).unwrap();
        let force = robot.gripper.max_force;
        assert_eq!(model.actuator_ctrlrange()[actuator], [-2.0 * force, 2.0 * force]);
    }
    assert_eq!(model.actuator_ctrlrange().len(), 16);
    assert!(model.actuator_ctrllimited().iter().all(|&limited| limited));
    let unit = |gear: &[f64; 6]| *gear == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert!(model.actuator_gear().iter().all(unit), "controls are torques");
}

#[test]
fn masses_are_those_of_real_things() {
    for instance in 0..6 {
        let scene = scene(instance);
        let model = MjModel::from_xml_string(&scene.mjcf).unwrap();
        let body = |name: &str| model.name_to_id(MjtObjBase::mjOBJ_BODY, name).unwrap();
        let object = model.body_subtreemass()[body("object/lever-a")];
        let described: f64 = scene.object.parts.iter().map(|part| part.mass).sum();
        assert!((0.15..=0.3).contains(&object), "the pliers weigh {object} kg");
        assert!((object - described).abs() < 1e-9);
        for arm in 0..2 {
            let mass = model.body_subtreemass()[body(&format!("arm{arm}/link0"))];
            assert!((17.0..=18.0).contains(&mass), "an arm weighs {mass} kg");
        }
        for index in 1..model.body_mass().len() {
            let name = name_of(&model, MjtObjBase::mjOBJ_BODY, index);
            assert!(model.body_mass()[index] >= 0.015 - 1e-12, "{name} weighs {}", model.body_mass()[index]);
            assert!(model.body_inertia()[index].iter().all(|&moment| moment > 0.0), "{name} has no inertia");
        }
    }
}

#[test]
fn the_written_scene_runs_in_the_simulator_alone() {
    let model = model();
    let mut data = MjData::new(&model);
    for _ in 0..500 {
        data.step();
    }
    assert!(data.qpos().iter().chain(data.qvel()).all(|value| value.is_finite()));
    for (kind, warning) in data.warning().iter().enumerate() {
        assert_eq!(warning.number, 0, "warning {kind}");
    }
    assert!((data.time() - 1.0).abs() < 1e-9);
}
