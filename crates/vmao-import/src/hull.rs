//! Convex hulls: made of points, cut by planes, kept to few vertices, thickened where they are flat.

use nalgebra::{Matrix3, Point3, Unit, Vector3};
use parry3d_f64::math::Vector;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The most vertices of one hull.
pub const MAX_HULL_VERTICES: usize = 64;
/// A hull thinner than this share of its longest edge is flat.
const FLAT: f64 = 2e-3;
/// A flat hull becomes this thick, as a share of its longest edge.
const THICKENED: f64 = 1e-2;

/// A convex polyhedron: vertices, and triangles that face outward.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    /// Its vertices.
    pub vertices: Vec<Point3<f64>>,
    /// Its faces.
    pub faces: Vec<[u32; 3]>,
}

/// Whether a hull is as the points are, or had to be given a thickness.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Thickness {
    /// As it is.
    Own,
    /// It was flat.
    Given,
}

/// The smallest box along the principal axes of the points: centre, axes, half extents.
fn principal_box(points: &[Point3<f64>]) -> (Point3<f64>, Matrix3<f64>, Vector3<f64>) {
    let mean = points.iter().map(|point| point.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let covariance = points.iter().map(|point| (point.coords - mean) * (point.coords - mean).transpose()).sum::<Matrix3<f64>>();
    let axes = covariance.symmetric_eigen().eigenvectors;
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for point in points {
        let along = axes.transpose() * point.coords;
        low = low.inf(&along);
        high = high.sup(&along);
    }
    (Point3::from(axes * (low + high) / 2.0), axes, (high - low) / 2.0)
}

/// The hull of the points, at most [`MAX_HULL_VERTICES`] vertices; none if they are all in one place.
pub fn around(points: &[Point3<f64>]) -> Option<(Hull, Thickness)> {
    if points.is_empty() {
        return None;
    }
    let (center, axes, mut half) = principal_box(points);
    let longest = half.max();
    if !(longest.is_finite() && longest > 1e-9) {
        return None;
    }
    if half.iter().any(|edge| *edge < FLAT / 2.0 * longest) {
        // Flat or a line: a thin box of the same place and extent.
        half.apply(|edge| *edge = edge.max(THICKENED / 2.0 * longest));
        let corner = |corner: u32| {
            let sign = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            center + axes * half.component_mul(&Vector3::new(sign(0), sign(1), sign(2)))
        };
        let corners: Vec<Point3<f64>> = (0..8).map(corner).collect();
        return Some((exact(&corners)?, Thickness::Given));
    }
    // At the unit's scale the library's tolerances fit.
    let unit: Vec<Point3<f64>> = points.iter().map(|point| Point3::from((point - center) / longest)).collect();
    let hull = exact(&unit)?;
    let hull = if hull.vertices.len() > MAX_HULL_VERTICES { exact(&outermost(&hull.vertices))? } else { hull };
    let vertices = hull.vertices.iter().map(|vertex| center + vertex.coords * longest).collect();
    Some((Hull { vertices, faces: hull.faces }, Thickness::Own))
}

/// The hull as the library makes it; none where it fails.
fn exact(points: &[Point3<f64>]) -> Option<Hull> {
    let points: Vec<Vector> = points.iter().map(|point| Vector::new(point.x, point.y, point.z)).collect();
    let made = contained(|| parry3d_f64::transformation::try_convex_hull(&points))?.ok()?;
    let (vertices, faces) = made;
    let vertices = vertices.iter().map(|vertex| Point3::new(vertex.x, vertex.y, vertex.z)).collect();
    let hull = Hull { vertices, faces };
    hull.is_closed().then_some(hull)
}

/// Runs foreign geometry that may panic on degenerate input; none if it did.
pub(crate) fn contained<T>(work: impl FnOnce() -> T) -> Option<T> {
    // Only plain data goes in, and what was half built is dropped with the closure.
    catch_unwind(AssertUnwindSafe(work)).ok()
}

/// Of many vertices of a hull, those that reach furthest in evenly spread directions (a Fibonacci lattice).
fn outermost(vertices: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let mut chosen: Vec<usize> = (0..MAX_HULL_VERTICES)
        .map(|index| {
            let z = 1.0 - (2.0 * index as f64 + 1.0) / MAX_HULL_VERTICES as f64;
            let (radius, turn) = ((1.0 - z * z).sqrt(), golden * index as f64);
            let direction = Vector3::new(radius * turn.cos(), radius * turn.sin(), z);
            let reach = |index: &usize| vertices[*index].coords.dot(&direction);
            (0..vertices.len()).max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or_default()
        })
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen.into_iter().map(|index| vertices[index]).collect()
}

impl Hull {
    /// The corners of a face.
    pub fn triangle(&self, face: &[u32; 3]) -> [Point3<f64>; 3] {
        face.map(|corner| self.vertices[corner as usize])
    }

    /// Its volume.
    pub fn volume(&self) -> f64 {
        let origin = self.vertices[0];
        let tetrahedron = |face: &[u32; 3]| {
            let [a, b, c] = self.triangle(face).map(|corner| corner - origin);
            a.dot(&b.cross(&c)) / 6.0
        };
        self.faces.iter().map(tetrahedron).sum()
    }

    /// The area of its surface.
    pub fn area(&self) -> f64 {
        self.faces.iter().map(|face| crate::mesh::area_vector(&self.triangle(face)).norm() / 2.0).sum()
    }

    /// Whether every edge has two faces, one for each sense.
    fn is_closed(&self) -> bool {
        let edges = |face: &[u32; 3]| [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])];
        let mut there: Vec<(u32, u32)> = self.faces.iter().flat_map(edges).collect();
        let mut back: Vec<(u32, u32)> = there.iter().map(|&(a, b)| (b, a)).collect();
        there.sort_unstable();
        back.sort_unstable();
        !there.is_empty() && there == back && there.windows(2).all(|pair| pair[0] != pair[1])
    }

    /// Whether it is what its type says: indices in range, closed, convex up to rounding, with a volume.
    pub fn is_sound(&self) -> bool {
        let in_range = |face: &[u32; 3]| face.iter().all(|&corner| (corner as usize) < self.vertices.len());
        let finite = self.vertices.iter().all(|vertex| vertex.iter().all(|x| x.is_finite()));
        if !(finite && self.vertices.len() >= 4 && self.faces.iter().all(in_range) && self.is_closed()) {
            return false;
        }
        let size = self.vertices.iter().map(|vertex| (vertex - self.vertices[0]).norm()).fold(0.0, f64::max);
        self.volume() > 0.0 && self.vertices.iter().all(|vertex| self.beyond(vertex) <= 1e-6 * size)
    }

    /// Unit normals of its faces with their distance from the origin; degenerate faces have none.
    pub fn planes(&self) -> impl Iterator<Item = (Unit<Vector3<f64>>, f64)> {
        self.faces.iter().filter_map(|face| {
            let triangle = self.triangle(face);
            let normal = Unit::try_new(crate::mesh::area_vector(&triangle), 0.0)?;
            Some((normal, normal.dot(&triangle[0].coords)))
        })
    }

    /// How far a point is beyond the face that it is furthest beyond: negative inside.
    pub fn beyond(&self, point: &Point3<f64>) -> f64 {
        self.planes().map(|(normal, offset)| normal.dot(&point.coords) - offset).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Least and greatest extent along a direction.
    pub fn extent(&self, direction: &Vector3<f64>) -> [f64; 2] {
        let along = self.vertices.iter().map(|vertex| vertex.coords.dot(direction));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    }

    /// What is left where `normal · x <= offset`; none if nothing worth keeping is.
    pub fn cut(&self, normal: &Vector3<f64>, offset: f64) -> Option<Self> {
        let side = |point: &Point3<f64>| normal.dot(&point.coords) - offset;
        let mut kept: Vec<Point3<f64>> = self.vertices.iter().copied().filter(|vertex| side(vertex) <= 0.0).collect();
        for face in &self.faces {
            for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
                let (a, b) = (self.vertices[a as usize], self.vertices[b as usize]);
                let (before, after) = (side(&a), side(&b));
                // Every edge is walked in both senses; once is enough.
                if before < 0.0 && after > 0.0 {
                    kept.push(a + (b - a) * (before / (before - after)));
                }
            }
        }
        match around(&kept)? {
            (hull, Thickness::Own) => Some(hull),
            (_, Thickness::Given) => None,
        }
    }

    /// Its vertices, each moved.
    #[must_use]
    pub fn mapped(&self, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> Self {
        Self { vertices: self.vertices.iter().map(place).collect(), faces: self.faces.clone() }
    }
}
