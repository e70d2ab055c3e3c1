//! What the network may see of a scene: a coloured point cloud. Labels ride along for analysis only.

use serde::{Deserialize, Serialize};

/// What a cloud point lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum PointLabel {
    /// The table or the floor.
    Table,
    /// The arm (gripper included) with this index.
    Arm(u16),
    /// The object's part with this index.
    Part(u16),
}

/// A fused RGB-D point cloud in the world frame. The three lists have equal length.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Observation {
    /// Positions, world frame (m).
    pub points: Vec<[f32; 3]>,
    /// Red, green, blue in [0, 1].
    pub colors: Vec<[f32; 3]>,
    /// What each point lies on; never given to the network.
    pub labels: Vec<PointLabel>,
}

impl Observation {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether nothing was seen.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}
