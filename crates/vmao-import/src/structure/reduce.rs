//! Leaves what moves and has a shape: fixed links joined, helper links taken out, the world let go.

use super::{HelperMotion, JointDraft, PartDraft, Structure, ignored, place::Placed};
use crate::{
    description::Motion,
    repairs::{Quirk, Repairs},
};
use vmao_core::wording::{listed, quoted};

/// Parts by index, some of them gone, and the joints that are left.
struct Reduction<'a> {
    parts: Vec<Option<PartDraft>>,
    joints: Vec<JointDraft>,
    repairs: &'a mut Repairs,
}

pub(super) fn reduce(placed: Placed, helper: HelperMotion, repairs: &mut Repairs) -> Result<Structure, String> {
    let parts = placed.parts.into_iter().map(Some).collect();
    let mut reduction = Reduction { parts, joints: placed.joints, repairs };
    reduction.join_fixed();
    reduction.drop_empty_leaves();
    reduction.let_go_of_the_world()?;
    reduction.take_out_helpers(helper)?;
    reduction.drop_empty_leaves();
    if let Some(joint) = reduction.joints.iter().find(|joint| joint.motion == Motion::Free) {
        let (name, part) = (quoted(&joint.name), quoted(&reduction.part(joint.child).name));
        return Err(format!("joint {name} lets part {part} float freely; parts of one object are joined"));
    }
    Ok(reduction.finish())
}

impl Reduction<'_> {
    #[expect(clippy::expect_used, reason = "joints name parts that are there; whoever removes a part moves its joints")]
    fn part(&self, index: usize) -> &PartDraft {
        self.parts[index].as_ref().expect("a joint's part is there")
    }

    /// Puts `child` into `parent`; what hung on the child hangs on the parent.
    fn merge(&mut self, parent: usize, child: usize) {
        let Some(gone) = self.parts[child].take() else { return };
        if let Some(part) = &mut self.parts[parent] {
            // The name of what has a shape says more than that of a frame.
            if part.is_empty() {
                part.name = gone.name.clone();
                part.mass = gone.mass;
            } else if !gone.is_empty() {
                part.mass = part.mass.zip(gone.mass).map(|(one, other)| one + other);
            }
            part.links.extend(gone.links);
            part.visuals.extend(gone.visuals);
            part.collisions.extend(gone.collisions);
        }
        for joint in &mut self.joints {
            if joint.parent == child {
                joint.parent = parent;
            }
        }
    }

    fn join_fixed(&mut self) {
        while let Some(index) = self.joints.iter().position(|joint| joint.motion == Motion::Fixed) {
            let joint = self.joints.remove(index);
            let (parent, child) = (self.part(joint.parent), self.part(joint.child));
            let (quirk, what) = if joint.parent == 0 && parent.is_empty() {
                (Quirk::FixedToWorld, format!("{} was fixed to the world: let go", quoted(&child.name)))
            } else {
                let (parent, child) = (quoted(&parent.name), quoted(&child.name));
                (Quirk::FixedJoint, format!("{child} does not move relative to {parent}: one part, geometries keep their names"))
            };
            self.repairs.add(quirk, &joint.name, what);
            self.merge(joint.parent, joint.child);
        }
    }

    /// Parts without shape at the ends of the tree have nothing to move.
    fn drop_empty_leaves(&mut self) {
        let leaf = |reduction: &Self, joint: &JointDraft| {
            reduction.part(joint.child).is_empty() && reduction.joints.iter().all(|other| other.parent != joint.child)
        };
        while let Some(index) = self.joints.iter().position(|joint| leaf(self, joint)) {
            let joint = self.joints.remove(index);
            ignored(self.repairs, &joint.name, "moves a link without shape, on which nothing hangs");
            self.parts[joint.child] = None;
        }
    }

    /// A root without shape is the world; what is joined to it stands for itself.
    fn let_go_of_the_world(&mut self) -> Result<(), String> {
        while let Some(root) = (0..self.parts.len()).find(|&index| self.parts[index].as_ref().is_some_and(PartDraft::is_empty)) {
            if self.joints.iter().any(|joint| joint.child == root) {
                return Ok(());
            }
            let held: Vec<usize> = (0..self.joints.len()).filter(|&index| self.joints[index].parent == root).collect();
            match held[..] {
                [] => return Ok(()),
                [only] => {
                    let joint = self.joints.remove(only);
                    let child = quoted(&self.part(joint.child).name);
                    let how = if joint.motion == Motion::Free { "floats" } else { "was joined to the world" };
                    self.repairs.add(Quirk::FixedToWorld, &joint.name, format!("{child} {how}: an object of its own"));
                    self.parts[root] = None;
                }
                _ => {
                    let name = quoted(&self.part(root).name);
                    let children: Vec<&str> =
                        held.iter().map(|&index| self.part(self.joints[index].child).name.as_str()).collect();
                    return Err(format!("the root {name} has no shape and joins several parts: {}", listed(children)));
                }
            }
        }
        Ok(())
    }

    /// A part without shape between two joints goes, and one of the joints with it.
    fn take_out_helpers(&mut self, helper: HelperMotion) -> Result<(), String> {
        while let Some(empty) = self.joints.iter().map(|joint| joint.child).find(|&child| self.part(child).is_empty()) {
            let name = self.part(empty).name.clone();
            let outward: Vec<usize> = (0..self.joints.len()).filter(|&index| self.joints[index].parent == empty).collect();
            let ([lower], Some(upper)) = (&outward[..], self.joints.iter().position(|joint| joint.child == empty)) else {
                let children: Vec<&str> =
                    outward.iter().map(|&index| self.part(self.joints[index].child).name.as_str()).collect();
                return Err(format!("link {} has no shape and joins several parts: {}", quoted(&name), listed(children)));
            };
            let (mut upper, mut lower) = (self.joints[upper].clone(), self.joints[*lower].clone());
            if upper.motion == Motion::Free || lower.motion == Motion::Free {
                return Err(format!("link {} has no shape and floats freely; parts of one object are joined", quoted(&name)));
            }
            self.joints.retain(|joint| joint.child != empty && joint.parent != empty);
            (upper.child, lower.parent) = (lower.child, upper.parent);
            let keep_lower = rank(&lower, helper) > rank(&upper, helper);
            let (kept, gone) = if keep_lower { (lower, upper) } else { (upper, lower) };
            let what = format!(
                "{} has no shape: of its two joints {} stays, which {}, and {} is held where it is",
                quoted(&name),
                quoted(&kept.name),
                if kept.motion == Motion::Slide { "slides" } else { "turns" },
                quoted(&gone.name)
            );
            self.repairs.add(Quirk::HelperLink, &name, what);
            self.parts[empty] = None;
            self.joints.push(kept);
        }
        Ok(())
    }

    /// What is left, without gaps, the root first.
    fn finish(self) -> Structure {
        let mut order: Vec<usize> = (0..self.parts.len()).filter(|&index| self.parts[index].is_some()).collect();
        let is_child = |index: usize| self.joints.iter().any(|joint| joint.child == index);
        order.sort_by_key(|&index| (is_child(index), index));
        let new = |old: usize| order.iter().position(|&index| index == old).unwrap_or_default();
        let moved = |joint: &JointDraft| JointDraft { parent: new(joint.parent), child: new(joint.child), ..joint.clone() };
        let mut joints: Vec<JointDraft> = self.joints.iter().map(moved).collect();
        joints.sort_by_key(|joint| joint.child);
        Structure { parts: order.iter().filter_map(|&index| self.parts[index].clone()).collect(), joints }
    }
}

/// Which of two joints in a row is kept: the wanted motion, then the one that moves further.
fn rank(joint: &JointDraft, helper: HelperMotion) -> (bool, f64) {
    let wanted = match helper {
        HelperMotion::Slide => joint.motion == Motion::Slide,
        HelperMotion::Turn => joint.motion != Motion::Slide,
    };
    (wanted, joint.limits.map_or(f64::INFINITY, |[low, high]| high - low))
}
