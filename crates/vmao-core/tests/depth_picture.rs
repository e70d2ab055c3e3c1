//! Pictures against every ray tried on every solid, and windows against what a solid covers.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use vmao_core::depth_picture::{DepthPicture, Pinhole, Window};
use vmao_core::geometry::{Pose, rotation_exp};
use vmao_core::rays::{ahead, normal, span};
use vmao_core::shape::Shape;

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

fn shape() -> impl Strategy<Value = Shape> {
    let size = || 0.005..0.3_f64;
    prop_oneof![
        size().prop_map(|radius| Shape::Sphere { radius }),
        (size(), size()).prop_map(|(radius, half_length)| Shape::Capsule { radius, half_length }),
        (size(), size()).prop_map(|(radius, half_length)| Shape::Cylinder { radius, half_length }),
        prop::array::uniform3(size()).prop_map(|half_extents| Shape::Box { half_extents }),
    ]
}

fn placed() -> impl Strategy<Value = (Shape, Pose)> {
    (shape(), vector(1.2), vector(3.0))
        .prop_map(|(shape, place, turn)| (shape, Pose::from_parts(place.into(), rotation_exp(&turn))))
}

fn camera() -> impl Strategy<Value = Pinhole> {
    (vector(1.0), vector(3.0), 0.1..1.5_f64).prop_map(|(place, turn, half_tangent)| Pinhole {
        world_from_camera: Pose::from_parts(place.into(), rotation_exp(&turn)),
        width: 23,
        height: 17,
        half_tangent,
    })
}

/// Depth at which the ray of this pixel meets the solid.
fn depth(camera: &Pinhole, row: usize, column: usize, shape: &Shape, world_from_solid: &Pose) -> Option<f64> {
    let solid_from_camera = world_from_solid.inverse() * camera.world_from_camera;
    let direction = solid_from_camera * Vector3::new(camera.x(column), camera.y(row), 1.0);
    ahead(span(shape, &solid_from_camera.translation.vector, &direction)?)
}

proptest! {
    #[test]
    fn a_picture_shows_at_each_pixel_of_its_window_the_nearest_of_all_solids(
        camera in camera(),
        solids in prop::collection::vec(placed(), 1..6),
        (top, left, rows, columns) in (0..17_usize, 0..23_usize, 1..17_usize, 1..23_usize),
    ) {
        let window = Window { rows: top..(top + rows).min(camera.height), columns: left..(left + columns).min(camera.width) };
        let mut picture = DepthPicture::new(&camera);
        for (index, (shape, pose)) in (0..).zip(&solids) {
            picture.add_solid(&camera, &window, index, shape, pose);
        }
        for row in window.rows.clone() {
            for column in window.columns.clone() {
                let all = solids.iter().map(|(shape, pose)| depth(&camera, row, column, shape, pose));
                let nearest = all.flatten().fold(f64::INFINITY, f64::min);
                let seen = picture.at(row, column).map_or(f64::INFINITY, |(_, depth)| depth);
                prop_assert!(seen == nearest || (seen - nearest).abs() < 1e-9, "{seen} m, expected {nearest} m");
            }
        }
    }

    #[test]
    fn a_window_misses_no_pixel_and_is_tight_around_what_is_in_front(camera in camera(), (shape, pose) in placed()) {
        let window = camera.window(&shape, &pose);
        for row in 0..camera.height {
            for column in 0..camera.width {
                let inside = window.rows.contains(&row) && window.columns.contains(&column);
                prop_assert!(inside || depth(&camera, row, column, &shape, &pose).is_none(), "row {row}, column {column}: {window:?}");
            }
        }
        // A window that is not the whole picture ends within a pixel of a ball that the camera sees whole.
        if let Shape::Sphere { radius } = shape {
            let center = camera.world_from_camera.inverse() * Point3::from(pose.translation.vector);
            if center.z > radius {
                let count = |range: &std::ops::Range<usize>| range.len() as f64;
                let width = 2.0 * camera.half_tangent / camera.height as f64;
                // The largest angle between two rays that touch the ball bounds what it covers.
                let half = (radius / center.coords.norm()).asin() + (center.x.hypot(center.y) / center.z).atan();
                let widest = if half < std::f64::consts::FRAC_PI_2 { 2.0 * half.tan() / width + 1.0 } else { f64::INFINITY };
                prop_assert!(count(&window.rows) <= widest && count(&window.columns) <= widest, "{window:?}, {widest}");
            }
        }
    }

    #[test]
    fn a_span_begins_and_ends_on_the_surface(shape in shape(), origin in vector(0.6), direction in vector(1.0)) {
        prop_assume!(direction.norm() > 1e-3);
        let inside = |point: &Vector3<f64>| {
            let out = normal(&shape, point);
            // Just inside and just outside along the normal, told by a ray that starts there.
            let holds = |point: Vector3<f64>| span(&shape, &point, &out).is_some_and(|[enter, leave]| enter < 0.0 && leave > 0.0);
            (holds(point - out * 1e-6), holds(point + out * 1e-6))
        };
        if let Some([enter, leave]) = span(&shape, &origin, &direction) {
            prop_assert!(enter <= leave);
            for t in [enter, leave] {
                let square = normal(&shape, &(origin + direction * t)).dot(&direction.normalize()).abs();
                if square > 0.05 {
                    prop_assert_eq!(inside(&(origin + direction * t)), (true, false), "{:?} at {}", &shape, t);
                }
            }
        }
    }
}

#[test]
fn rays_along_faces_and_axes_are_inside_all_the_way_or_not_at_all() {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let cuboid = Shape::Box { half_extents: [0.1, 0.2, 0.3] };
    let cylinder = Shape::Cylinder { radius: 0.1, half_length: 0.3 };
    let capsule = Shape::Capsule { radius: 0.1, half_length: 0.3 };
    for (shape, origin, direction, expected) in [
        (&cuboid, y * 0.2 - x, x, Some([0.9, 1.1])),
        (&cuboid, y * (0.2 + 1e-12) - x, x, None),
        (&cuboid, Vector3::zeros(), -z, Some([-0.3, 0.3])),
        (&cuboid, Vector3::new(0.1, 0.2, 0.3), z, Some([-0.6, 0.0])),
        (&cylinder, x * 0.1 - z, z, Some([0.7, 1.3])),
        (&cylinder, x * (0.1 + 1e-12) - z, z, None),
        (&cylinder, z * 0.3 - x, x * 2.0, Some([0.45, 0.55])),
        (&capsule, -z, z, Some([0.6, 1.4])),
        (&capsule, x * 0.2 - z, z, None),
        (&capsule, z * 0.3 - x, x, Some([0.9, 1.1])),
        (&capsule, Vector3::zeros(), x, Some([-0.1, 0.1])),
    ] {
        let found = span(shape, &origin, &direction);
        let close = match (found, expected) {
            (Some(found), Some(expected)) => found.iter().zip(expected).all(|(a, b): (&f64, f64)| (a - b).abs() < 1e-12),
            (found, expected) => found.is_none() && expected.is_none(),
        };
        assert!(close, "{shape:?} from {origin} along {direction}: {found:?}, expected {expected:?}");
    }
    assert_eq!([ahead([-2.0, -1.0]), ahead([-1.0, 2.0]), ahead([0.0, 1.0])], [None, Some(2.0), Some(0.0)]);
}
