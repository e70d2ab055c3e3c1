//! The convex hull of points: a tetrahedron that grows by the furthest point outside, as in quickhull.

use super::{ConvexHull, HullError, MAX_COORDINATE, MAX_VERTICES, measure};
use nalgebra::{Point3, Vector3};

/// Points this share of the size out of a face do not make another: the last bits of single precision.
const THIN: f64 = 1e-6;
/// Where rounding spoils the surface it is tried again with this many times that share, so often.
const COARSER: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];

struct Face {
    corners: [usize; 3],
    normal: Vector3<f64>,
    offset: f64,
    /// Points outside that no face before it has taken.
    outside: Vec<usize>,
}

impl Face {
    fn new(points: &[Point3<f64>], corners: [usize; 3]) -> Self {
        let [a, b, c] = corners.map(|corner| points[corner]);
        // A face without area sees no point; its neighbours do.
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        Self { corners, normal, offset: a.coords.dot(&normal), outside: Vec::new() }
    }

    fn height(&self, point: &Point3<f64>) -> f64 {
        point.coords.dot(&self.normal) - self.offset
    }

    fn walks(&self) -> [(usize, usize); 3] {
        let [a, b, c] = self.corners;
        [(a, b), (b, c), (c, a)]
    }
}

impl ConvexHull {
    /// The hull of `points` (m) with at most `most` vertices, those that matter the most; fails for flat or wild points.
    pub fn around(points: &[Point3<f64>], most: usize) -> Result<Self, HullError> {
        if points.len() < 4 {
            return Err(HullError::VertexCount { count: points.len() });
        }
        let wild = |point: &Point3<f64>| !point.iter().all(|x| x.abs() <= MAX_COORDINATE);
        if let Some(vertex) = points.iter().position(wild) {
            return Err(HullError::Vertex { vertex, found: points[vertex].into() });
        }
        let (low, high) = measure::corners(points);
        let size = (high - low).norm();
        let most = most.clamp(4, MAX_VERTICES);
        let mut result = Err(HullError::Flat { volume: 0.0 });
        for coarser in COARSER {
            let Some(faces) = grow(points, most, coarser * THIN * size) else { break };
            result = collected(points, &faces);
            if result.is_ok() {
                break;
            }
        }
        result
    }
}

/// The hull's faces; none if all points lie within `thin` (m) of a plane.
fn grow(points: &[Point3<f64>], most: usize, thin: f64) -> Option<Vec<Face>> {
    let [a, b, c, d] = tetrahedron(points, thin)?;
    let mut faces: Vec<Face> = [[a, b, c], [a, c, d], [a, d, b], [b, d, c]].map(|corners| Face::new(points, corners)).into();
    hand_out(points, &mut faces, 0, (0..points.len()).collect(), thin);
    for _ in 4..most {
        let furthest = |face: &Face| {
            let heights = face.outside.iter().map(|&point| (face.height(&points[point]), point));
            heights.reduce(|best, next| if next.0 > best.0 { next } else { best })
        };
        let best = faces.iter().filter_map(furthest).reduce(|best, next| if next.0 > best.0 { next } else { best });
        let Some((_, apex)) = best else { break };
        let (seen, mut kept): (Vec<Face>, Vec<Face>) = faces.into_iter().partition(|face| face.height(&points[apex]) > thin);
        let walks: Vec<(usize, usize)> = seen.iter().flat_map(Face::walks).collect();
        let orphans = seen.iter().flat_map(|face| &face.outside).copied().filter(|&point| point != apex).collect();
        let first = kept.len();
        for &(from, to) in walks.iter().filter(|&&(from, to)| !walks.contains(&(to, from))) {
            kept.push(Face::new(points, [from, to, apex]));
        }
        hand_out(points, &mut kept, first, orphans, thin);
        faces = kept;
    }
    Some(faces)
}

/// Gives each of `orphans` to the first face from `first` on that it is outside of.
fn hand_out(points: &[Point3<f64>], faces: &mut [Face], first: usize, orphans: Vec<usize>, thin: f64) {
    for point in orphans {
        if let Some(face) = faces[first..].iter_mut().find(|face| face.height(&points[point]) > thin) {
            face.outside.push(point);
        }
    }
}

/// Four points that span a solid, turned so that (a, b, c) is seen counter-clockwise from outside.
fn tetrahedron(points: &[Point3<f64>], thin: f64) -> Option<[usize; 4]> {
    let furthest = |measure: &dyn Fn(&Point3<f64>) -> f64| {
        let values = points.iter().map(measure).enumerate();
        let best = values.reduce(|best, next| if next.1 > best.1 { next } else { best });
        best.filter(|&(_, value)| value > thin).map(|(index, _)| index)
    };
    let (low, high) = measure::corners(points);
    let axis = (high - low).imax();
    let a = furthest(&|point| high[axis] + 2.0 * thin - point[axis])?;
    let b = furthest(&|point| (point - points[a]).norm())?;
    let line = (points[b] - points[a]).normalize();
    let c = furthest(&|point| (point - points[a]).cross(&line).norm())?;
    let normal = line.cross(&(points[c] - points[a])).normalize();
    let height = |point: &Point3<f64>| (point - points[a]).dot(&normal);
    let d = furthest(&|point| height(point).abs())?;
    Some(if height(&points[d]) < 0.0 { [a, b, c, d] } else { [a, c, b, d] })
}

fn collected(points: &[Point3<f64>], faces: &[Face]) -> Result<ConvexHull, HullError> {
    let mut used: Vec<usize> = faces.iter().flat_map(|face| face.corners).collect();
    used.sort_unstable();
    used.dedup();
    let index = |corner: usize| used.partition_point(|&point| point < corner) as u32;
    let corners = faces.iter().map(|face| face.corners.map(index)).collect();
    ConvexHull::new(used.iter().map(|&point| points[point]).collect(), corners)
}
