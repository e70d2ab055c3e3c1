//! A tiny package made by the tests: our Panda's own frames, one mesh on two links, and a licence.

use super::{Import, LIST, import, link_names, read};
use crate::{config::Config, scenes::scenes};
use nalgebra::Vector3;
use std::{
    fs,
    path::{Path, PathBuf},
};
use vmao_core::catalogue::InstanceSet;
use vmao_core::geometry::{Pose, pose, rotation_distance};
use vmao_core::robots::{DEFAULT_SLOT, RobotModel, panda, sawyer};

const TETRAHEDRON: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 1 3 2\n";
const VISUAL: &str = r#"<geom class="seen" mesh="a" pos="0.01 0 0" material="red"/>"#;

fn attributes(pose: &Pose) -> String {
    let [x, y, z]: [f64; 3] = pose.translation.vector.into();
    let (axis, angle) = pose.rotation.axis_angle().unwrap_or((Vector3::z_axis(), 0.0));
    format!(r#"pos="{x} {y} {z}" axisangle="{} {} {} {angle}""#, axis.x, axis.y, axis.z)
}

/// A model of the arm and its gripper's fingers with our frames, and a mesh on joint 2's link and on finger 1.
fn model(robot: &RobotModel) -> String {
    let mut xml = format!(
        r#"<mujoco><compiler angle="radian" meshdir="files"/>
        <default><default class="seen"><geom type="mesh" contype="0" conaffinity="0"/></default></default>
        <asset><mesh file="a.obj" scale="1 1 2"/><material name="red" rgba="1 0 0 1"/></asset>
        <worldbody><body name="{}">"#,
        robot.base.name
    );
    for (index, joint) in robot.joints.iter().enumerate() {
        xml += &format!(r#"<body name="{}" {}><joint/>"#, joint.link.name, attributes(&joint.parent_from_joint));
        xml += if index == 1 { VISUAL } else { r#"<geom type="mesh" mesh="a"/>"# };
    }
    xml += &format!(r#"<body name="right_hand" {}>"#, attributes(&robot.last_from_flange));
    // The second finger's axis and zero are the other way round, as some packages have it.
    let flange_from_hand = robot.last_from_flange.inverse() * robot.gripper.last_from_hand;
    for (name, finger, axis, range) in [("leftfinger", 0, "0 1 0", "0 0.04"), ("rightfinger", 1, "0 -1 0", "-0.04 0")] {
        let pose = flange_from_hand * robot.gripper.fingers[finger].hand_from_finger;
        xml += &format!(r#"<body name="{name}" {}><joint type="slide" axis="{axis}" range="{range}"/>"#, attributes(&pose));
        xml += VISUAL;
        xml += "</body>";
    }
    xml + &"</body>".repeat(robot.joints.len() + 2) + "</worldbody></mujoco>"
}

/// `site/robots` as an installed package; its model is `text`.
fn package(text: &str) -> (tempfile::TempDir, PathBuf) {
    let site = tempfile::tempdir().unwrap();
    let folder = site.path().join("robots");
    fs::create_dir_all(folder.join("files")).unwrap();
    fs::write(folder.join("panda.xml"), text).unwrap();
    fs::write(folder.join("files/a.obj"), TETRAHEDRON).unwrap();
    for (information, owned) in [("other-1.dist-info", "other/x.py"), ("toy_robots-2.5.dist-info", "robots/panda.xml")] {
        let information = site.path().join(information);
        fs::create_dir_all(information.join("licenses")).unwrap();
        fs::write(information.join("METADATA"), "Name: toy-robots\nVersion: 2.5\nLicense: Toy-1.0\n\nName: no\n").unwrap();
        fs::write(information.join("RECORD"), format!("{owned},,\n")).unwrap();
    }
    fs::write(site.path().join("toy_robots-2.5.dist-info/licenses/LICENSE"), "Toy licence\nPlay nicely.\n").unwrap();
    (site, folder)
}

fn imported(robot: &RobotModel, from: &Path, out: &Path) -> Result<Import, String> {
    let prepare = || {
        fs::create_dir_all(out)?;
        Ok(out.to_owned())
    };
    import(robot, from, prepare).map_err(|failure| failure.to_string())
}

#[track_caller]
fn check_refused(text: &str, message: &str) {
    let (site, folder) = package(text);
    let out = site.path().join("out");
    let error = imported(&panda(), &folder, &out).unwrap_err();
    assert!(error.contains(message), "{error}");
    assert!(!out.exists(), "a refused package leaves nothing");
}

#[test]
fn a_packages_meshes_come_with_its_licence_in_our_frames() {
    let (site, folder) = package(&model(&panda()));
    let out = site.path().join("out");
    let import = imported(&panda(), &folder, &out).unwrap();
    let package = &import.list.package;
    assert_eq!((package.name.as_deref(), package.version.as_deref()), (Some("toy-robots"), Some("2.5")));
    assert_eq!(package.licence.as_deref(), Some("Toy-1.0"));
    assert_eq!(package.texts[0].file, "toy_robots-2.5.dist-info/licenses/LICENSE");
    assert_eq!(fs::read_to_string(out.join("LICENCE-1.txt")).unwrap(), "Toy licence\nPlay nicely.\n");
    assert_eq!(import.links_without.len(), link_names(&panda()).len() - 1, "{:?}", import.skipped);
    let meshes = read(&out).unwrap();
    assert_eq!(meshes.iter().map(|mesh| mesh.link).collect::<Vec<_>>(), ["link2"]);
    assert_eq!((meshes[0].scale, meshes[0].rgba), ([1.0, 1.0, 2.0], [1.0, 0.0, 0.0, 1.0]));
    assert_eq!(fs::read_to_string(&meshes[0].file).unwrap(), TETRAHEDRON);
    let gap = meshes[0].link_from_mesh.inverse() * Pose::translation(0.01, 0.0, 0.0);
    assert!(gap.translation.vector.norm() < 1e-12);
}

#[test]
fn fingers_match_whatever_the_sense_of_their_axis() {
    let robot = sawyer(DEFAULT_SLOT);
    let (site, folder) = package(&model(&robot));
    let import = imported(&robot, &folder, &site.path().join("out")).unwrap();
    assert_eq!(import.skipped, [""; 0]);
    let links: Vec<&str> = import.list.meshes.iter().map(|mesh| mesh.link.as_str()).collect();
    assert_eq!(links, ["right_l1", "left_finger", "right_finger"]);
    for mesh in &import.list.meshes {
        let pose = mesh.pose.to_pose().unwrap();
        assert!((pose.translation.vector.x - 0.01).abs() < 1e-9 && pose.translation.vector.norm() < 0.01 + 1e-9);
        assert!(rotation_distance(&pose.rotation, &Pose::identity().rotation) < 1e-6);
    }
}

#[test]
fn a_scene_of_ours_gives_its_meshes_back() {
    let (site, folder) = package("");
    let config = Config::load(None, &[]).unwrap();
    let scene = &scenes(&config, InstanceSet::Train).unwrap()[0];
    let mesh = |link, x| vmao_sim::LinkMesh {
        robot: "panda",
        link,
        file: folder.join("files/a.obj"),
        link_from_mesh: pose([x, 0.2, -0.1], [0.8, 0.0, -0.36, 0.48]),
        scale: [1.0, 2.0, 0.5],
        rgba: [0.25, 0.5, 0.75, 1.0],
    };
    let meshes = [mesh("link0", 0.0), mesh("link5", 0.1), mesh("hand", 0.2), mesh("left_finger", 0.3), mesh("right_finger", 0.4)];
    let text = scene.mjcf_with_meshes(&config.scene, &meshes).unwrap().replace("arm0/", "");
    fs::write(folder.join("panda.xml"), text).unwrap();
    let out = site.path().join("out");
    assert_eq!(imported(&panda(), &folder, &out).unwrap().skipped, [""; 0]);
    let back = read(&out).unwrap();
    assert_eq!(back.len(), meshes.len());
    for (back, mesh) in back.iter().zip(&meshes) {
        assert_eq!((back.link, back.scale, back.rgba), (mesh.link, mesh.scale, mesh.rgba));
        let gap = mesh.link_from_mesh.inverse() * back.link_from_mesh;
        assert!(gap.translation.vector.norm() < 1e-9 && gap.rotation.angle() < 1e-7, "{}", mesh.link);
    }
}

#[test]
fn a_package_without_licence_says_so() {
    let (site, folder) = package(&model(&panda()));
    fs::remove_dir_all(site.path().join("toy_robots-2.5.dist-info")).unwrap();
    let import = imported(&panda(), &folder, &site.path().join("out")).unwrap();
    assert_eq!(import.list.package, super::Package::default());
    assert!(import.list.package.summary().contains("none found; check yourself"));
}

#[test]
fn other_robots_are_refused_and_say_how_they_differ() {
    let text = model(&panda());
    check_refused(&text.replacen("0.0825", "0.0845", 1), "body `link4` is 2.0 mm from where our `link4` is on `link3`");
    check_refused(&text.replacen("<joint/>", r#"<joint axis="0 1 0"/>"#, 1), "the joint's axis of body `link1` is turned");
    check_refused(&text.replacen("<joint/>", "", 1), "body `link1` has other joints (0)");
    check_refused(&text.replacen("link3", "link33", 1), "no model of `panda`");
    check_refused("<robot/>", "no model of `panda`");
}

#[test]
fn hostile_packages_are_refused() {
    let text = model(&panda());
    let site = tempfile::tempdir().unwrap();
    let outside = site.path().join("secret.obj");
    fs::write(&outside, TETRAHEDRON).unwrap();
    check_refused(
        &text.replacen("a.obj", outside.to_str().unwrap(), 1).replacen("mesh file", r#"mesh name="a" file"#, 1),
        "outside",
    );
    let named = |file: &str| text.replacen(r#"mesh file="a.obj""#, &format!(r#"mesh name="a" file="{file}""#), 1);
    check_refused(&named("../../other-1.dist-info/METADATA"), "outside the package");
    check_refused(&named("none.obj"), "cannot be found");
    check_refused(&named("../panda.xml"), "kinds are: obj, stl, msh");
    check_refused(&text.replacen("0.01 0 0", "NaN 0 0", 1), "pos is `NaN 0 0`, expected 3 numbers");
    check_refused(&text.replacen("0.01 0 0", "1 0 0 0", 1), "expected 3 numbers");
    check_refused(&text.replacen("1 1 2", "1 0 2", 1), "a scale is 0");
    check_refused(&text.replacen(VISUAL, &VISUAL.repeat(600), 1), "expected at most 512");
    check_refused(&text.replacen(VISUAL, &"<site/>".repeat(100_000), 1), "not XML: ");
    check_refused(&text.replacen(VISUAL, &("<body>".repeat(5_000) + &"</body>".repeat(5_000)), 1), "more than 100 elements");
    check_refused("<mujoco", "not XML: ");
    check_refused(&text.replacen(VISUAL, r#"<geom class="seen" mesh="b"/>"#, 1), "no mesh is named `b`");
    check_refused(&(text + &" ".repeat(4 << 20)), "longer than 4194304 bytes");
}

#[cfg(unix)]
#[test]
fn a_link_out_of_the_package_is_refused() {
    let (site, folder) = package(&model(&panda()));
    fs::rename(folder.join("files/a.obj"), site.path().join("a.obj")).unwrap();
    std::os::unix::fs::symlink(site.path().join("a.obj"), folder.join("files/a.obj")).unwrap();
    let error = imported(&panda(), &folder, &site.path().join("out")).unwrap_err();
    assert!(error.contains("lies outside the package"), "{error}");
}

#[test]
fn lists_that_others_wrote_are_checked() {
    let (site, folder) = package(&model(&panda()));
    let out = site.path().join("out");
    imported(&panda(), &folder, &out).unwrap();
    let text = fs::read_to_string(out.join(LIST)).unwrap();
    let file = text.split('"').find(|word| word.ends_with(".obj")).unwrap().to_owned();
    for (from, to, message) in [
        (file.as_str(), "../a.obj", "is not the name of a file beside"),
        (file.as_str(), "/etc/passwd", "is not the name of a file beside"),
        (file.as_str(), "none.obj", "cannot be read"),
        ("link2", "link9", "panda has no link `link9`"),
        (r#""robot": "panda""#, r#""robot": "pandas""#, "has no robot `pandas`"),
        ("2.0\n", "0.0\n", "a factor is 0"),
        ("2.0\n", "1e999\n", "number out of range"),
    ] {
        assert!(text.contains(from), "{from}");
        fs::write(out.join(LIST), text.replacen(from, to, 1)).unwrap();
        let error = read(&out).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
}
