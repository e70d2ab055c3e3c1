//! Contacts: one point per finger, one grasp per gripper, one tuple per object.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

/// Index of an object part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PartId(pub u16);

/// Index of a robot arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct ArmId(pub u16);

/// Where the two fingers of one gripper touch one part: points in that part's frame (m).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// The part held.
    pub part: PartId,
    /// Finger 1 and finger 2, part frame.
    pub fingers: [Point3<f64>; 2],
}

impl Contact {
    /// Distance between the two finger points (m): how far the gripper must open.
    pub fn width(&self) -> f64 {
        (self.fingers[1] - self.fingers[0]).norm()
    }
}

/// One contact for each gripper (Algorithm 1's `s`), in the order of the grasps.
pub type ContactTuple = Vec<Contact>;

/// Per-point probabilities that a finger touches there; one value per cloud point and finger, each channel sums to one.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactMap {
    /// Finger 1's and finger 2's probabilities, each as long as the cloud.
    pub fingers: [Vec<f32>; 2],
}

impl ContactMap {
    /// The most probable point of each finger. Ties go to the lower index.
    pub fn peaks(&self) -> [usize; 2] {
        let peak = |channel: &[f32]| (0..channel.len()).fold(0, |best, i| if channel[i] > channel[best] { i } else { best });
        [peak(&self.fingers[0]), peak(&self.fingers[1])]
    }
}
