//! What stands in a scene: every body with its solids, in the order of the model.

use crate::scene::Scene;
use vmao_core::observation::PointLabel;
use vmao_core::rollout::RolloutBody;

impl Scene {
    /// The bodies of all arms and of the object: number in the simulator, and what it is.
    pub(crate) fn bodies(&self) -> Vec<(usize, RolloutBody)> {
        let mut bodies = Vec::new();
        for (arm, (index, robot)) in self.arms.iter().zip(&self.robots).enumerate() {
            let gripper = &robot.gripper;
            let mut links = vec![(robot.base.name, robot.base.solids.clone())];
            links.extend(robot.joints.iter().map(|joint| (joint.link.name, joint.link.solids.clone())));
            links.push((gripper.hand.name, gripper.hand.solids.clone()));
            links.extend(gripper.fingers.iter().map(|finger| {
                let mut solids = finger.link.solids.clone();
                solids.push(finger.pad.clone());
                (finger.link.name, solids)
            }));
            for (&body, (name, solids)) in index.bodies.iter().zip(links) {
                let label = PointLabel::Arm(arm as u16);
                bodies.push((body, RolloutBody { name: format!("arm{arm}/{name}"), label, solids }));
            }
        }
        for (part, (&body, description)) in self.part_bodies.iter().zip(&self.object.parts).enumerate() {
            let (name, solids) = (description.name.clone(), description.solids.clone());
            bodies.push((body, RolloutBody { name, label: PointLabel::Part(part as u16), solids }));
        }
        bodies
    }
}
