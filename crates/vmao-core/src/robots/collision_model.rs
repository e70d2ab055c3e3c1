//! A robot as the collision check sees it: its chain, the solids of its links and gripper, and which of its bodies are neighbours.

use super::RobotModel;
use crate::{
    collision::{ArmCollisionModel, LinkSolid},
    geometry::Pose,
    shape::Solid,
};

impl RobotModel {
    /// The arm with its base at `world_from_base` and its pads `opening` apart (m; cut to what the gripper can do).
    pub fn collision_model(&self, world_from_base: Pose, opening: f64) -> ArmCollisionModel {
        let on = |link: usize| move |solid: &Solid| LinkSolid { link, solid: solid.clone() };
        let mut solids: Vec<LinkSolid> = self.base.solids.iter().map(on(0)).collect();
        for (index, joint) in self.joints.iter().enumerate() {
            solids.extend(joint.link.solids.iter().map(on(index + 1)));
        }
        let (hand, fingers) = self.gripper_solids(opening);
        let count = self.joints.len();
        solids.extend(hand.iter().map(on(count + 1)));
        solids.extend(fingers.iter().map(on(count + 2)));
        ArmCollisionModel { chain: self.tool_chain(), world_from_base, solids, ignored_links: self.neighbours() }
    }

    /// Pairs of bodies that are close by construction and may overlap: 0 is the base, i link i, then the hand, then both fingers.
    ///
    /// Bodies up to two apart along the chain; the fingers with the hand and the three links before it.
    pub fn neighbours(&self) -> Vec<(usize, usize)> {
        let (hand, fingers) = (self.joints.len() + 1, self.joints.len() + 2);
        let along_chain = (0..hand).flat_map(|first| (first + 1..=(first + 2).min(hand)).map(move |second| (first, second)));
        along_chain.chain((hand.saturating_sub(3)..=hand).map(|body| (body, fingers))).collect()
    }

    /// Height of the gripper's lowest point with its tool at `world_from_tool` and its pads `opening` apart (m).
    pub fn lowest_gripper_point(&self, world_from_tool: &Pose, opening: f64) -> f64 {
        let tool_from_last = (self.gripper.last_from_hand * self.gripper.hand_from_tool).inverse();
        let world_from_last = world_from_tool * tool_from_last;
        let (hand, fingers) = self.gripper_solids(opening);
        hand.iter().chain(&fingers).map(|solid| solid.lowest_point(&world_from_last)).fold(f64::INFINITY, f64::min)
    }

    /// Solids of the hand and of both fingers, in the frame of the arm's last link.
    pub(crate) fn gripper_solids(&self, opening: f64) -> (Vec<Solid>, Vec<Solid>) {
        let gripper = &self.gripper;
        let place =
            |carrier: Pose, solid: &Solid| Solid { carrier_from_solid: carrier * solid.carrier_from_solid, ..solid.clone() };
        let hand = gripper.hand.solids.iter().map(|solid| place(gripper.last_from_hand, solid)).collect();
        let travel = gripper.finger_travel(opening);
        let fingers = gripper.fingers.iter().flat_map(|finger| {
            let carrier = gripper.last_from_hand * finger.hand_from_finger * Pose::translation(0.0, travel, 0.0);
            finger.link.solids.iter().chain([&finger.pad]).map(move |solid| place(carrier, solid))
        });
        (hand, fingers.collect())
    }
}
