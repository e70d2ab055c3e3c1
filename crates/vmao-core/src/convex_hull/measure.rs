//! Volume, centroid and inertia of a closed surface of triangles: sums over the tetrahedra on a common point.

use nalgebra::{Matrix3, Point3, Vector3};

/// What the inside of a surface amounts to at unit density.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measures {
    /// m³; negative if the faces are turned inwards.
    pub(super) volume: f64,
    /// m.
    pub(super) centroid: Point3<f64>,
    /// About the centroid (m⁵).
    pub(super) inertia: Matrix3<f64>,
}

impl Measures {
    /// Each tetrahedron (o, a, b, c) of volume d/6 has second moments d/120 (aaᵀ + bbᵀ + ccᵀ + ssᵀ), s = a + b + c.
    pub(super) fn new(vertices: &[Point3<f64>], faces: &[[u32; 3]]) -> Self {
        // A point of the solid itself keeps the tetrahedra from cancelling out.
        let origin = vertices.iter().map(|vertex| vertex.coords).sum::<Vector3<f64>>() / vertices.len() as f64;
        let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for corners in faces {
            let [a, b, c] = corners.map(|corner| vertices[corner as usize].coords - origin);
            let (d, s) = (a.dot(&b.cross(&c)), a + b + c);
            volume += d / 6.0;
            first += s * (d / 24.0);
            second += (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose()) * (d / 120.0);
        }
        let mean = if volume == 0.0 { Vector3::zeros() } else { first / volume };
        let about_mean: Matrix3<f64> = second - mean * mean.transpose() * volume;
        let inertia = Matrix3::identity() * about_mean.trace() - about_mean;
        Self { volume, centroid: Point3::from(origin + mean), inertia }
    }
}

/// The lowest and the highest coordinates.
pub(super) fn corners(vertices: &[Point3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    let start = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    vertices.iter().fold(start, |(low, high), vertex| (low.inf(&vertex.coords), high.sup(&vertex.coords)))
}
