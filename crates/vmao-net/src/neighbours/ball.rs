//! Ball query.

use super::squared_distance;

/// For each centre the first `count` points within `radius` (m), in the order of `points`; row-major centres × count.
///
/// As in PointNet++, a row with fewer points repeats its first one; a row with none repeats the nearest point. Panics if `points`
/// is empty.
pub fn ball_query(points: &[[f32; 3]], centres: &[[f32; 3]], radius: f32, count: usize) -> Vec<u32> {
    assert!(!points.is_empty(), "a ball query among no points");
    let mut out = Vec::with_capacity(centres.len() * count);
    for &centre in centres {
        let start = out.len();
        let inside = points.iter().enumerate().filter(|&(_, &p)| squared_distance(p, centre) <= radius * radius);
        out.extend(inside.take(count).map(|(i, _)| i as u32));
        if out.len() == start {
            let gap = |i: usize| squared_distance(points[i], centre);
            out.push((1..points.len()).fold(0, |best, i| if gap(i) < gap(best) { i } else { best }) as u32);
        }
        let first = out[start];
        out.resize(start + count, first);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_the_first_within_reach_and_repeat_the_first() {
        let points: Vec<[f32; 3]> = [0.0, 0.03, 0.01, 0.02, 0.10].iter().map(|&x| [x, 0.0, 0.0]).collect();
        let found = ball_query(&points, &[[0.0, 0.0, 0.0], [0.10, 0.0, 0.0], [0.5, 0.0, 0.0]], 0.0201, 3);
        assert_eq!(found, vec![0, 2, 3, 4, 4, 4, 4, 4, 4]);
        assert_eq!(ball_query(&points, &[[0.02, 0.0, 0.0]], 0.0201, 2), vec![0, 1], "the order of the points, not the nearest");
    }
}
