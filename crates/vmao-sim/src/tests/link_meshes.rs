//! Meshes change pictures only: bodies, what collides and the motion are those of the scene without them.

use super::support::{configuration, mixed_scene};
use crate::convention::Data;
use crate::link_meshes::LinkMesh;
use mujoco_rs::wrappers::mj_model::MjModel;
use std::sync::Arc;
use vmao_core::geometry::pose;

/// An open tetrahedron: three triangles, no bottom.
const TETRAHEDRON: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

fn colliding(model: &MjModel) -> usize {
    model.geom_contype().iter().zip(model.geom_conaffinity()).filter(|(a, b)| **a != 0 || **b != 0).count()
}

fn positions_after(model: MjModel, steps: usize) -> Vec<f64> {
    let mut data = Data::new(Arc::new(model));
    for _ in 0..steps {
        data.step();
    }
    data.qpos().to_vec()
}

#[test]
fn meshes_change_neither_bodies_nor_collisions_nor_motion() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(r#"a & "b" <c>.obj"#);
    std::fs::write(&file, TETRAHEDRON).unwrap();
    let mesh = |robot, link, x| LinkMesh {
        robot,
        link,
        file: file.clone(),
        link_from_mesh: pose([x, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5]),
        scale: [1.0, 2.0, 0.5],
        rgba: [0.25, 0.5, 0.75, 1.0],
    };
    let meshes = [mesh("panda", "link3", 0.0), mesh("panda", "link3", 0.1), mesh("sawyer", "left_finger", 0.0)];
    let scene = mixed_scene();
    let (config, _) = configuration();
    let dressed = MjModel::from_xml_string(&scene.mjcf_with_meshes(&config, &meshes).unwrap()).unwrap();
    let plain = MjModel::from_xml_string(&scene.mjcf).unwrap();
    assert_eq!(dressed.geom_bodyid().len(), plain.geom_bodyid().len() + 3);
    assert_eq!(dressed.body_mass(), plain.body_mass());
    assert_eq!(dressed.body_inertia(), plain.body_inertia());
    assert_eq!(dressed.body_ipos(), plain.body_ipos());
    assert_eq!(colliding(&dressed), colliding(&plain));
    let in_group = |model: &MjModel, group: i32| model.geom_group().iter().filter(|found| **found == group).count();
    assert_eq!((in_group(&plain, 2), in_group(&plain, 3)), (0, 0));
    assert_eq!(in_group(&dressed, 2), 3);
    let hidden = |robot: &str, link: &str| {
        let robot = scene.robots.iter().find(|found| found.name == robot).unwrap();
        let joint = robot.joints.iter().find(|joint| joint.link.name == link).map(|joint| joint.link.solids.len());
        joint.unwrap_or(robot.gripper.fingers[0].link.solids.len() + 1)
    };
    assert_eq!(in_group(&dressed, 3), hidden("panda", "link3") + hidden("sawyer", "left_finger"));
    assert_eq!(positions_after(dressed, 200), positions_after(plain, 200));
}

#[test]
fn without_meshes_the_scene_is_the_one_that_trials_run_on() {
    let scene = mixed_scene();
    let (config, _) = configuration();
    assert_eq!(scene.mjcf_with_meshes(&config, &[]).unwrap(), scene.mjcf);
}

#[test]
fn meshes_that_cannot_be_shown_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bad.obj");
    std::fs::write(&file, "v 0 0 nonsense").unwrap();
    let pandas = super::support::scene(0);
    let (config, _) = configuration();
    let mesh = |robot| LinkMesh {
        robot,
        link: "link3",
        file: file.clone(),
        link_from_mesh: pose([0.0; 3], [1.0, 0.0, 0.0, 0.0]),
        scale: [1.0; 3],
        rgba: [1.0; 4],
    };
    let refusal = |robot| pandas.mjcf_with_meshes(&config, &[mesh(robot)]).unwrap_err().to_string();
    assert_eq!(refusal("sawyer"), "meshes: of robot `sawyer`; the scene's robots are: panda, panda");
    assert!(refusal("panda").contains("bad.obj"), "{}", refusal("panda"));
}
