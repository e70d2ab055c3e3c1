//! Nearest neighbours by exhaustive search.

use super::squared_distance;

/// For each query its `count` nearest of `points`, nearest first; row-major queries × count. Panics if there are fewer points.
pub fn nearest(points: &[[f32; 3]], queries: &[[f32; 3]], count: usize) -> Vec<u32> {
    assert!(count <= points.len(), "{count} neighbours among {} points", points.len());
    let mut out = Vec::with_capacity(queries.len() * count);
    let mut best: Vec<(f32, u32)> = Vec::with_capacity(count + 1);
    for &query in queries {
        best.clear();
        for (i, &point) in points.iter().enumerate() {
            let distance = squared_distance(point, query);
            if best.len() == count && distance >= best[count - 1].0 {
                continue;
            }
            let place = best.iter().rposition(|&(d, _)| d <= distance).map_or(0, |p| p + 1);
            best.insert(place, (distance, i as u32));
            best.truncate(count);
        }
        out.extend(best.iter().map(|&(_, i)| i));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::random::Stream;

    #[test]
    fn the_nearest_come_first_and_ties_go_to_the_lower_index() {
        let points: Vec<[f32; 3]> = [0.3, 0.1, -0.1, 0.0].iter().map(|&x| [x, 0.0, 0.0]).collect();
        assert_eq!(nearest(&points, &[[0.0; 3], [0.4, 0.0, 0.0]], 3), vec![3, 1, 2, 0, 1, 3]);
    }

    #[test]
    fn it_agrees_with_sorting_everything() {
        let mut s = Stream::new(5, &[]);
        let mut cloud = |n| (0..n).map(|_| std::array::from_fn(|_| s.unit() as f32)).collect::<Vec<[f32; 3]>>();
        let (points, queries) = (cloud(67), cloud(31));
        let found = nearest(&points, &queries, 5);
        for (q, row) in queries.iter().zip(found.chunks(5)) {
            let mut all: Vec<u32> = (0..67).collect();
            all.sort_by(|&a, &b| squared_distance(points[a as usize], *q).total_cmp(&squared_distance(points[b as usize], *q)));
            assert_eq!(row, &all[..5]);
        }
    }
}
