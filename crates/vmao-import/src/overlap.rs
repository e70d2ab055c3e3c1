//! Parts that overlap and are not neighbours would fly apart in a simulator: both are cut back to a plane between them.
//!
//! Neighbours may overlap at their joint; the simulator lets them (quirk 18 of docs/import.md).

use crate::{
    repairs::{Quirk, Repairs},
    solid::SolidDraft,
};
use nalgebra::Vector3;

/// Overlaps below this share of the smaller solid's extent are left to the simulator.
const TOUCHING: f64 = 1e-3;
/// A solid that would lose more than this share of its volume is taken out instead, if its part has others.
const MOST_LOST: f64 = 0.9;

/// Cuts solids of parts that are not joined and overlap. `joined` says whether two parts are neighbours.
pub(crate) fn separate(parts: &mut [(String, Vec<SolidDraft>)], joined: impl Fn(usize, usize) -> bool, repairs: &mut Repairs) {
    for first in 0..parts.len() {
        for second in first + 1..parts.len() {
            if !joined(first, second) {
                let (before, after) = parts.split_at_mut(second);
                separate_pair(&mut before[first], &mut after[0], repairs);
            }
        }
    }
}

fn separate_pair(one: &mut (String, Vec<SolidDraft>), other: &mut (String, Vec<SolidDraft>), repairs: &mut Repairs) {
    let mut cuts = 0;
    for a in 0..one.1.len() {
        for b in 0..other.1.len() {
            let Some((normal, offset)) = plane_between(&one.1[a], &other.1[b]) else { continue };
            let left = (one.1[a].cut(&normal, offset), other.1[b].cut(&-normal, -offset));
            cuts += 1;
            for (part, index, left) in [(&mut *one, a, left.0), (&mut *other, b, left.1)] {
                let least = (1.0 - MOST_LOST) * part.1[index].volume();
                if let Some(left) = left.filter(|left| left.volume() > least) {
                    part.1[index] = left;
                }
            }
        }
    }
    if cuts > 0 {
        let other = vmao_core::wording::quoted(&other.0);
        let what = format!("overlaps {other}, which it is not joined to, in {cuts} places: cut back to a plane between them");
        repairs.add(Quirk::Overlap, &one.0, what);
    }
}

/// A plane `normal · x = offset` through the overlap, normal from the first to the second; none if they do not overlap.
fn plane_between(first: &SolidDraft, second: &SolidDraft) -> Option<(Vector3<f64>, f64)> {
    let extent = |solid: &SolidDraft| {
        let size = |axis: &Vector3<f64>| {
            let [low, high] = solid.hull.extent(axis);
            high - low
        };
        [Vector3::x(), Vector3::y(), Vector3::z()].iter().map(size).fold(0.0, f64::max)
    };
    let touching = TOUCHING * extent(first).min(extent(second));
    let outward = first.hull.planes().map(|(normal, _)| normal.into_inner());
    let inward = second.hull.planes().map(|(normal, _)| -normal.into_inner());
    let mut best: Option<(f64, Vector3<f64>, f64)> = None;
    for normal in outward.chain(inward) {
        let ([_, high], [low, _]) = (first.hull.extent(&normal), second.hull.extent(&normal));
        let depth = high - low;
        if depth <= touching {
            return None;
        }
        if best.is_none_or(|(least, _, _)| depth < least) {
            best = Some((depth, normal, f64::midpoint(high, low)));
        }
    }
    best.map(|(_, normal, offset)| (normal, offset))
}
