//! One tree of links, every link placed in the frame of the root.

use super::{JointDraft, PartDraft, PlacedGeometry, ignored, limits};
use crate::{
    description::{Description, Geometry, Joint, Link, Motion},
    repairs::{Quirk, Repairs},
};
use nalgebra::{Point3, UnitQuaternion};
use std::collections::VecDeque;
use vmao_core::{
    geometry::Pose,
    wording::{listed, quoted},
};

/// Links as parts and all joints, in an order in which parents come first; joint `i` moves part `i + 1`.
pub(super) struct Placed {
    pub(super) parts: Vec<PartDraft>,
    pub(super) joints: Vec<JointDraft>,
}

pub(super) fn place(description: &Description, dropped: &[String], repairs: &mut Repairs) -> Result<Placed, String> {
    let Description { links, joints, .. } = description;
    let root = root(links, joints)?;
    let mut by_parent: Vec<Vec<&Joint>> = vec![Vec::new(); links.len()];
    for joint in joints {
        by_parent[joint.parent].push(joint);
    }
    let mut placed = Placed { parts: vec![part(&links[root], &Pose::identity(), repairs)], joints: Vec::new() };
    let mut open = VecDeque::from([(root, 0, Pose::identity())]);
    let mut reached = 1;
    while let Some((link, index, object_from_link)) = open.pop_front() {
        for joint in &by_parent[link] {
            reached += 1;
            let child = &links[joint.child];
            if dropped.contains(&child.name) {
                ignored(repairs, &child.name, "a link that its own folder calls junk");
                reached += below(joint.child, &by_parent);
                continue;
            }
            let limits = limits::repaired(joint, repairs);
            let reference = limits::reference(joint, limits, repairs);
            let object_from_child = object_from_link * joint.parent_from_child * displacement(joint, reference);
            placed.joints.push(JointDraft {
                name: joint.name.clone(),
                motion: joint.motion,
                parent: index,
                child: placed.parts.len(),
                anchor: object_from_child * Point3::from(joint.anchor),
                axis: object_from_child.rotation * joint.axis,
                limits: limits.map(|range| range.map(|bound| bound - reference)),
                damping: joint.damping,
                friction: joint.friction,
            });
            open.push_back((joint.child, placed.parts.len(), object_from_child));
            placed.parts.push(part(child, &object_from_child, repairs));
        }
    }
    // With one root and at most one parent each, whoever is not reached goes around in a circle.
    if reached < links.len() {
        let mut names = joints.iter().filter(|joint| !is_below(root, joint.child, joints)).map(|joint| joint.name.as_str());
        return Err(format!("joints go around in a circle, expected a tree: {}", listed(names.by_ref())));
    }
    Ok(placed)
}

/// The one link that no joint moves. Fails if there is none, or several, or if two joints move one link.
fn root(links: &[Link], joints: &[Joint]) -> Result<usize, String> {
    let mut moved_by: Vec<Option<&Joint>> = vec![None; links.len()];
    for joint in joints {
        let name = quoted(&links[joint.child].name);
        if joint.parent == joint.child {
            return Err(format!("joint {} connects link {name} to itself", quoted(&joint.name)));
        }
        if let Some(other) = moved_by[joint.child].replace(joint) {
            let (first, second) = (quoted(&other.name), quoted(&joint.name));
            return Err(format!("link {name} is the child of two joints, {first} and {second}, expected a tree"));
        }
    }
    let roots: Vec<usize> = (0..links.len()).filter(|&link| moved_by[link].is_none()).collect();
    match roots[..] {
        [root] => Ok(root),
        [] if links.is_empty() => Err("no links".to_owned()),
        [] => Err("joints go around in a circle: every link is the child of one, expected a tree".to_owned()),
        _ => {
            let names = listed(roots.iter().map(|&root| links[root].name.as_str()));
            Err(format!("{} links are the child of no joint, expected one root: {names}", roots.len()))
        }
    }
}

/// How many links hang below this one.
fn below(link: usize, by_parent: &[Vec<&Joint>]) -> usize {
    let mut count = 0;
    let mut open = vec![link];
    // A circle cannot be entered: each link is the child of one joint, and the root of none.
    while let Some(link) = open.pop() {
        open.extend(by_parent[link].iter().map(|joint| joint.child));
        count += by_parent[link].len();
    }
    count
}

/// Whether walking up from `link` ends at `root`.
fn is_below(root: usize, link: usize, joints: &[Joint]) -> bool {
    let mut link = link;
    for _ in 0..=joints.len() {
        match joints.iter().find(|joint| joint.child == link) {
            Some(joint) => link = joint.parent,
            None => return link == root,
        }
    }
    false
}

/// What the joint does to its child at this position.
fn displacement(joint: &Joint, position: f64) -> Pose {
    match joint.motion {
        Motion::Turn => {
            let turn = UnitQuaternion::from_axis_angle(&joint.axis, position);
            let anchor = joint.anchor;
            Pose::from_parts((anchor - turn * anchor).into(), turn)
        }
        Motion::Slide => Pose::from_parts((joint.axis.into_inner() * position).into(), UnitQuaternion::identity()),
        Motion::Ball | Motion::Fixed | Motion::Free => Pose::identity(),
    }
}

fn part(link: &Link, object_from_link: &Pose, repairs: &mut Repairs) -> PartDraft {
    let placed = |(index, geometry): (usize, &Geometry)| PlacedGeometry {
        name: format!("{}/{}", link.name, geometry.name.clone().unwrap_or_else(|| index.to_string())),
        object_from_geometry: object_from_link * geometry.link_from_geometry,
        form: geometry.form.clone(),
        color: geometry.color,
        texture: geometry.texture.clone(),
    };
    let visuals: Vec<PlacedGeometry> = link.visuals.iter().enumerate().map(placed).collect();
    let mut collisions: Vec<PlacedGeometry> = link.collisions.iter().enumerate().map(placed).collect();
    if collisions.is_empty() && !visuals.is_empty() {
        repairs.add(Quirk::NotConvex, &link.name, "has no collision shapes: made from what is seen");
        collisions.clone_from(&visuals);
    }
    PartDraft { name: link.name.clone(), links: vec![link.name.clone()], visuals, collisions, mass: link.mass }
}
