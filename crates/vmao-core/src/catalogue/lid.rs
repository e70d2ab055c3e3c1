//! A plate on a level hinge with a tab to hold it by: the screen of a laptop, the lid of a box.
//!
//! The hinge lies along x; what the plate covers when closed lies towards -y. Tabs point away from the hinge and are held
//! across, along x: two hands on them are then as far apart as the tabs, however wide the hands are.

use super::kit::{Grip, Resistance, bar, joint, turned};
use super::levers::SMALLEST_SPREAD;
use crate::{
    geometry::Pose,
    object::{Joint, JointKind},
    shape::Solid,
};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

/// A bar that stands out from a plate or a wall, to be held across its width.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tab {
    pub(super) length: f64,
    pub(super) width: f64,
    pub(super) thickness: f64,
}

impl Tab {
    /// The tab along x of `frame`, from `begin` (m) on.
    pub(super) fn solid(&self, frame: &Pose, begin: f64, color: [f32; 3]) -> Solid {
        bar(frame, [begin, begin + self.length], [self.width, self.thickness], color)
    }

    /// The grip on the tab of `part` that [`Tab::solid`] makes with the same arguments: clear of what it stands on.
    pub(super) fn grip(&self, part: u16, frame: &Pose, begin: f64) -> Grip {
        let stretch = [begin + 0.5 * self.length, begin + self.length - 0.010];
        Grip { part, frame: *frame, stretch, width: self.width, finger_1: 1.0 }
    }
}

/// A frame with x towards -y of the object, y towards +x and z up, at the height `z` (m).
pub(super) fn forward(z: f64) -> Pose {
    Pose::translation(0.0, 0.0, z) * turned(-FRAC_PI_2)
}

/// The plate, its hinge at y = 0 (m).
#[derive(Debug, Clone, Copy)]
pub(super) struct Lid {
    pub(super) hinge_height: f64,
    /// From the hinge to the free edge.
    pub(super) depth: f64,
    /// Along the hinge.
    pub(super) width: f64,
    pub(super) thickness: f64,
    pub(super) tab: Tab,
}

impl Lid {
    /// The plate's frame at joint position zero, its smallest opening: x from the hinge to the free edge, z outward.
    pub(super) fn frame(&self) -> Pose {
        let open = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -SMALLEST_SPREAD);
        Pose::translation(0.0, 0.0, self.hinge_height) * open * turned(-FRAC_PI_2)
    }

    /// Plate and tab.
    pub(super) fn solids(&self, color: [f32; 3], tab_color: [f32; 3]) -> Vec<Solid> {
        let plate = bar(&self.frame(), [0.0, self.depth], [self.width, self.thickness], color);
        vec![plate, self.tab.solid(&self.frame(), self.depth, tab_color)]
    }

    /// The hinge between part 0 and the plate, part 1; a growing position opens it.
    pub(super) fn hinge(&self, resistance: Resistance) -> Joint {
        let line = (Point3::new(0.0, 0.0, self.hinge_height), -Vector3::x_axis());
        joint("hinge", JointKind::Revolute, [0, 1], line, FRAC_PI_3, resistance)
    }

    /// Where the plate, part 1, is held.
    pub(super) fn grip(&self) -> Grip {
        self.tab.grip(1, &self.frame(), self.depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation_exp;

    #[test]
    fn opening_raises_the_lid_and_takes_it_back() {
        let tab = Tab { length: 0.05, width: 0.02, thickness: 0.018 };
        let lid = Lid { hinge_height: 0.1, depth: 0.1, width: 0.15, thickness: 0.01, tab };
        let hinge = lid.hinge(Resistance { damping: 0.0, friction: 0.0 });
        let along = |position: f64| rotation_exp(&(hinge.axis.into_inner() * position)) * lid.frame().rotation * Vector3::x();
        let opening = |position| along(position).angle(&-Vector3::y());
        assert!((opening(0.0) - SMALLEST_SPREAD).abs() < 1e-12 && along(0.0).z > 0.9);
        assert!((opening(FRAC_PI_3) - SMALLEST_SPREAD - FRAC_PI_3).abs() < 1e-12 && along(FRAC_PI_3).z > 0.5);
    }
}
