//! The difference of two cores: where the origin lies in it says how far apart they are, or how deep in each other.

use super::{Convex, MAX_GENERATORS, PlacedHull};
use nalgebra::Vector3;

/// { `offset` + Σ aᵢ gᵢ + p − q, |aᵢ| ≤ 1 } with p in the first hull and q in the second, where there are any.
pub(super) struct Difference<'a> {
    offset: Vector3<f64>,
    generators: [Vector3<f64>; 2 * MAX_GENERATORS],
    count: usize,
    first: Option<&'a PlacedHull>,
    second: Option<&'a PlacedHull>,
    /// Rounding is measured against this (m).
    scale: f64,
}

impl<'a> Difference<'a> {
    pub(super) fn new(first: &'a Convex, second: &'a Convex) -> Self {
        let mut generators = [Vector3::zeros(); 2 * MAX_GENERATORS];
        let count = first.count + second.count;
        generators[..first.count].copy_from_slice(&first.generators[..first.count]);
        generators[first.count..count].copy_from_slice(&second.generators[..second.count]);
        let scale = first.bound + second.bound;
        let offset = first.center - second.center;
        Self { offset, generators, count, first: first.hull.as_ref(), second: second.hull.as_ref(), scale }
    }

    fn generators(&self) -> &[Vector3<f64>] {
        &self.generators[..self.count]
    }

    fn hulls(&self) -> impl Iterator<Item = &PlacedHull> {
        self.first.into_iter().chain(self.second)
    }

    /// Distance of the cores, negative by the shortest way out when they overlap (m).
    pub(super) fn signed_distance(&self) -> f64 {
        if self.hulls().next().is_some() {
            // Most pairs are apart, and the axes of a hull are many.
            let distance = self.distance(f64::INFINITY);
            return if distance > 0.0 { distance } else { self.separation().min(0.0) };
        }
        let depth = self.separation();
        // a flat set has no depth, only rounding; whether the origin is inside it is for the distance to say
        if depth < -1e-12 * self.scale { depth } else { self.distance(f64::INFINITY) }
    }

    /// Greatest separation of the origin over the facet normals; negative is the depth inside.
    ///
    /// A facet's normal is that of a face of a hull, or is square to two of the generators and edges of hulls.
    fn separation(&self) -> f64 {
        let mut greatest = f64::NEG_INFINITY;
        for (i, a) in self.generators().iter().enumerate() {
            for b in &self.generators()[i + 1..] {
                greatest = greatest.max(self.separation_across(a, b));
            }
        }
        for hull in self.hulls() {
            for plane in hull.hull.planes() {
                greatest = greatest.max(self.separation_along(&(hull.rotation * plane.normal)));
            }
            for edge in hull.edges() {
                for generator in self.generators() {
                    greatest = greatest.max(self.separation_across(&edge.along, generator));
                }
            }
        }
        if let (Some(first), Some(second)) = (self.first, self.second) {
            let others: Vec<PlacedEdge> = second.edges().collect();
            for edge in first.edges() {
                for other in others.iter().filter(|other| edge.makes_a_facet_against(other)) {
                    greatest = greatest.max(self.separation_across(&edge.along, &other.along));
                }
            }
        }
        if greatest == f64::NEG_INFINITY { 0.0 } else { greatest }
    }

    /// Separation along the directions square to both; none if they are parallel.
    fn separation_across(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        let normal = a.cross(b);
        let square = normal.norm_squared();
        if square <= 1e-12 * a.norm_squared() * b.norm_squared() {
            return f64::NEG_INFINITY; // parallel: no facet, or one too thin to matter
        }
        self.separation_along(&normal) / square.sqrt()
    }

    /// The greater separation along `normal` and against it, times its length.
    fn separation_along(&self, normal: &Vector3<f64>) -> f64 {
        let reach: f64 = self.generators().iter().map(|g| g.dot(normal).abs()).sum();
        let along = self.offset.dot(normal);
        let range = |hull: Option<&PlacedHull>| hull.map_or((0.0, 0.0), |hull| hull.range(normal));
        let ((first_low, first_high), (second_low, second_high)) = (range(self.first), range(self.second));
        (along + first_low - second_high).max(second_low - first_high - along) - reach
    }

    /// The point furthest against `direction`.
    fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let zonotope = |point, g: &Vector3<f64>| if g.dot(direction) >= 0.0 { point - g } else { point + g };
        let mut point = self.generators().iter().fold(self.offset, zonotope);
        if let Some(hull) = self.first {
            point += hull.support(&-direction);
        }
        if let Some(hull) = self.second {
            point -= hull.support(direction);
        }
        point
    }

    /// Distance of the origin; once it is known to exceed `enough`, any lower bound above that.
    pub(super) fn distance(&self, enough: f64) -> f64 {
        const MAX_ITERATIONS: usize = 64; // polytopes this small need under ten; this only stops a rounding cycle
        let scale = self.offset.norm() + self.generators().iter().map(Vector3::norm).sum::<f64>() + self.scale_of_hulls();
        // The middle of a hull's capsule need not lie in the hull.
        let mut nearest = if self.hulls().next().is_some() { self.support(&self.offset) } else { self.offset };
        let mut simplex = Simplex { points: [Vector3::zeros(); 4], count: 0 };
        for _ in 0..MAX_ITERATIONS {
            let square = nearest.norm_squared();
            if square <= 1e-24 * scale * scale {
                return 0.0;
            }
            let support = self.support(&nearest);
            let along = support.dot(&nearest);
            if along > 0.0 && along * along > enough * enough * square {
                return along / square.sqrt();
            }
            if square - along <= 1e-13 * square || simplex.points[..simplex.count].contains(&support) {
                return square.sqrt();
            }
            simplex.points[simplex.count] = support;
            simplex.count += 1;
            let Some(closer) = simplex.reduce() else { return 0.0 };
            if closer.norm_squared() >= square && simplex.count > 1 {
                return square.sqrt();
            }
            nearest = closer;
        }
        nearest.norm()
    }

    fn scale_of_hulls(&self) -> f64 {
        self.hulls().map(|hull| hull.hull.capsule().bound).sum()
    }
}

/// An edge of a hull and the normals of the two faces that meet there, in the common frame.
struct PlacedEdge {
    along: Vector3<f64>,
    normals: [Vector3<f64>; 2],
}

impl PlacedHull {
    fn edges(&self) -> impl Iterator<Item = PlacedEdge> + '_ {
        let (vertices, planes) = (self.hull.vertices(), self.hull.planes());
        self.hull.edges().iter().map(move |edge| {
            let [from, to] = edge.ends.map(|end| vertices[end as usize]);
            let normals = edge.faces.map(|face| self.rotation * planes[face as usize].normal);
            PlacedEdge { along: self.rotation * (to - from), normals }
        })
    }
}

impl PlacedEdge {
    /// Whether both arcs of normals, the other's seen from the opposite side, cross on the unit sphere (Gregorius 2013).
    ///
    /// Where they only touch, the normal is that of a face.
    fn makes_a_facet_against(&self, other: &Self) -> bool {
        let ([a, b], [c, d]) = (self.normals, other.normals.map(|normal| -normal));
        let (across, across_other) = (b.cross(&a), d.cross(&c));
        let (c_side, d_side) = (c.dot(&across), d.dot(&across));
        let (a_side, b_side) = (a.dot(&across_other), b.dot(&across_other));
        c_side * d_side < 0.0 && a_side * b_side < 0.0 && c_side * b_side > 0.0
    }
}

/// Up to four points; fewer once reduced to the face nearest to the origin.
struct Simplex {
    points: [Vector3<f64>; 4],
    count: usize,
}

impl Simplex {
    /// Keeps the smallest face that holds the point nearest to the origin and returns it; `None` if the origin is inside.
    fn reduce(&mut self) -> Option<Vector3<f64>> {
        let points = &self.points[..self.count];
        let (mut best, mut best_square, mut face, mut size) = (Vector3::zeros(), f64::INFINITY, [0; 3], 0);
        let mut offer = |point: Vector3<f64>, indices: &[usize]| {
            let square = point.norm_squared();
            if square < best_square {
                (best, best_square, size) = (point, square, indices.len());
                face[..indices.len()].copy_from_slice(indices);
            }
        };
        for (i, a) in points.iter().enumerate() {
            offer(*a, &[i]);
            for (j, b) in points.iter().enumerate().skip(i + 1) {
                let edge = b - a;
                let t = -a.dot(&edge) / edge.norm_squared();
                if t > 0.0 && t < 1.0 {
                    offer(a + edge * t, &[i, j]);
                }
                for (k, c) in points.iter().enumerate().skip(j + 1) {
                    let normal = edge.cross(&(c - a));
                    let square = normal.norm_squared();
                    let weights = [normal.dot(&b.cross(c)), normal.dot(&c.cross(a)), normal.dot(&a.cross(b))];
                    if weights.iter().all(|&w| w > 0.0) && square > 1e-24 * edge.norm_squared() * (c - a).norm_squared() {
                        offer(normal * (a.dot(&normal) / square), &[i, j, k]);
                    }
                }
            }
        }
        if let [a, b, c, d] = points {
            let whole = (b - a).cross(&(c - a)).dot(&(d - a));
            let parts = [b.cross(c).dot(d), -c.cross(d).dot(a), d.cross(a).dot(b), -a.cross(b).dot(c)];
            if whole != 0.0 && parts.iter().all(|&part| part * whole >= 0.0) {
                return None;
            }
        }
        let kept = face.map(|index| self.points[index]);
        self.points[..size].copy_from_slice(&kept[..size]);
        self.count = size;
        Some(best)
    }
}
