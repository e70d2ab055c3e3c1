//! Writes the scene as MJCF: the exact model that trials run on, loadable by MuJoCo alone.

use crate::convention::{hull_element, inertial_element, pose_attributes, shape_attributes};
use crate::link_meshes::{self, Dress, LinkMesh};
use crate::scene::SceneConfig;
use std::fmt::Write;
use vmao_core::collision::Obstacle;
use vmao_core::contact::PartId;
use vmao_core::geometry::Pose;
use vmao_core::object::{ArticulatedObject, Joint, JointKind};
use vmao_core::robots::{Gripper, Link, RobotModel};
use vmao_core::shape::{Shape, Solid};

/// Half the table's edges along x and y (m), and its colour.
pub(crate) const TABLE_HALF_WIDTHS: [f64; 2] = [1.0, 0.8];
pub(crate) const TABLE_COLOR: [f32; 3] = [0.82, 0.78, 0.72];

/// Name of the body of an object part.
pub(crate) fn part_name(part: &str) -> String {
    format!("object/{part}")
}

/// Name of a solid of a part, and of its mesh.
fn part_solid_name(part: &str, index: usize) -> String {
    format!("{}/{index}", part_name(part))
}

/// Name of an obstacle, and of its mesh.
fn obstacle_name(index: usize) -> String {
    format!("obstacle{index}")
}

/// Name of a body, joint or actuator of an arm.
pub(crate) fn arm_name(arm: usize, name: &str) -> String {
    format!("arm{arm}/{name}")
}

/// The whole scene. Collision: everything meets everything, except neighbouring links of one arm and joined parts.
pub(crate) fn scene(
    config: &SceneConfig,
    robots: &[RobotModel],
    bases: &[Pose],
    object: &ArticulatedObject,
    meshes: &[LinkMesh],
) -> String {
    let mut xml = String::new();
    header(&mut xml, config, robots);
    xml.push_str(&link_meshes::assets(meshes));
    for part in &object.parts {
        hulls(&mut xml, part.solids.iter().enumerate().map(|(index, solid)| (part_solid_name(&part.name, index), solid)));
    }
    line(&mut xml, "<worldbody>");
    line(&mut xml, r#"<light pos="0 0 2.5" dir="0 0 -1" diffuse="0.7 0.7 0.7"/>"#);
    let ([x, y], [r, g, b]) = (TABLE_HALF_WIDTHS, TABLE_COLOR);
    line(
        &mut xml,
        &format!(
            r#"<geom name="table" type="plane" size="{x} {y} 0.05" rgba="{r} {g} {b} 1" friction="{}"/>"#,
            config.table_friction.mjcf()
        ),
    );
    for (arm, (robot, base)) in robots.iter().zip(bases).enumerate() {
        arm_body(&mut xml, config, arm, robot, base, &Dress::of(robot.name, meshes));
    }
    part_body(&mut xml, config, object, PartId(0), None);
    line(&mut xml, "</worldbody>");
    exclusions(&mut xml, robots);
    couplings(&mut xml, robots.len());
    actuators(&mut xml, robots);
    line(&mut xml, "</mujoco>");
    xml
}

/// Arms among obstacles that do not move, and nothing else.
pub(crate) fn arms_among(config: &SceneConfig, robots: &[RobotModel], bases: &[Pose], obstacles: &[Obstacle]) -> String {
    let mut xml = String::new();
    header(&mut xml, config, robots);
    hulls(&mut xml, obstacles.iter().enumerate().map(|(index, obstacle)| (obstacle_name(index), &obstacle.solid)));
    line(&mut xml, "<worldbody>");
    for (index, obstacle) in obstacles.iter().enumerate() {
        solid_geom(&mut xml, &obstacle_name(index), &obstacle.solid, "");
    }
    for (arm, (robot, base)) in robots.iter().zip(bases).enumerate() {
        arm_body(&mut xml, config, arm, robot, base, &Dress::of(robot.name, &[]));
    }
    line(&mut xml, "</worldbody>");
    exclusions(&mut xml, robots);
    line(&mut xml, "</mujoco>");
    xml
}

fn line(xml: &mut String, text: &str) {
    xml.push_str(text);
    xml.push('\n');
}

/// Friction of a joint that does not give way: with MuJoCo's own 0.9 a laptop's screen sinks at 6° a second, with this at 0.06°. Stiffer
/// still, one of 300 objects dropped on the table jumps.
const STIFF_FRICTION: &str = r#"solimpfriction="0.999 0.999 0.001 0.5 2""#;

fn header(xml: &mut String, config: &SceneConfig, robots: &[RobotModel]) {
    line(xml, r#"<mujoco model="vmao">"#);
    line(xml, r#"<compiler angle="radian" autolimits="true"/>"#);
    let SceneConfig { timestep, friction_impedance_ratio, noslip_tolerance, sleep_tolerance, .. } = config;
    // Wide pads hold by where they press: with them noslip would be half of a step for nothing.
    let narrow = robots.iter().any(|robot| robot.gripper.pad_width() < config.noslip_pad_width);
    let noslip_iterations = if narrow { config.noslip_iterations } else { 0 };
    let sleep = if *sleep_tolerance > 0.0 { "enable" } else { "disable" };
    line(
        xml,
        &format!(
            r#"<option timestep="{timestep}" integrator="implicitfast" cone="elliptic" impratio="{friction_impedance_ratio}" noslip_iterations="{noslip_iterations}" noslip_tolerance="{noslip_tolerance}" solver="Newton" iterations="100" tolerance="1e-8" sleep_tolerance="{sleep_tolerance}"><flag sleep="{sleep}"/></option>"#
        ),
    );
    // Stiff contacts (time constant twice the time step, MuJoCo's floor) keep a held part from creeping.
    line(xml, &format!(r#"<default><geom condim="4" solref="{} 1"/></default>"#, 2.0 * config.timestep));
}

/// The mesh assets of those solids that are hulls, each under the name of its geom.
fn hulls<'a>(xml: &mut String, solids: impl Iterator<Item = (String, &'a Solid)>) {
    let elements: Vec<String> = solids
        .filter_map(|(name, solid)| match &solid.shape {
            Shape::Convex(hull) => Some(hull_element(&name, hull)),
            Shape::Sphere { .. } | Shape::Capsule { .. } | Shape::Cylinder { .. } | Shape::Box { .. } => None,
        })
        .collect();
    if !elements.is_empty() {
        line(xml, "<asset>");
        elements.iter().for_each(|element| line(xml, element));
        line(xml, "</asset>");
    }
}

fn solid_geom(xml: &mut String, name: &str, solid: &Solid, extra: &str) {
    let [r, g, b] = solid.color;
    line(
        xml,
        &format!(
            r#"<geom name="{name}" {} {} rgba="{r} {g} {b} 1" {extra}/>"#,
            shape_attributes(&solid.shape, name),
            pose_attributes(&solid.carrier_from_solid)
        ),
    );
}

fn link_content(xml: &mut String, arm: usize, link: &Link, friction: &str, dress: &Dress<'_>) {
    line(xml, &inertial_element(&link.inertial));
    let extra = format!(r#"mass="0" friction="{friction}"{}"#, dress.solid_group(link.name));
    for (index, solid) in link.solids.iter().enumerate() {
        solid_geom(xml, &arm_name(arm, &format!("{}/{index}", link.name)), solid, &extra);
    }
    xml.push_str(&dress.geoms(link.name));
}

fn arm_body(xml: &mut String, config: &SceneConfig, arm: usize, robot: &RobotModel, base: &Pose, dress: &Dress<'_>) {
    let friction = config.link_friction.mjcf();
    line(xml, &format!(r#"<body name="{}" {}>"#, arm_name(arm, robot.base.name), pose_attributes(base)));
    link_content(xml, arm, &robot.base, &friction, dress);
    for (index, joint) in robot.joints.iter().enumerate() {
        line(xml, &format!(r#"<body name="{}" {}>"#, arm_name(arm, joint.link.name), pose_attributes(&joint.parent_from_joint)));
        let [low, high] = joint.range;
        line(
            xml,
            &format!(
                r#"<joint name="{}" axis="0 0 1" range="{low} {high}" damping="{}" armature="{}"/>"#,
                arm_name(arm, &format!("joint{}", index + 1)),
                joint.damping,
                joint.armature
            ),
        );
        link_content(xml, arm, &joint.link, &friction, dress);
    }
    let gripper = &robot.gripper;
    line(xml, &format!(r#"<body name="{}" {}>"#, arm_name(arm, gripper.hand.name), pose_attributes(&gripper.last_from_hand)));
    link_content(xml, arm, &gripper.hand, &friction, dress);
    line(xml, &format!(r#"<site name="{}" {} size="0.004"/>"#, arm_name(arm, "tool"), pose_attributes(&gripper.hand_from_tool)));
    for index in 0..gripper.fingers.len() {
        finger_body(xml, config, arm, index, gripper, dress);
    }
    for _ in 0..robot.joints.len() + 2 {
        line(xml, "</body>");
    }
}

fn finger_body(xml: &mut String, config: &SceneConfig, arm: usize, index: usize, gripper: &Gripper, dress: &Dress<'_>) {
    let (finger, travel) = (&gripper.fingers[index], gripper.travel);
    line(xml, &format!(r#"<body name="{}" {}>"#, arm_name(arm, finger.link.name), pose_attributes(&finger.hand_from_finger)));
    line(
        xml,
        &format!(
            r#"<joint name="{}" type="slide" axis="0 1 0" range="0 {travel}" damping="300" armature="0.05" solreflimit="0.004 1"/>"#,
            arm_name(arm, &format!("finger{}", index + 1))
        ),
    );
    link_content(xml, arm, &finger.link, &config.link_friction.mjcf(), dress);
    let pad = format!(r#"mass="0" friction="{}"{}"#, config.pad_friction.mjcf(), dress.solid_group(finger.link.name));
    solid_geom(xml, &arm_name(arm, &format!("pad{}", index + 1)), &finger.pad, &pad);
    line(xml, "</body>");
}

/// A part and, inside it, the parts that hang on it: MuJoCo's tree is rooted at part 0 whatever root control uses.
fn part_body(xml: &mut String, config: &SceneConfig, object: &ArticulatedObject, part: PartId, from: Option<(&Joint, PartId)>) {
    let description = &object.parts[usize::from(part.0)];
    line(xml, &format!(r#"<body name="{}">"#, part_name(&description.name)));
    match from {
        None => line(xml, r#"<freejoint name="object"/>"#),
        Some((joint, parent)) => joint_element(xml, joint, parent),
    }
    let volume: f64 = description.solids.iter().map(|solid| solid.shape.volume()).sum();
    for (index, solid) in description.solids.iter().enumerate() {
        let mass = description.mass * solid.shape.volume() / volume;
        let extra = format!(r#"mass="{mass}" friction="{}""#, config.object_friction.mjcf());
        solid_geom(xml, &part_solid_name(&description.name, index), solid, &extra);
    }
    for joint in &object.joints {
        let came_by = from.is_some_and(|(edge, _)| edge.name == joint.name);
        if !came_by && joint.parent == part {
            part_body(xml, config, object, joint.child, Some((joint, part)));
        } else if !came_by && joint.child == part {
            part_body(xml, config, object, joint.parent, Some((joint, part)));
        }
    }
    line(xml, "</body>");
}

fn joint_element(xml: &mut String, joint: &Joint, from: PartId) {
    // Walking an edge from child to parent inverts the motion, not the joint's position.
    let axis = if joint.parent == from { joint.axis.into_inner() } else { -joint.axis.into_inner() };
    let kind = match joint.kind {
        JointKind::Revolute => "hinge",
        JointKind::Prismatic => "slide",
        JointKind::Ball => "ball",
        JointKind::Fixed => return,
    };
    let limits = joint.limits.map_or_else(String::new, |[low, high]| format!(r#" range="{low} {high}""#));
    line(
        xml,
        &format!(
            r#"<joint name="{}" type="{kind}" pos="{} {} {}" axis="{} {} {}"{limits} damping="{}" frictionloss="{}" {STIFF_FRICTION} armature="0.0001"/>"#,
            part_name(&joint.name),
            joint.anchor.x,
            joint.anchor.y,
            joint.anchor.z,
            axis.x,
            axis.y,
            axis.z,
            joint.damping,
            joint.friction
        ),
    );
}

/// Links of one arm that are close by construction may overlap; everything else collides.
fn exclusions(xml: &mut String, robots: &[RobotModel]) {
    line(xml, "<contact>");
    for (arm, robot) in robots.iter().enumerate() {
        let mut bodies = vec![vec![robot.base.name]];
        bodies.extend(robot.joints.iter().map(|joint| vec![joint.link.name]));
        bodies.push(vec![robot.gripper.hand.name]);
        let [left, right] = robot.gripper.fingers.each_ref().map(|finger| finger.link.name);
        bodies.push(vec![left, right]);
        let mut pairs = vec![(left, right)];
        for (first, second) in robot.neighbours() {
            pairs.extend(bodies[first].iter().flat_map(|first| bodies[second].iter().map(move |second| (*first, *second))));
        }
        for (first, second) in pairs {
            line(xml, &format!(r#"<exclude body1="{}" body2="{}"/>"#, arm_name(arm, first), arm_name(arm, second)));
        }
    }
    line(xml, "</contact>");
}

fn couplings(xml: &mut String, arms: usize) {
    line(xml, "<equality>");
    for arm in 0..arms {
        line(
            xml,
            &format!(
                r#"<joint joint1="{}" joint2="{}" polycoef="0 1 0 0 0" solref="0.005 1" solimp="0.95 0.99 0.001"/>"#,
                arm_name(arm, "finger2"),
                arm_name(arm, "finger1")
            ),
        );
    }
    line(xml, "</equality>");
}

fn actuators(xml: &mut String, robots: &[RobotModel]) {
    line(xml, "<actuator>");
    for (arm, robot) in robots.iter().enumerate() {
        for (index, joint) in robot.joints.iter().enumerate() {
            let limit = joint.max_torque;
            let name = arm_name(arm, &format!("joint{}", index + 1));
            let _infallible = writeln!(xml, r#"<motor name="{name}" joint="{name}" ctrlrange="-{limit} {limit}"/>"#);
        }
        // One drive for the coupled fingers: each pad presses with half of it.
        let limit = 2.0 * robot.gripper.max_force;
        let name = arm_name(arm, "finger1");
        let _infallible = writeln!(xml, r#"<motor name="{name}" joint="{name}" ctrlrange="-{limit} {limit}"/>"#);
    }
    line(xml, "</actuator>");
}
