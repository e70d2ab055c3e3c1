//! One test for each quirk of real PartNet-Mobility folders and URDF files (docs/import.md numbers them).
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

mod fixture;

use fixture::{Chest, URDF, assert_close, assert_said, box_obj, extent, only_joint, repairs};
use image::{DynamicImage, ImageFormat, RgbImage};
use nalgebra::Point3;
use std::{fs, io::Cursor};
use vmao_core::{
    object::JointKind,
    object_file::ObjectFile,
    shape::{Shape, Solid},
};
use vmao_import::{HelperMotion, Import, Options, UpAxis, repairs::Quirk};

const LIMIT: &str = r#"<limit lower="0" upper="1.5"/>"#;
const HINGE: &str = r#"type="revolute""#;

/// What every import must be, whatever it was made from.
#[track_caller]
fn check_whole(import: &Import) {
    let item = ObjectFile::new(&import.object, &[]).item().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(item.object.parts.len(), import.object.parts.len());
    let lowest = (0..import.object.parts.len()).map(|part| extent(&import.object, part)[0][2]).fold(f64::INFINITY, f64::min);
    assert!(lowest.abs() < 1e-9, "the lowest point is at {lowest}");
    for joint in &import.object.joints {
        assert!(joint.limits.is_none_or(|[low, high]| low <= 0.0 && high >= 0.0 && low < high), "{joint:?}");
        assert!(joint.damping > 0.0 && joint.friction > 0.0, "{joint:?}");
    }
    assert!(import.object.parts.iter().all(|part| part.mass >= 1e-3 && !part.solids.is_empty()));
}

/// Whether a point of the object's frame lies in a solid.
fn holds(solid: &Solid, point: &Point3<f64>) -> bool {
    let local = solid.carrier_from_solid.inverse_transform_point(point);
    let Shape::Convex(hull) = &solid.shape else { panic!("a hull was expected") };
    hull.faces().iter().all(|face| {
        let [a, b, c] = face.map(|corner| hull.vertices()[corner as usize]);
        (b - a).cross(&(c - a)).dot(&(local - a)) <= 1e-12
    })
}

#[test]
fn quirk_1_limits_without_effort_and_velocity_are_read() {
    let import = Chest::new().import();
    check_whole(&import);
    assert_said(&import, Quirk::IncompleteLimit, "effort or velocity");
    assert_eq!(only_joint(&import.object).limits, Some([0.0, 1.5]));
    let complete = Chest::with(&[(LIMIT, r#"<limit lower="0" upper="1.5" effort="1" velocity="1"/>"#)]).import();
    assert_eq!(repairs(&complete, Quirk::IncompleteLimit).len(), 0);
}

fn slider_plus() -> Chest {
    let helper = r#"<link name="link_0_helper"/><joint name="joint_2" type="continuous"><origin xyz="0 0 0"/><axis xyz="0 1 0"/>
        <child link="link_0"/><parent link="link_0_helper"/></joint></robot>"#;
    let child = r#"<axis xyz="1 0 0"/><child link="link_0"/>"#;
    Chest::with(&[
        ("</robot>", helper),
        (child, r#"<axis xyz="0 1 0"/><child link="link_0_helper"/>"#),
        (HINGE, r#"type="prismatic""#),
    ])
}

#[test]
fn quirk_2_a_helper_link_goes_and_one_of_its_joints_stays() {
    let import = slider_plus().import();
    check_whole(&import);
    let joint = only_joint(&import.object);
    assert_eq!((joint.name.as_str(), joint.kind), ("joint_0", JointKind::Prismatic));
    assert_close(joint.axis.as_slice(), &[0.0, 0.0, 1.0], 1e-9);
    assert_said(&import, Quirk::HelperLink, "`joint_0` stays, which slides, and `joint_2` is held");
    let turning = slider_plus().import_with(&Options { helper: HelperMotion::Turn, ..Options::default() });
    let joint = only_joint(&turning.object);
    assert_eq!((joint.name.as_str(), joint.kind, joint.limits), ("joint_2", JointKind::Revolute, None));
}

#[test]
fn quirk_3_masses_are_those_of_the_category_spread_by_volume() {
    let import = Chest::new().import_with(&Options { size: Some(0.25), ..Options::default() });
    let masses: Vec<f64> = import.object.parts.iter().map(|part| part.mass).collect();
    // A box of 0.25 m weighs 0.4 kg; the body is six times as thick as the lid.
    assert_close(&masses, &[0.4 * 6.0 / 7.0, 0.4 / 7.0], 1e-3);
    assert_said(&import, Quirk::Mass, "of a Box this size");
    let asked = Chest::new().import_with(&Options { mass: Some(0.7), ..Options::default() });
    assert_close(&[asked.object.parts.iter().map(|part| part.mass).sum()], &[0.7], 1e-9);
    let dense = r#"<inertial><mass value="759"/></inertial></link>"#;
    let absurd = Chest::with(&[("</link>", dense)]).import();
    assert!(absurd.object.parts.iter().map(|part| part.mass).sum::<f64>() < 0.5, "a file's 759 kg are not believed");
}

#[test]
fn quirk_4_lengths_are_scaled_and_angles_are_not() {
    let import = slider_plus().import_with(&Options { size: Some(0.2), ..Options::default() });
    // Two units become 0.2 m: the slide of 1.5 units becomes 0.15 m.
    assert_close(&only_joint(&import.object).limits.unwrap(), &[0.0, 0.15], 1e-9);
    let hinge = Chest::new().import_with(&Options { size: Some(0.2), ..Options::default() });
    assert_eq!(only_joint(&hinge.object).limits, Some([0.0, 1.5]));
    let [low, high] = extent(&hinge.object, 0);
    assert_close(&[high[1] - low[1]], &[0.2], 1e-9);
    assert_said(&hinge, Quirk::Size, "longest edge 2.0000 made 0.2000 m, as asked");
    // Unasked, every part is narrow enough for a gripper somewhere: the body's 0.6 of 2 units would be 75 mm at 0.25 m.
    let chosen = Chest::new().import();
    let [low, high] = extent(&chosen.object, 0);
    assert_close(&[high[2] - low[2]], &[0.07], 1e-6);
    assert_said(&chosen, Quirk::Size, "made smaller until each part is 70 mm wide somewhere");
}

#[test]
fn quirk_5_y_up_is_turned_to_z_up_exactly_once() {
    let turned = Chest::new().import();
    let raw = Chest::with(&[(r#"rpy="1.570796326794897 0 -1.570796326794897" "#, "")]).import();
    for import in [&turned, &raw] {
        check_whole(import);
        let [low, high] = extent(&import.object, 0);
        let scale = 0.07 / 0.6;
        assert_close(&[high[0] - low[0], high[1] - low[1], high[2] - low[2]], &[scale, 2.0 * scale, 0.07], 1e-6);
        assert!(extent(&import.object, 1)[0][2] > high[2] - 1e-9, "the lid is on top");
    }
    assert_said(&raw, Quirk::UpAxis, "no joint turned it");
    let as_it_is = Chest::new().import_with(&Options { up: UpAxis::Z, ..Options::default() });
    assert_eq!(as_it_is.object, turned.object);
}

#[test]
fn quirk_6_the_root_is_let_go_of_the_world() {
    let import = Chest::new().import();
    let names: Vec<&str> = import.object.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["chest_body", "lid"]);
    assert_said(&import, Quirk::FixedToWorld, "`link_1` was fixed to the world: let go");
}

#[test]
fn quirk_7_fixed_links_become_one_part_in_their_places() {
    let handle = r#"<link name="link_2"><visual name="handle-3"><geometry><box size="0.2 0.2 0.2"/></geometry></visual></link>
        <joint name="joint_2" type="fixed"><origin xyz="0 0 0.6"/><child link="link_2"/><parent link="link_1"/></joint></robot>"#;
    let import = Chest::with(&[("</robot>", handle)]).import_with(&Options { size: Some(0.2), ..Options::default() });
    check_whole(&import);
    assert_eq!(import.object.parts.len(), 2);
    assert_said(&import, Quirk::FixedJoint, "`link_2` does not move relative to `link_1`");
    // Raw z is -x then; the handle ends at 0.7 units.
    let [low, high] = extent(&import.object, 0);
    assert_close(&[high[0] - low[0]], &[0.12], 1e-9);
}

#[test]
fn quirk_8_limits_that_mean_nothing_become_none() {
    for (limit, said) in [
        ("", "without limits: endless"),
        (r#"<limit lower="0.3" upper="0.3"/>"#, "between 0.3 and 0.3 rad: endless"),
        (r#"<limit lower="1" upper="-1"/>"#, "between 1 and -1 rad"),
        (r#"<limit lower="0" upper="inf"/>"#, "between 0 and inf rad"),
        (r#"<limit lower="-1e308" upper="1e308"/>"#, "endless"),
        (r#"<limit effort="3"/>"#, "without limits"),
    ] {
        let import = Chest::with(&[(LIMIT, limit)]).import();
        check_whole(&import);
        assert_eq!(only_joint(&import.object).limits, None, "{limit}");
        assert_said(&import, Quirk::Limits, said);
    }
    let limited = Chest::with(&[(HINGE, r#"type="continuous""#)]).import();
    assert_eq!(only_joint(&limited.object).limits, Some([0.0, 1.5]), "a continuous joint with limits has them");
    let slide = Chest::with(&[(HINGE, r#"type="prismatic""#), (LIMIT, "")])
        .import_with(&Options { size: Some(0.2), ..Options::default() });
    assert_close(&only_joint(&slide.object).limits.unwrap(), &[-0.05, 0.05], 1e-9);
    assert_said(&slide, Quirk::Limits, "slides without limits");
}

#[test]
fn quirk_9_zero_outside_the_limits_moves_zero() {
    let inside = Chest::new().import();
    let outside = Chest::with(&[(LIMIT, r#"<limit lower="-1.2" upper="-0.4"/>"#)]).import();
    check_whole(&outside);
    assert_close(&only_joint(&outside.object).limits.unwrap(), &[-0.8, 0.0], 1e-9);
    assert_said(&outside, Quirk::ZeroOutsideLimits, "placed at -0.4, which becomes zero");
    // Turned by -0.4 rad about the raw x axis at the back edge, the lid stands open; its hinge stays where it was.
    let ([_, closed], [_, open]) = (extent(&inside.object, 1), extent(&outside.object, 1));
    assert!(open[2] > closed[2] + 0.01, "{open:?} {closed:?}");
}

#[test]
fn quirk_10_names_are_unique_and_safe() {
    let same = Chest::with(&[("body-1", "same"), ("lid-2", "same"), ("joint_0", "joint &lt;0&gt;")]);
    same.write("semantics.txt", "link_0 hinge part\nlink_1 free part\n");
    let import = same.import();
    check_whole(&import);
    let names: Vec<&str> = import.object.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["part", "part-2"]);
    assert_eq!(only_joint(&import.object).name, "joint__0_");
    assert_said(&import, Quirk::Name, "`part-2`");
}

#[test]
fn quirk_11_visual_offsets_put_meshes_back_from_the_pivot() {
    let import = Chest::new().import_with(&Options { size: Some(2.0), ..Options::default() });
    // At two metres the object has the file's own lengths: body 0.6 high, lid 0.1 on top, pivot at the edge between.
    let joint = only_joint(&import.object);
    assert_close(&[joint.anchor.x, joint.anchor.z], &[0.5, 0.6], 1e-9);
    assert_close(joint.axis.as_slice(), &[0.0, -1.0, 0.0], 1e-9);
    let [low, high] = extent(&import.object, 1);
    assert_close(&low, &[-0.5, -1.0, 0.6], 1e-9);
    assert_close(&high, &[0.5, 1.0, 0.7], 1e-9);
}

/// A body of two blocks in the shape of an L, open at both ends and with its faces the wrong way round.
fn angle_obj() -> String {
    let profile = [[-1.0, -0.3], [1.0, -0.3], [1.0, -0.1], [-0.8, -0.1], [-0.8, 0.3], [-1.0, 0.3]];
    let mut text = String::new();
    for z in [-0.5, 0.5] {
        profile.iter().for_each(|[x, y]| text += &format!("v {x} {y} {z}\n"));
    }
    (0..6).for_each(|side| text += &format!("f {} {} {} {}\n", side + 1, side + 7, (side + 1) % 6 + 7, (side + 1) % 6 + 1));
    text
}

#[test]
fn quirk_12_open_meshes_with_dents_become_hulls() {
    let chest = Chest::new();
    chest.write("textured_objs/original-1.obj", angle_obj());
    let import = chest.import_with(&Options { size: Some(2.0), ..Options::default() });
    check_whole(&import);
    assert_said(&import, Quirk::NotConvex, "decomposed into");
    assert!(import.object.parts[0].solids.len() >= 2);
    let notch = Point3::new(0.0, 0.5, 0.4);
    assert!(import.object.parts[0].solids.iter().all(|solid| !holds(solid, &notch)), "the notch is filled");
}

#[test]
fn quirk_13_flat_meshes_and_single_triangles_get_a_thickness() {
    for mesh in ["v -1 0 -0.5\nv 1 0 -0.5\nv 1 0 0.5\nv -1 0 0.5\nf 1 2 3 4\n", "v -1 0 -0.5\nv 1 0 -0.5\nv 1 0 0.5\nf 1 2 3\n"] {
        let chest = Chest::new();
        chest.write("textured_objs/original-2.obj", mesh);
        let import = chest.import();
        check_whole(&import);
        assert_said(&import, Quirk::FlatMesh, "given a thickness");
    }
}

#[test]
fn quirk_14_a_hollow_stays_hollow() {
    let chest = Chest::new();
    let walls = [
        ([-1.0, -0.3, -0.5], [1.0, -0.2, 0.5]),
        ([-1.0, -0.3, -0.5], [-0.9, 0.3, 0.5]),
        ([0.9, -0.3, -0.5], [1.0, 0.3, 0.5]),
        ([-1.0, -0.3, -0.5], [1.0, 0.3, -0.4]),
        ([-1.0, -0.3, 0.4], [1.0, 0.3, 0.5]),
    ];
    let mut text = String::new();
    for (index, (low, high)) in walls.into_iter().enumerate() {
        // All walls in one object of the file, so that nothing says where one ends.
        let wall = box_obj(low, high, "");
        let shifted = wall.lines().map(|line| match line.strip_prefix("f ") {
            None => format!("{line}\n"),
            Some(corners) => {
                let moved = corners.split(' ').map(|corner| (corner.parse::<usize>().unwrap() + 8 * index).to_string());
                format!("f {}\n", moved.collect::<Vec<_>>().join(" "))
            }
        });
        text += &shifted.collect::<String>();
    }
    chest.write("textured_objs/original-1.obj", text);
    let import = chest.import_with(&Options { size: Some(2.0), ..Options::default() });
    check_whole(&import);
    let inside = Point3::new(0.0, 0.0, 0.4);
    assert!(import.object.parts[0].solids.iter().all(|solid| !holds(solid, &inside)), "a finger cannot enter");
    let volume: f64 = import.object.parts[0].solids.iter().map(|solid| solid.shape.volume()).sum();
    assert!(volume < 0.75 * 1.2, "{volume} of the whole's 1.2 m³");
}

#[test]
fn quirk_15_colours_come_from_the_material_file() {
    let import = Chest::new().import();
    let color = |part: usize| import.object.parts[part].solids[0].color.map(f64::from);
    assert_close(&color(0), &[0.5, 0.25, 0.125], 1e-6);
    assert_close(&color(1), &[1.0, 0.0, 0.0], 1e-6);
    let lid = import.pictures.iter().find(|picture| picture.file == "lid-0.mtl").unwrap();
    assert_eq!(std::str::from_utf8(&lid.bytes).unwrap(), "newmtl looks\nKd 1 0 0\nd 0.5\n");
    let object = import.pictures.iter().find(|picture| picture.file == "lid-0.obj").unwrap();
    assert_eq!(object.part, Some(1));
    let painted = Chest::with(&[("</visual>", r#"<material name="m"><color rgba="0 1 0 1"/></material></visual>"#)]).import();
    assert_close(&painted.object.parts[0].solids[0].color.map(f64::from), &[0.0, 1.0, 0.0], 1e-6);
    let chest = Chest::new();
    fs::remove_file(chest.path().join("textured_objs/original-2.mtl")).unwrap();
    assert_said(&chest.import(), Quirk::Colour, "not there: grey");
}

/// An image of this colour.
fn encoded(color: [u8; 3], format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    DynamicImage::ImageRgb8(RgbImage::from_pixel(16, 8, image::Rgb(color))).write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

#[test]
fn quirk_16_jpeg_textures_become_png() {
    let chest = Chest::new();
    chest.write("images/texture_0.jpg", encoded([0, 0, 255], ImageFormat::Jpeg));
    chest.write("textured_objs/original-1.mtl", "newmtl wood\nKd 1 1 1\nmap_Kd ../images/texture_0.jpg\n");
    let import = chest.import();
    assert_said(&import, Quirk::Texture, "JPEG made PNG");
    let png = import.pictures.iter().find(|picture| picture.file == "texture-0.png").unwrap();
    assert_eq!(image::guess_format(&png.bytes).unwrap(), ImageFormat::Png);
    let mtl = import.pictures.iter().find(|picture| picture.file == "chest_body-0.mtl").unwrap();
    assert!(std::str::from_utf8(&mtl.bytes).unwrap().contains("map_Kd texture-0.png"));
    let [r, g, b] = import.object.parts[0].solids[0].color;
    assert!(r < 0.02 && g < 0.02 && b > 0.98, "the texture's mean colour, not the material's: {r} {g} {b}");
    fs::remove_file(chest.path().join("images/texture_0.jpg")).unwrap();
    assert_said(&chest.import(), Quirk::Texture, "not there");
}

#[test]
fn quirk_17_paths_of_packages_and_of_other_systems_are_found() {
    let package = Chest::with(&[("textured_objs/original-1.obj", "package://chest/textured_objs/original-1.obj")]).import();
    assert_said(&package, Quirk::Path, "package");
    let other = Chest::with(&[("textured_objs/original-1.obj", "textured_objs\\original-1.obj")]).import();
    assert_said(&other, Quirk::Path, "backslashes");
    assert_eq!(package.object, other.object);
}

#[test]
fn quirk_18_parts_that_overlap_and_are_not_joined_are_cut_apart() {
    // Two lids side by side on one body that reach 0.1 units into each other.
    let second = r#"<link name="link_2"><collision><geometry><box size="1.1 0.1 1"/></geometry></collision></link>
        <joint name="joint_2" type="revolute"><origin xyz="0.45 0.35 0"/><axis xyz="1 0 0"/><child link="link_2"/>
        <parent link="link_1"/><limit lower="0" upper="1"/></joint></robot>"#;
    let chest = Chest::with(&[("</robot>", second)]);
    chest.write("textured_objs/original-2.obj", box_obj([-1.0, 0.3, -0.5], [0.0, 0.4, 0.5], ""));
    let import = chest.import_with(&Options { size: Some(2.0), ..Options::default() });
    check_whole(&import);
    assert_said(&import, Quirk::Overlap, "cut back to a plane between them");
    // Raw x is -y now; the first ends where the second begins.
    let (first, second) = (extent(&import.object, 1), extent(&import.object, 2));
    assert!(first[0][1] >= second[1][1] - 1e-6, "{first:?} {second:?}");
    assert_close(&[second[1][1] - second[0][1]], &[1.05], 1e-6);
}

#[test]
fn quirk_19_axes_are_made_unit_and_default_to_x() {
    let long = Chest::with(&[(r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="250 0 0"/>"#)]).import();
    assert_said(&long, Quirk::Axis, "an axis of length 250.0000 brought to 1");
    let missing = Chest::with(&[(r#"<axis xyz="1 0 0"/>"#, "")]).import();
    assert_said(&missing, Quirk::Axis, "no axis: x");
    assert_eq!(long.object, missing.object);
    let zero = Chest::with(&[(r#"<axis xyz="1 0 0"/>"#, r#"<axis xyz="0 0 0"/>"#)]).refusal();
    assert!(zero.contains("line 16, column 31: <axis>: the axis is [0.0, 0.0, 0.0], expected a direction"), "{zero}");
}

#[test]
fn quirk_20_joints_resist_as_their_category_does() {
    let import = Chest::new().import();
    let joint = only_joint(&import.object);
    assert_eq!((joint.damping, joint.friction), (0.02, 0.08));
    assert_said(&import, Quirk::Resistance, "damping none: 0.02");
    let given = Chest::with(&[(LIMIT, r#"<limit lower="0" upper="1.5"/><dynamics damping="0.3" friction="0.2"/>"#)]).import();
    let joint = only_joint(&given.object);
    assert_eq!((joint.damping, joint.friction), (0.3, 0.2));
    let absurd = Chest::with(&[(LIMIT, r#"<limit lower="0" upper="1.5"/><dynamics damping="-3" friction="9999"/>"#)]).import();
    let joint = only_joint(&absurd.object);
    assert_eq!((joint.damping, joint.friction), (0.02, 0.08));
}

#[test]
fn quirk_21_hulls_are_capped_and_kept() {
    let chest = Chest::new();
    chest.write("textured_objs/original-1.obj", angle_obj());
    let cache = chest.path().join("kept");
    let options = |cache: bool| Options { hulls: Some(2), cache: cache.then(|| chest.path().join("kept")), ..Options::default() };
    let fresh = chest.import_with(&options(false));
    assert!(fresh.object.parts[0].solids.len() <= 2);
    let first = chest.import_with(&options(true));
    let kept: Vec<_> = fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(kept.len(), 1);
    let second = chest.import_with(&options(true));
    assert!(fresh.object == first.object && first.object == second.object, "kept hulls are the same to the last bit");
    // What is kept is read and checked, not trusted: other hulls there are taken, damaged ones are made again.
    let text = fs::read_to_string(&kept[0]).unwrap();
    for damaged in
        ["", "[]", "[{\"vertices\":[[0,0,0]],\"faces\":[[0,0,9]]}]", &text[..text.len() / 2], &text.replacen("0.", "9.", 1)]
    {
        fs::write(&kept[0], damaged).unwrap();
        assert_eq!(chest.import_with(&options(true)).object, first.object);
        assert_eq!(fs::read_to_string(&kept[0]).unwrap(), text, "a damaged file is replaced");
    }
}

#[test]
fn worked_over_descriptions_are_preferred_and_junk_is_left_out() {
    let chest = Chest::new();
    chest.write("mobility_cvx.urdf", URDF.replace("upper=\"1.5\"", "upper=\"1.25\""));
    assert_eq!(only_joint(&chest.import().object).limits, Some([0.0, 1.25]));
    let junk = r#"[{"id":0,"parent":1,"joint":"junk","name":"lid"},{"id":1,"parent":-1,"joint":"free","name":"body"}]"#;
    chest.write("mobility_v2.json", junk);
    let import = chest.import();
    assert_eq!((import.object.parts.len(), import.object.joints.len()), (1, 0));
    assert_said(&import, Quirk::Ignored, "junk");
}
