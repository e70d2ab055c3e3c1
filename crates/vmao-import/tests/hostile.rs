//! Files that were made, or came about, to do harm: each is refused with a place and a reason, in bounded memory and time.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod fixture;

use fixture::{Chest, URDF, box_obj, refusal};
use image::{DynamicImage, ImageFormat, RgbImage};
use std::{fmt::Write, fs, io::Cursor};
use vmao_import::{Options, import};

const MESH: &str = "textured_objs/original-1.obj";
const AXIS: &str = r#"<axis xyz="1 0 0"/>"#;

#[track_caller]
fn check(chest: &Chest, message: &str) {
    let error = chest.refusal();
    assert!(error.contains(message), "{error}");
    assert!(error.len() < 2000 && !error.contains('\u{1b}'), "{error}");
}

#[track_caller]
fn check_urdf(changes: &[(&str, &str)], message: &str) {
    check(&Chest::with(changes), message);
}

#[track_caller]
fn check_file(name: &str, content: impl AsRef<[u8]>, message: &str) {
    let chest = Chest::new();
    chest.write(name, content);
    check(&chest, message);
}

#[test]
fn paths_do_not_leave_the_folder() {
    let outside = tempfile::NamedTempFile::new().unwrap();
    let name = format!("{}.obj", outside.path().display());
    fs::write(&name, box_obj([0.0; 3], [1.0; 3], "")).unwrap();
    let climb = format!("{}{}", "../".repeat(40), name.trim_start_matches('/'));
    for path in [name.clone(), climb.clone(), format!("file://{name}"), format!("package://{climb}"), climb.replace('/', "\\")] {
        check_urdf(&[(MESH, &path)], "lies outside");
    }
    check_file("textured_objs/original-1.mtl", format!("newmtl wood\nmap_Kd {climb}\n"), "lies outside");
    check_file(MESH, box_obj([0.0; 3], [1.0; 3], &format!("mtllib {climb}")), "lies outside");
    fs::remove_file(name).unwrap();
}

#[cfg(unix)]
#[test]
fn links_and_pipes_do_not_lead_outside() {
    let chest = Chest::new();
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = elsewhere.path().join("a.obj");
    fs::rename(chest.path().join(MESH), &moved).unwrap();
    std::os::unix::fs::symlink(&moved, chest.path().join(MESH)).unwrap();
    check(&chest, "lies outside");
    let chest = Chest::new();
    fs::remove_file(chest.path().join(MESH)).unwrap();
    std::os::unix::fs::symlink("/dev/zero", chest.path().join(MESH)).unwrap();
    check(&chest, "lies outside");
    std::os::unix::net::UnixListener::bind(chest.path().join("socket.obj")).unwrap();
    chest.write("mobility.urdf", URDF.replace(MESH, "socket.obj"));
    check(&chest, "is not a plain file");
}

#[test]
fn entities_are_not_expanded() {
    let laughs = (0..10).fold(r#"<!DOCTYPE robot [<!ENTITY l0 "ha">"#.to_owned(), |text, level| {
        format!("{text}<!ENTITY l{} \"{}\">", level + 1, format!("&l{level};").repeat(10))
    });
    check_file("mobility.urdf", format!("{laughs}]><robot name=\"&l10;\"/>"), "not XML");
    let outside = r#"<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>"#;
    check_file("mobility.urdf", outside, "not XML");
}

#[test]
fn numbers_are_finite_and_bounded() {
    for number in ["NaN", "inf", "1e308", "-1e5", "1e999", "0x1", "1,5"] {
        let axis = format!(r#"<axis xyz="{number} 0 0"/>"#);
        check_urdf(&[(AXIS, &axis)], "line 16, column 31: <axis>: xyz is");
        let origin = format!(r#"<origin xyz="0 {number} -0.5"/>"#);
        check_urdf(&[(r#"<origin xyz="0 0.3 -0.5"/>"#, &origin)], "expected 3 numbers");
    }
    check_urdf(&[(r#"upper="1.5""#, r#"upper="NaN""#)], "upper is `NaN`, expected a number");
    for number in ["nan", "inf", "1e7", "-1e308", "x", ""] {
        check_file(MESH, format!("v 0 0 {number}\n"), "original-1.obj: line 1:");
        check_file("textured_objs/original-1.mtl", format!("newmtl wood\nKd 0 0 {number}\n"), "original-1.mtl: line 2:");
    }
    check_file(
        "bounding_box.json",
        r#"{"min": [0, 0, 0], "max": [1, 1, 1e999]}"#,
        "bounding_box.json: line 1, column 38: number out of range",
    );
    check_file("bounding_box.json", r#"{"min": [0, 0, 2], "max": [1, 1, 1]}"#, "are no box");
}

#[test]
fn meshes_have_a_bounded_number_of_faces_and_vertices() {
    let mut faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    (0..1_000_000).for_each(|_| faces.push_str("f 1 2 3\n"));
    check_file(MESH, faces, "more than 400000 faces, the most that is read");
    let mut vertices = String::new();
    (0..700_000).for_each(|index| writeln!(vertices, "v {index} 0 0").unwrap());
    check_file(MESH, vertices, "more than 600000 vertices");
    let fan = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}\n", " 1 2 3".repeat(1000));
    check_file(MESH, fan, "more than 1024 corners");
    let chest = Chest::with(&[("textured_objs/original-1.obj", "a.stl")]);
    chest.write("a.stl", [&[0_u8; 80][..], &u32::MAX.to_le_bytes(), &[0; 100]].concat());
    check(&chest, "4294967295 faces, expected at most");
    chest.write("a.stl", [&[0_u8; 80][..], &3_u32.to_le_bytes(), &[0; 100]].concat());
    check(&chest, "184 bytes for 3 faces, expected 234");
    chest.write("a.stl", [&[0_u8; 80][..], &1_u32.to_le_bytes(), &[0xff; 50]].concat());
    check(&chest, "expected finite numbers");
    // Each file for itself is small enough; all together are not.
    let many: String =
        (0..5).map(|index| format!(r#"<visual><geometry><mesh filename="m{index}.obj"/></geometry></visual>"#)).collect();
    let chest = Chest::with(&[("</link>", &format!("{many}</link>"))]);
    let mut faces = box_obj([0.0; 3], [1.0; 3], "");
    (0..390_000).for_each(|_| faces.push_str("f 1 2 3\n"));
    (0..5).for_each(|index| chest.write(&format!("m{index}.obj"), &faces));
    check(&chest, "faces in all, the most that is read");
}

#[test]
fn faces_name_vertices_that_are_there() {
    for face in
        ["f 1 2 4", "f 0 1 2", "f 1 2 -4", "f 1 2 99999999999999999999", "f 1 2 -9223372036854775808", "f 1/1 2/2 3/3", "f a b c"]
    {
        check_file(MESH, format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{face}\n"), "line 4: a face names");
    }
    check_file(MESH, "v 0 0 0\nv 1 0 0\nf 1 2\n", "line 3: a face with 2 corners");
    check_file(MESH, "v 0 0 0\nv 1 0 0\nv 2 0 0\n", "no faces");
}

#[test]
fn joints_form_one_tree() {
    let end = "</robot>";
    let joint = |name: &str, parent: &str, child: &str| {
        format!(r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/></joint>"#)
    };
    let extra = |content: String| content + end;
    check_urdf(&[(end, &extra(joint("j", "link_0", "base")))], "go around in a circle");
    check_urdf(&[(end, &extra(joint("j", "base", "link_0")))], "is the child of two joints, `joint_0` and `j`");
    check_urdf(
        &[(end, &extra(r#"<link name="stray"/>"#.to_owned()))],
        "2 links are the child of no joint, expected one root: base, stray",
    );
    let ring = format!(r#"<link name="a"/><link name="b"/>{}{}"#, joint("j", "a", "b"), joint("k", "b", "a"));
    check_urdf(&[(end, &extra(ring))], "go around in a circle, expected a tree: j, k");
    check_urdf(&[(end, &extra(joint("j", "link_0", "link_0")))], "connects link `link_0` to itself");
    check_urdf(&[(end, &extra(joint("j", "link_0", "lid")))], "has no link `lid`; links are: base, link_1, link_0");
    check_urdf(&[(end, &extra(r#"<link name="link_0"/>"#.to_owned()))], "two links are named `link_0`");
    check_urdf(&[("joint_1", "joint_0")], "two joints are named `joint_0`");
    let links: String = (0..300).map(|index| format!(r#"<link name="l{index}"/>"#)).collect();
    check_urdf(&[(end, &extra(links))], "more than 256 links");
    check_urdf(&[("revolute", "screw")], "an object has no joint type `screw`; joint types are: revolute");
}

#[test]
fn links_without_shape_cannot_hold_others_together() {
    check_urdf(
        &[
            (r#"type="fixed""#, r#"type="revolute""#),
            ("<link name=\"base\"/>", "<link name=\"base\"/><link name=\"x\"/>"),
            (
                "</robot>",
                r#"<link name="y"><visual><geometry><sphere radius="1"/></geometry></visual></link>
        <joint name="j2" type="fixed"><parent link="base"/><child link="x"/></joint>
        <joint name="j3" type="revolute"><parent link="x"/><child link="y"/></joint></robot>"#,
            ),
        ],
        "the root `x` has no shape and joins several parts",
    );
    check_file("mobility.urdf", r#"<robot name="r"><link name="a"/></robot>"#, "no link has a visual or a collision shape");
    check_file("mobility.urdf", "<robot/>", "mobility.urdf: no links");
}

#[test]
fn files_are_there_and_are_files() {
    let chest = Chest::new();
    fs::remove_file(chest.path().join(MESH)).unwrap();
    check(&chest, "textured_objs/original-1.obj: cannot be found");
    fs::create_dir(chest.path().join(MESH)).unwrap();
    check(&chest, "is not a plain file");
    let chest = Chest::new();
    fs::remove_file(chest.path().join("mobility.urdf")).unwrap();
    check(&chest, "no PartNet-Mobility folder: has none of mobility_cvx.urdf");
    fs::create_dir(chest.path().join("mobility.urdf")).unwrap();
    check(&chest, "is not a plain file");
    assert!(refusal(&chest.path().join("none.urdf")).contains("cannot be found"));
    check_urdf(&[(MESH, "a\u{1}b.obj")], "not XML");
    check_urdf(&[(MESH, "mobility.urdf")], "a mesh of kind `urdf`; kinds are: obj, stl");
    for (name, message) in [("mobility.urdf", "not XML"), (MESH, "no faces"), ("meta.json", "line 1, column 1: EOF")] {
        check_file(name, "", message);
    }
    check_file("mobility.urdf", " ".repeat(5 << 20), "longer than 4194304 bytes");
}

#[test]
fn texts_are_utf_8() {
    let utf16: Vec<u8> = [0xff, 0xfe].into_iter().chain(URDF.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    for name in ["mobility.urdf", "meta.json", "semantics.txt", MESH, "textured_objs/original-1.mtl"] {
        check_file(name, &utf16, "UTF-16 text, expected UTF-8");
    }
    let latin = URDF.replace("body-1", "k\u{e4}se").chars().map(|letter| letter as u8).collect::<Vec<u8>>();
    check_file("mobility.urdf", latin, "line 5, column 20: byte 0xe4 is not UTF-8 text");
    let chest = Chest::new();
    chest.write("mobility.urdf", format!("\u{feff}{}", URDF.trim_start()));
    chest.import();
}

fn encoded(format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let noise = RgbImage::from_fn(64, 64, |x, y| image::Rgb([(x * 31 + y * 17) as u8, (x * y) as u8, 7]));
    DynamicImage::ImageRgb8(noise).write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A PNG that says it is this large, and ends there.
fn huge_png(edge: u32) -> Vec<u8> {
    let mut bytes = encoded(ImageFormat::Png);
    bytes[16..20].copy_from_slice(&edge.to_be_bytes());
    bytes[20..24].copy_from_slice(&edge.to_be_bytes());
    // The header's checksum (CRC-32) over type and data.
    let mut crc = u32::MAX;
    for &byte in &bytes[12..29] {
        crc ^= u32::from(byte);
        (0..8).for_each(|_| crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 });
    }
    bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
    bytes
}

#[test]
fn images_are_whole_and_bounded() {
    let check_image = |bytes: &[u8], message: &str| {
        let chest = Chest::new();
        chest.write("textured_objs/original-1.mtl", "newmtl wood\nmap_Kd t.png\n");
        chest.write("textured_objs/t.png", bytes);
        check(&chest, message);
    };
    let png = encoded(ImageFormat::Png);
    check_image(&png[..png.len() / 2], "not a whole PNG image");
    check_image(&huge_png(60_000), "not a whole PNG image of at most 4096 by 4096");
    check_image(&huge_png(4097), "not a whole PNG image of at most 4096 by 4096");
    let jpeg = encoded(ImageFormat::Jpeg);
    check_image(&jpeg[..60], "not a whole JPEG image");
    check_image(&jpeg[..jpeg.len() / 2], "not a whole JPEG image");
    check_image(b"GIF89a\x01\0\x01\0\0\0\0", "neither a PNG nor a JPEG image");
    check_image(b"", "neither a PNG nor a JPEG image");
}

#[test]
fn nesting_is_bounded() {
    let deep = format!("<robot>{}{}</robot>", "<a>".repeat(5000), "</a>".repeat(5000));
    check_file("mobility.urdf", deep, "more than 100 elements inside one another");
    check_file("mobility.urdf", format!("<robot>{}</robot>", "<a/>".repeat(200_000)), "not XML");
    check_file("mobility_v2.json", r#"[{"id": 1, "parts": "#.to_owned() + &"[".repeat(100_000), "EOF while parsing a list");
    let body = format!("<mujoco><worldbody>{}{}</worldbody></mujoco>", "<body>".repeat(3000), "</body>".repeat(3000));
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("a.xml"), body).unwrap();
    assert!(refusal(&directory.path().join("a.xml")).contains("more than 100 elements"));
}

#[test]
fn hostile_names_do_not_reach_the_terminal() {
    let name = "\u{1b}[31m".replace('\u{1b}', "\u{9b}") + &"x".repeat(5000);
    let chest = Chest::with(&[(r#"<parent link="link_1"/>"#, &format!(r#"<parent link="{name}"/>"#))]);
    let error = chest.refusal();
    assert!(error.len() < 500 && !error.contains('\u{9b}'), "{error}");
    let import = import(Chest::with(&[("joint_0", &name)]).path(), &Options::default()).unwrap();
    let text = serde_json::to_string(&import.repairs).unwrap();
    assert!(!text.contains('\u{9b}') && import.object.joints[0].name.len() <= 64);
}
