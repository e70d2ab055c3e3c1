//! Which arm takes which part.

use crate::scene::Scene;
use nalgebra::Point3;
use vmao_core::contact::{ArmId, PartId};
use vmao_core::geometry::Pose;

/// Assignments that are tried at most; two arms have two.
const MOST_ASSIGNMENTS: usize = 6;

/// Assignments of arms to parts that keep who holds what; first those whose bases stay nearest to their parts.
///
/// `places` are the parts' poses at several times (now, at the goal), all of which count. Element p is part p's arm.
pub(crate) fn assignments(scene: &Scene, held: &[(ArmId, PartId)], places: &[&[Pose]]) -> Vec<Vec<ArmId>> {
    let at = |parts: &[Pose]| parts.iter().zip(&scene.hold_centers).map(|(part, center)| part * center).collect();
    let centers: Vec<Vec<Point3<f64>>> = places.iter().map(|parts| at(parts)).collect();
    let distance = |arm: usize, part: usize| -> f64 {
        let base = scene.world_from_bases[arm].translation.vector;
        centers.iter().map(|centers| (centers[part].coords - base).xy().norm()).sum()
    };
    let keeps = |order: &[usize]| held.iter().all(|(arm, part)| order[usize::from(part.0)] == usize::from(arm.0));
    let mut ranked: Vec<(f64, Vec<usize>)> = Vec::new();
    arrangements(scene.robots.len(), scene.object.parts.len(), &mut |order| {
        if keeps(order) {
            ranked.push((order.iter().enumerate().map(|(part, &arm)| distance(arm, part)).sum(), order.to_vec()));
        }
    });
    // Stable: among equals arm i takes part i.
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.truncate(MOST_ASSIGNMENTS);
    ranked.into_iter().map(|(_, order)| order.into_iter().map(|arm| ArmId(arm as u16)).collect()).collect()
}

/// Calls `visit` with every way to choose `places` of `0..count` in an order, lexicographically.
pub(crate) fn arrangements(count: usize, places: usize, visit: &mut dyn FnMut(&[usize])) {
    fn extend(chosen: &mut Vec<usize>, count: usize, places: usize, visit: &mut dyn FnMut(&[usize])) {
        if chosen.len() == places {
            return visit(chosen);
        }
        for next in 0..count {
            if !chosen.contains(&next) {
                chosen.push(next);
                extend(chosen, count, places, visit);
                chosen.pop();
            }
        }
    }
    extend(&mut Vec::with_capacity(places), count, places, visit);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrangements_come_once_each_in_order() {
        let mut seen = Vec::new();
        arrangements(3, 2, &mut |order| seen.push(order.to_vec()));
        assert_eq!(seen, [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]], "an arm may be left over");
        seen.clear();
        arrangements(3, 3, &mut |order| seen.push(order.to_vec()));
        assert_eq!(seen, [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]]);
    }
}
