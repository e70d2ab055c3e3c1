//! Signed distance between primitive solids.
//!
//! Every solid is a zonotope (centre plus generators) grown by a radius: a ball has no generator, a capsule one, a box
//! three, a cylinder the seven of the 12-sided prism around it. The difference of two zonotopes is the zonotope of all
//! their generators, so one routine serves all pairs: separating axes give the depth when the cores overlap, the
//! Gilbert-Johnson-Keerthi (1988) iteration gives the distance when they do not.

use crate::{geometry::Pose, shape::Shape};
use nalgebra::{Matrix3, Vector3};

/// Most generators of one solid: the prism around a cylinder.
const MAX_GENERATORS: usize = 7;
/// Half the number of sides of the prism around a cylinder; it sticks out by 1/cos(π/12) − 1 = 3.5 % of the radius.
const PRISM_GENERATORS: usize = 6;

/// A convex solid: { centre + Σ aᵢ gᵢ, |aᵢ| ≤ 1 } grown by a radius (m).
#[derive(Debug, Clone, Copy)]
pub struct Convex {
    center: Vector3<f64>,
    generators: [Vector3<f64>; MAX_GENERATORS],
    count: usize,
    radius: f64,
    bound: f64,
}

impl Convex {
    /// The solid of `shape` with its own frame at `frame_from_shape`; cylinders become the 12-sided prism around them.
    pub fn new(shape: &Shape, frame_from_shape: &Pose) -> Self {
        let mut local =
            Self { center: Vector3::zeros(), generators: [Vector3::zeros(); MAX_GENERATORS], count: 0, radius: 0.0, bound: 0.0 };
        match *shape {
            Shape::Sphere { radius } => local.radius = radius,
            Shape::Capsule { radius, half_length } => {
                local.radius = radius;
                local.push(Vector3::z() * half_length);
            }
            Shape::Cylinder { radius, half_length } => {
                let angle = std::f64::consts::PI / PRISM_GENERATORS as f64;
                for side in 0..PRISM_GENERATORS {
                    let (sine, cosine) = (angle * side as f64).sin_cos();
                    local.push(Vector3::new(cosine, sine, 0.0) * (radius * (angle / 2.0).tan()));
                }
                local.push(Vector3::z() * half_length);
                local.bound = half_length.hypot(radius / (angle / 2.0).cos());
            }
            Shape::Box { half_extents: [x, y, z] } => {
                local.push(Vector3::x() * x);
                local.push(Vector3::y() * y);
                local.push(Vector3::z() * z);
                local.bound = Vector3::new(x, y, z).norm();
            }
        }
        if local.bound == 0.0 {
            local.bound = local.generators[..local.count].iter().map(Vector3::norm).sum::<f64>() + local.radius;
        }
        let mut placed = local;
        placed.place(&local, frame_from_shape.rotation.to_rotation_matrix().matrix(), &frame_from_shape.translation.vector);
        placed
    }

    /// Makes this `local` seen from a frame in which local's own frame has this `rotation` and `origin`.
    ///
    /// Both must come from the same shape: only what the motion changes is written.
    pub fn place(&mut self, local: &Self, rotation: &Matrix3<f64>, origin: &Vector3<f64>) {
        self.center = rotation * local.center + origin;
        for (to, from) in self.generators.iter_mut().zip(&local.generators).take(local.count) {
            *to = rotation * from;
        }
    }

    /// Radius of a ball around the centre that holds the whole solid (m).
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Centre of symmetry (m).
    pub fn center(&self) -> &Vector3<f64> {
        &self.center
    }

    /// Signed distance to the half-space z ≤ `height`, negative when inside (m).
    pub fn height_above(&self, height: f64) -> f64 {
        let reach: f64 = self.generators[..self.count].iter().map(|g| g.z.abs()).sum();
        self.center.z - reach - self.radius - height
    }

    /// Signed distance between two solids (m): negative is the shortest translation that separates them.
    pub fn signed_distance(&self, other: &Self) -> f64 {
        let radius = self.radius + other.radius;
        if self.count <= 1 && other.count <= 1 {
            return self.segment_distance(other) - radius;
        }
        let (generators, count) = self.difference(other);
        let (generators, offset) = (&generators[..count], self.center - other.center);
        let depth = separation(&offset, generators);
        // a flat set has no depth, only rounding; whether the origin is inside it is for the distance to say
        if depth < -1e-12 * (self.bound + other.bound) {
            return depth - radius;
        }
        core_distance(&offset, generators, f64::INFINITY) - radius
    }

    /// Whether the two solids come closer than `margin` (m); cheaper than the distance.
    pub fn closer_than(&self, other: &Self, margin: f64) -> bool {
        let reach = self.bound + other.bound + margin;
        if reach <= 0.0 || (self.center - other.center).norm_squared() >= reach * reach {
            return false;
        }
        let cores = margin + self.radius + other.radius;
        if cores <= 0.0 {
            return self.signed_distance(other) < margin;
        }
        if self.count <= 1 && other.count <= 1 {
            return self.segment_distance(other) < cores;
        }
        let (generators, count) = self.difference(other);
        core_distance(&(self.center - other.center), &generators[..count], cores) < cores
    }

    fn push(&mut self, generator: Vector3<f64>) {
        if generator != Vector3::zeros() {
            self.generators[self.count] = generator;
            self.count += 1;
        }
    }

    fn difference(&self, other: &Self) -> ([Vector3<f64>; 2 * MAX_GENERATORS], usize) {
        let mut all = [Vector3::zeros(); 2 * MAX_GENERATORS];
        all[..self.count].copy_from_slice(&self.generators[..self.count]);
        all[self.count..self.count + other.count].copy_from_slice(&other.generators[..other.count]);
        (all, self.count + other.count)
    }

    /// Distance between two segments (or points): the least of the interior pair and the four ends against the other.
    fn segment_distance(&self, other: &Self) -> f64 {
        let (g, h) = (self.generators[0], other.generators[0]); // zero when absent
        let offset = self.center - other.center;
        let (gg, hh, gh) = (g.norm_squared(), h.norm_squared(), g.dot(&h));
        let (og, oh) = (offset.dot(&g), offset.dot(&h));
        let determinant = gg * hh - gh * gh;
        if determinant > 1e-14 * gg * hh {
            let s = (gh * oh - hh * og) / determinant;
            let t = (gg * oh - gh * og) / determinant;
            if s.abs() <= 1.0 && t.abs() <= 1.0 {
                return (offset + g * s - h * t).norm();
            }
        }
        let best = |fixed: Vector3<f64>, along: Vector3<f64>, square: f64| {
            let t = if square > 0.0 { (fixed.dot(&along) / square).clamp(-1.0, 1.0) } else { 0.0 };
            (fixed - along * t).norm_squared()
        };
        let ends = [best(offset + g, h, hh), best(offset - g, h, hh), best(-offset + h, g, gg), best(-offset - h, g, gg)];
        ends.into_iter().fold(f64::INFINITY, f64::min).sqrt()
    }
}

/// Greatest separation of the origin from the zonotope at `offset` over its facet normals; negative is the depth inside.
fn separation(offset: &Vector3<f64>, generators: &[Vector3<f64>]) -> f64 {
    let mut greatest = f64::NEG_INFINITY;
    for (i, a) in generators.iter().enumerate() {
        for b in &generators[i + 1..] {
            let normal = a.cross(b);
            let square = normal.norm_squared();
            if square <= 1e-12 * a.norm_squared() * b.norm_squared() {
                continue; // parallel: no facet, or one too thin to matter
            }
            let reach: f64 = generators.iter().map(|g| g.dot(&normal).abs()).sum();
            greatest = greatest.max((offset.dot(&normal).abs() - reach) / square.sqrt());
        }
    }
    if greatest == f64::NEG_INFINITY { 0.0 } else { greatest }
}

/// Distance of the origin from the zonotope at `offset`; once it is known to exceed `enough`, any lower bound above that.
fn core_distance(offset: &Vector3<f64>, generators: &[Vector3<f64>], enough: f64) -> f64 {
    const MAX_ITERATIONS: usize = 64; // polytopes this small need under ten; this only stops a rounding cycle
    let scale = offset.norm() + generators.iter().map(Vector3::norm).sum::<f64>();
    let mut nearest = *offset;
    let mut simplex = Simplex { points: [Vector3::zeros(); 4], count: 0 };
    for _ in 0..MAX_ITERATIONS {
        let square = nearest.norm_squared();
        if square <= 1e-24 * scale * scale {
            return 0.0;
        }
        let support = generators.iter().fold(*offset, |point, g| if g.dot(&nearest) >= 0.0 { point - g } else { point + g });
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
