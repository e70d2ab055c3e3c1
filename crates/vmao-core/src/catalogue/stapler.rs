//! A stapler, opened as for tacking, lying on its side: a base with an anvil and an arm with a magazine.
//!
//! Object frame: the hinge at the origin about +z, the base along +x. Joint position zero is the smallest opening.

use super::kit::{DARK, Grip, Pin, Resistance, STEEL, bar, item as assemble, joint, part, pick, spoke, stream};
use super::levers::SMALLEST_SPREAD;
use super::{CatalogueItem, InstanceSet};
use crate::object::JointKind;
use nalgebra::{Point3, Vector3};

/// How far it opens from its smallest opening (rad).
const OPENING: f64 = std::f64::consts::FRAC_PI_3;

/// The stapler of this instance, held by base and arm.
pub(super) fn item(set: InstanceSet, instance: u16) -> CatalogueItem {
    let mut stream = stream(2, set, instance);
    let thickness = stream.range(0.024, 0.029);
    let (base_length, base_width) = (stream.range(0.150, 0.170), stream.range(0.017, 0.019));
    let (arm_length, arm_width) = (stream.range(0.140, 0.155), stream.range(0.018, 0.021));
    let mass = stream.range(0.16, 0.24);
    let resistance = Resistance { damping: stream.range(0.008, 0.014), friction: stream.range(0.02, 0.04) };
    let color = pick(&mut stream, &[[0.70, 0.12, 0.12], [0.12, 0.25, 0.55], [0.10, 0.40, 0.38], [0.55, 0.40, 0.10]]);

    let pin = Pin { radius: stream.range(0.014, 0.017), thickness, layers: 2 };
    let (base_frame, arm_frame) = (spoke(0.0, 0.0, 0.0), spoke(0.0, 0.0, SMALLEST_SPREAD));
    let mut base = pin.knuckle(&base_frame, 0, base_width, DARK).to_vec();
    base.push(bar(&base_frame, [pin.reach(), base_length], [base_width, thickness], DARK));
    // The anvil stands out towards the arm, the magazine's head towards the base.
    let anvil = spoke(0.0, base_width / 2.0, 0.0);
    base.push(bar(&anvil, [base_length - 0.016, base_length - 0.004], [0.004, 0.6 * thickness], STEEL));
    let mut arm = pin.knuckle(&arm_frame, 1, arm_width, color).to_vec();
    arm.push(bar(&arm_frame, [pin.reach(), arm_length], [arm_width, thickness], color));
    let head = arm_frame * spoke(0.0, -arm_width / 2.0, 0.0);
    arm.push(bar(&head, [arm_length - 0.012, arm_length], [0.008, 0.5 * thickness], STEEL));

    let grip = |part, frame, length: f64, width, finger_1| Grip {
        part,
        frame,
        stretch: [0.6 * length, length - 0.028],
        width,
        finger_1,
    };
    let grips = [grip(0, base_frame, base_length, base_width, -1.0), grip(1, arm_frame, arm_length, arm_width, 1.0)];
    let line = (Point3::origin(), Vector3::z_axis());
    let hinge = joint("hinge", JointKind::Revolute, [0, 1], line, OPENING, resistance);
    assemble("stapler", vec![part("base", 0.45 * mass, base), part("arm", 0.55 * mass, arm)], vec![hinge], &grips)
}
