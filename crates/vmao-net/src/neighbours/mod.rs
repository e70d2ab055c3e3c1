//! Who is near whom in a cloud: farthest-point order, ball query, nearest neighbours.
//!
//! All in f32 on world-frame points (m), all deterministic: of equal candidates the lower index wins.

mod ball;
mod boxes;
pub(crate) mod columns;
mod farthest;
mod nearest;

pub use ball::ball_query;
pub use farthest::farthest_point_order;
pub use nearest::nearest;

/// Squared distance (m²).
pub(crate) fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (x, y, z) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    x * x + y * y + z * z
}
