//! Distances straight from the definition of the shapes, sharing nothing with the code under test.

use nalgebra::Point3;
use vmao_core::{geometry::Pose, shape::Shape};

/// The nearest point of a solid to a point, straight from the definition of the shape; cylinders exact.
fn project(shape: &Shape, world_from_shape: &Pose, point: &Point3<f64>) -> Point3<f64> {
    let p = world_from_shape.inverse_transform_point(point);
    let toward = |core: Point3<f64>, radius: f64| {
        let away = p - core;
        if away.norm() <= radius { p } else { core + away * (radius / away.norm()) }
    };
    let local = match *shape {
        Shape::Sphere { radius } => toward(Point3::origin(), radius),
        Shape::Capsule { radius, half_length } => toward(Point3::new(0.0, 0.0, p.z.clamp(-half_length, half_length)), radius),
        Shape::Cylinder { radius, half_length } => {
            let out = p.x.hypot(p.y);
            let shrink = if out > radius { radius / out } else { 1.0 };
            Point3::new(p.x * shrink, p.y * shrink, p.z.clamp(-half_length, half_length))
        }
        Shape::Box { half_extents: [x, y, z] } => Point3::new(p.x.clamp(-x, x), p.y.clamp(-y, y), p.z.clamp(-z, z)),
        Shape::Convex(ref hull) => {
            let corners = |face: &[u32; 3]| face.map(|corner| hull.vertices()[corner as usize]);
            let outside = |[a, b, c]: [Point3<f64>; 3]| (b - a).cross(&(c - a)).dot(&(p - a)) > 0.0;
            let seen = hull.faces().iter().map(corners).filter(|&face| outside(face));
            let nearest = seen.map(|face| on_triangle(face, &p)).min_by(|a, b| (a - p).norm().total_cmp(&(b - p).norm()));
            nearest.unwrap_or(p)
        }
    };
    world_from_shape * local
}

/// The nearest point of a triangle: over its inside, or on one of its sides.
fn on_triangle(corners: [Point3<f64>; 3], point: &Point3<f64>) -> Point3<f64> {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    let inside = |from: Point3<f64>, to: Point3<f64>| normal.cross(&(to - from)).dot(&(point - from)) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return point - normal * ((point - a).dot(&normal) / normal.norm_squared());
    }
    let on_side = |from: Point3<f64>, to: Point3<f64>| {
        let along = to - from;
        from + along * ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0)
    };
    let sides = [on_side(a, b), on_side(b, c), on_side(c, a)];
    sides.into_iter().fold(a, |best, next| if (next - point).norm() < (best - point).norm() { next } else { best })
}

/// Distance by alternating projections (von Neumann): slow, but shares nothing with the code under test.
pub(crate) fn slow_distance(a: &(Shape, Pose), b: &(Shape, Pose)) -> f64 {
    let mut q = Point3::from(b.1.translation.vector);
    let mut last = f64::INFINITY;
    for _ in 0..200_000 {
        let p = project(&a.0, &a.1, &q);
        q = project(&b.0, &b.1, &p);
        let gap = (p - q).norm();
        if last - gap < 1e-13 {
            return gap;
        }
        last = gap;
    }
    last
}
