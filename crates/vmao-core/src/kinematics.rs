//! Forward kinematics and Jacobians of a serial chain of hinges. Everything is in the frame of the arm's base.

use crate::{geometry::Pose, random::Stream};
use nalgebra::{Matrix6xX, UnitQuaternion, Vector3};

/// A hinge about its local z axis, and where it sits on the link before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainJoint {
    /// The joint frame at angle zero, in the frame of the link before it.
    pub parent_from_joint: Pose,
    /// Lowest angle (rad).
    pub lower: f64,
    /// Highest angle (rad).
    pub upper: f64,
}

/// A chain of hinges from the base to a tool.
#[derive(Debug, Clone, PartialEq)]
pub struct SerialChain {
    /// The hinges, base first.
    pub joints: Vec<ChainJoint>,
    /// The tool frame in the frame of the last link.
    pub last_from_tool: Pose,
}

impl SerialChain {
    /// Number of joints.
    pub fn len(&self) -> usize {
        self.joints.len()
    }

    /// Whether the chain has no joint.
    pub fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// `base_from_link` of each link at the angles `q` (rad), link i after joint i. Panics if `q` has another length.
    pub fn link_poses(&self, q: &[f64]) -> Vec<Pose> {
        assert_eq!(q.len(), self.len(), "one angle per joint");
        let mut base_from_link = Pose::identity();
        let step = |(joint, &angle): (&ChainJoint, &f64)| {
            base_from_link *= joint.parent_from_joint;
            base_from_link *= UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
            base_from_link
        };
        self.joints.iter().zip(q).map(step).collect()
    }

    /// `base_from_tool` at the angles `q` (rad). Panics if `q` has another length.
    pub fn tool_pose(&self, q: &[f64]) -> Pose {
        self.link_poses(q).last().copied().unwrap_or_default() * self.last_from_tool
    }

    /// The geometric Jacobian J at the tool: linear over angular velocity of the tool = J q̇, in the base frame.
    ///
    /// Column i is (zᵢ × (p − oᵢ), zᵢ) with zᵢ the axis and oᵢ the origin of joint i, p the tool position.
    ///
    /// # Shapes
    /// 6 × n; rows m/rad then rad/rad. Panics if `q` has another length than n.
    pub fn jacobian(&self, q: &[f64]) -> Matrix6xX<f64> {
        let links = self.link_poses(q);
        let tool = (links.last().copied().unwrap_or_default() * self.last_from_tool).translation.vector;
        let mut jacobian = Matrix6xX::zeros(self.len());
        for (column, link) in links.iter().enumerate() {
            let axis = link.rotation * Vector3::z();
            jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&axis.cross(&(tool - link.translation.vector)));
            jacobian.fixed_view_mut::<3, 1>(3, column).copy_from(&axis);
        }
        jacobian
    }

    /// Whether every angle lies in its limits, ends included.
    pub fn within_limits(&self, q: &[f64]) -> bool {
        q.len() == self.len() && self.joints.iter().zip(q).all(|(joint, &angle)| (joint.lower..=joint.upper).contains(&angle))
    }

    /// The nearest angles inside the limits.
    pub fn clamp(&self, q: &[f64]) -> Vec<f64> {
        self.joints.iter().zip(q).map(|(joint, &angle)| angle.clamp(joint.lower, joint.upper)).collect()
    }

    /// Angles drawn uniformly inside the limits.
    pub fn sample(&self, stream: &mut Stream) -> Vec<f64> {
        self.joints.iter().map(|joint| stream.range(joint.lower, joint.upper)).collect()
    }
}
