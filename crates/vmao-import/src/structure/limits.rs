//! Limits that mean something: ordered, finite, of a joint that can use them; and a configuration within them.

use crate::{
    description::{Joint, Motion},
    repairs::{Quirk, Repairs},
};
use std::f64::consts::{PI, TAU};

/// Bounds beyond it are none (m or rad).
const FARTHEST: f64 = 1e3;
/// A range below it is empty (m or rad).
const NARROWEST: f64 = 1e-6;

/// The joint's limits; none if it has no use for any, or if only its size can say how far it slides.
pub(super) fn repaired(joint: &Joint, repairs: &mut Repairs) -> Option<[f64; 2]> {
    let mut say = |what: String| repairs.add(Quirk::Limits, &joint.name, what);
    match joint.motion {
        Motion::Fixed | Motion::Free => None,
        Motion::Ball => {
            let largest = joint.limits.map(|[_, largest]| largest).filter(|largest| (NARROWEST..PI).contains(largest));
            if joint.limits.is_some() && largest.is_none() {
                say(format!("a ball with the limits {:?}: free", joint.limits));
            }
            largest.map(|largest| [0.0, largest])
        }
        Motion::Turn => match joint.limits {
            None if joint.endless => None,
            None => {
                say("turns without limits: endless".to_owned());
                None
            }
            Some([low, high]) => {
                let finite = low.abs() < FARTHEST && high.abs() < FARTHEST;
                if !finite || high - low < NARROWEST {
                    say(format!("turns between {low} and {high} rad: endless"));
                    return None;
                }
                if high - low > TAU {
                    say(format!("turns between {low} and {high} rad, more than once around: endless"));
                    return None;
                }
                Some([low, high])
            }
        },
        Motion::Slide => match joint.limits {
            Some([low, high]) if low.abs() < FARTHEST && high.abs() < FARTHEST && high - low >= NARROWEST => Some([low, high]),
            found => {
                let found =
                    found.map_or_else(|| "without limits".to_owned(), |[low, high]| format!("between {low} and {high} m"));
                say(format!("slides {found}: as far as half of what it carries is long"));
                None
            }
        },
    }
}

/// The position nearest to zero within the limits, said in the report where it is not zero.
pub(super) fn reference(joint: &Joint, limits: Option<[f64; 2]>, repairs: &mut Repairs) -> f64 {
    let Some([low, high]) = limits.filter(|_| joint.motion != Motion::Ball) else { return 0.0 };
    let reference = 0.0_f64.clamp(low, high);
    if reference.abs() > 0.0 {
        let what =
            format!("zero lies outside the limits {low} to {high}: the object is placed at {reference}, which becomes zero");
        repairs.add(Quirk::ZeroOutsideLimits, &joint.name, what);
    }
    reference
}
