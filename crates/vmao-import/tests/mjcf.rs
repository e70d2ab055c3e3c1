//! MuJoCo models: what is taken over, and what is refused.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

mod fixture;

use fixture::{assert_close, assert_said, box_obj, extent, only_joint, refusal};
use std::fs;
use vmao_core::{object::JointKind, shape::Shape};
use vmao_import::{Import, Options, import, repairs::Quirk};

/// A laptop in degrees: classes, a frame, a mesh in millimetres, a joint whose drawn position is not zero.
const LAPTOP: &str = r#"<mujoco model="laptop"><compiler angle="degree" meshdir="files"/>
<default><default class="lid"><geom rgba="0 0 1 1"/><joint damping="0.5" frictionloss="0.25"/></default></default>
<asset><mesh name="screen" file="screen.obj" scale="0.001 0.001 0.001"/></asset>
<worldbody><light pos="0 0 3"/><geom type="plane" size="1 1 1"/>
<body name="base" pos="1 2 0.5">
  <geom type="box" size="0.1 0.075 0.005" mass="0.6" rgba="1 0 0 1"/>
  <body name="screen" childclass="lid" pos="0 0.075 0.005"><frame euler="0 0 180">
    <joint name="hinge" axis="1 0 0" range="10 90" ref="10"/><geom type="mesh" mesh="screen" mass="0.4"/></frame></body>
</body></worldbody></mujoco>"#;

#[track_caller]
fn imported(text: &str, options: &Options) -> Result<Import, String> {
    let directory = tempfile::tempdir().unwrap();
    fs::create_dir(directory.path().join("files")).unwrap();
    fs::write(directory.path().join("files/screen.obj"), box_obj([-100.0, 0.0, 0.0], [100.0, 150.0, 6.0], "")).unwrap();
    let path = directory.path().join("laptop.xml");
    fs::write(&path, text).unwrap();
    import(&path, options).map_err(|error| error.to_string())
}

#[track_caller]
fn check(changes: &[(&str, &str)]) -> Import {
    let text = changed(changes);
    imported(&text, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[track_caller]
fn changed(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(LAPTOP.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    })
}

#[track_caller]
fn check_refused(changes: &[(&str, &str)], message: &str) {
    let error = imported(&changed(changes), &Options::default()).unwrap_err();
    assert!(error.contains(message), "{error}");
}

#[test]
fn a_model_keeps_its_sizes_masses_colours_and_joints() {
    let import = check(&[]);
    let object = &import.object;
    assert_eq!((object.name.as_str(), object.parts.len()), ("laptop", 2));
    assert!(matches!(object.parts[0].solids[0].shape, Shape::Box { half_extents: [0.1, 0.075, 0.005] }));
    assert_eq!(object.parts[0].solids[0].color, [1.0, 0.0, 0.0]);
    assert_eq!(object.parts[1].solids[0].color, [0.0, 0.0, 1.0]);
    assert_close(&[object.parts[0].mass, object.parts[1].mass], &[0.6, 0.4], 1e-12);
    let joint = only_joint(object);
    assert_eq!((joint.kind, joint.damping, joint.friction), (JointKind::Revolute, 0.5, 0.25));
    // The model is drawn at 10 degrees, which is its lower limit and becomes zero; the frame turns the axis around.
    assert_close(&joint.limits.unwrap(), &[0.0, 80_f64.to_radians()], 1e-12);
    assert_close(joint.axis.as_slice(), &[-1.0, 0.0, 0.0], 1e-12);
    // Screen of 150 mm over the base, behind which it does not reach: both stand on the table.
    let ([low, high], [_, screen]) = (extent(object, 0), extent(object, 1));
    assert_close(&[low[2], high[2], screen[2]], &[0.0, 0.01, 0.016], 1e-9);
    assert_close(&[joint.anchor.y - high[1], joint.anchor.z], &[0.0, 0.01], 1e-9);
    assert_said(&import, Quirk::FixedToWorld, "`base` was fixed to the world");
}

#[test]
fn free_ball_and_slide_joints_and_several_on_one_body() {
    let free = check(&[(r#"<geom type="box""#, r#"<freejoint/><geom type="box""#)]);
    assert_eq!(free.object, check(&[]).object);
    let ball = check(&[(r#"axis="1 0 0" range="10 90" ref="10""#, r#"type="ball" range="0 60""#)]);
    let joint = only_joint(&ball.object);
    assert_eq!(joint.kind, JointKind::Ball);
    assert_close(&joint.limits.unwrap(), &[0.0, 60_f64.to_radians()], 1e-12);
    let two = r#"<joint name="out" type="slide" axis="0 0 1" range="-0.02 0.05"/><joint name="hinge""#;
    let import = check(&[(r#"<joint name="hinge""#, two)]);
    let joint = only_joint(&import.object);
    assert_eq!((joint.name.as_str(), joint.kind, joint.limits), ("out", JointKind::Prismatic, Some([-0.02, 0.05])));
    assert_said(&import, Quirk::HelperLink, "`out` stays, which slides, and `hinge` is held");
}

#[test]
fn one_of_several_bodies_is_chosen_by_name() {
    let other = r#"<body name="ball"><freejoint/><geom size="0.03" type="sphere"/></body></worldbody>"#;
    let text = changed(&[("</worldbody>", other)]);
    let error = imported(&text, &Options::default()).unwrap_err();
    assert!(error.contains("the world has 2 bodies, expected one object; choose one with --body: base, ball"), "{error}");
    let chosen = imported(&text, &Options { body: Some("ball".to_owned()), ..Options::default() }).unwrap();
    assert!(matches!(chosen.object.parts[0].solids[..], [ref ball] if matches!(ball.shape, Shape::Sphere { .. })));
    let error = imported(&text, &Options { body: Some("box".to_owned()), ..Options::default() }).unwrap_err();
    assert!(error.contains("the world has no body `box`; its bodies are: base, ball"), "{error}");
}

#[test]
fn solids_between_two_points_are_where_mujoco_has_them() {
    let capsule = r#"<geom type="capsule" fromto="0 0 0.1 0 0 0.3" size="0.02"/>"#;
    let import = check(&[(r#"<geom type="mesh" mesh="screen" mass="0.4"/>"#, capsule)]);
    let solid = &import.object.parts[1].solids[0];
    assert!(matches!(solid.shape, Shape::Capsule { radius: 0.02, half_length } if (half_length - 0.1).abs() < 1e-12));
    let [low, high] = extent(&import.object, 1);
    assert_close(&[low[2], high[2]], &[0.01 + 0.08, 0.01 + 0.32], 1e-9);
}

#[test]
fn models_that_are_not_understood_are_refused_with_their_place() {
    check_refused(&[("<worldbody>", r#"<include file="x.xml"/><worldbody>"#)], "<include>: other files are not included");
    check_refused(&[(r#"angle="degree""#, r#"coordinate="global""#)], "coordinate is `global`, expected `local`");
    check_refused(&[(r#"angle="degree""#, r#"eulerseq="zyx""#)], "eulerseq is `zyx`");
    check_refused(&[(r#"mesh="screen" mass"#, r#"mesh="scream" mass"#)], "no mesh is named `scream`");
    check_refused(&[(r#"file="screen.obj""#, r#"file="screen.msh""#)], "kinds are: obj, stl");
    check_refused(&[(r#"size="0.1 0.075 0.005""#, r#"size="0.1 -1 0.005""#)], "expected 3 numbers above 0");
    check_refused(&[(r#"range="10 90""#, r#"range="10 NaN""#)], "range is `10 NaN`, expected 2 numbers");
    check_refused(&[(r#"type="box""#, r#"type="blob""#)], "an object has no geom type `blob`");
    check_refused(&[(r#"<body name="screen""#, r#"<body name="base""#)], "two bodies are named `base`");
    let floating = [(r#"<joint name="hinge" axis="1 0 0" range="10 90" ref="10"/>"#, r#"<joint type="free"/>"#)];
    check_refused(&floating, "float");
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("a.xml"), "<mujoco/>").unwrap();
    assert!(refusal(&directory.path().join("a.xml")).contains("the world has no body"));
}
