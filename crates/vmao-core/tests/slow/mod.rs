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
    };
    world_from_shape * local
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
