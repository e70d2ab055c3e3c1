//! What the depth of two solids in each other means: the length of the shortest motion that parts them.

use nalgebra::Vector3;
use vmao_core::{distance::Convex, geometry::Pose, random::Stream, shape::Shape};

/// Checks in `tries` random directions that no shorter motion of `other` parts the two, and returns how far apart the best
/// motion a twentieth longer brings them (m; negative: still in each other).
pub(crate) fn best_way_out(first: &Convex, other: (&Shape, &Pose), depth: f64, tries: usize, stream: &mut Stream) -> f64 {
    let moved = |by: Vector3<f64>| {
        first.signed_distance(&Convex::new(other.0, &(Pose::from_parts(by.into(), Default::default()) * other.1)))
    };
    let mut freed = f64::NEG_INFINITY;
    for _ in 0..tries {
        let way = Vector3::new(stream.normal(), stream.normal(), stream.normal()).normalize();
        assert!(moved(way * depth * 0.999) < 0.0, "no shorter way out, but {way:?}");
        freed = freed.max(moved(way * depth * 1.05));
    }
    freed
}
