//! Convex hulls: what is refused, and measures and distances of boxes written as hulls against the boxes' own.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod way_out;

use nalgebra::{Matrix3, Point3, Vector3};
use proptest::prelude::*;
use vmao_core::{
    convex_hull::{ConvexHull, HullError, MAX_VERTICES},
    distance::Convex,
    geometry::{Pose, pose, translation},
    random::Stream,
    shape::Shape,
};
use way_out::best_way_out;

/// A box as eight vertices and twelve triangles, its middle at `middle`.
fn block(half: [f64; 3], middle: [f64; 3]) -> (Vec<Point3<f64>>, Vec<[u32; 3]>) {
    let corner = |index: usize| {
        let at = |axis: usize| middle[axis] + if index >> axis & 1 == 1 { half[axis] } else { -half[axis] };
        Point3::new(at(0), at(1), at(2))
    };
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    ((0..8).map(corner).collect(), sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

fn hull(half: [f64; 3], middle: [f64; 3]) -> ConvexHull {
    let (vertices, faces) = block(half, middle);
    ConvexHull::new(vertices, faces).unwrap()
}

/// Points in all directions at distances near one, stretched.
fn stone(seed: u64, count: usize) -> Vec<Point3<f64>> {
    let mut stream = Stream::new(seed, &[]);
    let scale = Vector3::new(0.06, 0.025, 0.04);
    let mut point = || Vector3::new(stream.normal(), stream.normal(), stream.normal()).normalize().component_mul(&scale);
    (0..count).map(|_| Point3::from(point())).collect()
}

#[test]
fn what_bounds_no_convex_solid_is_refused_by_name() {
    let (vertices, faces) = block([0.1, 0.2, 0.3], [0.0; 3]);
    let new = |vertices: &[Point3<f64>], faces: &[[u32; 3]]| ConvexHull::new(vertices.to_vec(), faces.to_vec()).unwrap_err();
    let with = |vertex: usize, at: Point3<f64>| {
        let mut changed = vertices.clone();
        changed[vertex] = at;
        changed
    };
    for wild in [f64::NAN, f64::INFINITY, -1e300, 100.1] {
        let error = new(&with(5, Point3::new(0.1, wild, 0.0)), &faces);
        assert!(matches!(error, HullError::Vertex { vertex: 5, .. }), "{error}");
    }
    assert_eq!(new(&vertices[..3], &faces), HullError::VertexCount { count: 3 });
    assert_eq!(new(&[], &[]), HullError::VertexCount { count: 0 });
    let many = vec![Point3::origin(); MAX_VERTICES + 1];
    assert_eq!(new(&many, &faces), HullError::VertexCount { count: MAX_VERTICES + 1 });
    assert!(matches!(new(&vertices, &[[0, 1, 8]]), HullError::Face { face: 0, count: 8, .. }));
    assert!(matches!(new(&vertices, &[[0, 1, u32::MAX]]), HullError::Face { .. }));
    assert!(matches!(new(&vertices, &[[0, 1, 1]]), HullError::Face { .. }));
    assert!(matches!(new(&vertices, &faces[..11]), HullError::Open { .. }), "a hole");
    assert!(matches!(new(&vertices, &[&faces[..], &faces[..1]].concat()), HullError::Open { .. }), "a face twice");
    let mut flipped = faces.clone();
    flipped[3].swap(0, 1);
    assert!(matches!(new(&vertices, &flipped), HullError::Open { .. }), "one face turned");
    let inside_out: Vec<[u32; 3]> = faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
    assert_eq!(new(&vertices, &inside_out), HullError::Inward);
    let spare = [&vertices[..], &[Point3::origin()]].concat();
    assert_eq!(new(&spare, &faces), HullError::Topology { vertices: 9, faces: 12 });
    let (other, _) = block([0.1; 3], [1.0; 3]);
    let shifted: Vec<[u32; 3]> = faces.iter().map(|face| face.map(|corner| corner + 8)).collect();
    let two = new(&[vertices.clone(), other].concat(), &[faces.clone(), shifted].concat());
    assert_eq!(two, HullError::Topology { vertices: 16, faces: 24 });
    assert!(matches!(new(&with(7, Point3::new(-0.05, -0.1, -0.1)), &faces), HullError::NotConvex { .. }), "a dent");
    let flat: Vec<Point3<f64>> = vertices.iter().map(|vertex| Point3::new(vertex.x, vertex.y, 0.0)).collect();
    assert!(matches!(new(&flat, &faces), HullError::Flat { .. }));
    assert!(matches!(new(&[Point3::origin(); 8], &faces), HullError::Flat { .. }));
}

#[test]
fn a_box_as_a_hull_measures_as_the_box() {
    let (half, middle) = ([0.1, 0.02, 0.3], [1.0, -2.0, 0.5]);
    let (cuboid, solid) = (Shape::Box { half_extents: half }, Shape::Convex(hull(half, middle)));
    assert!((solid.volume() - cuboid.volume()).abs() < 1e-15);
    assert!((solid.centroid() - Point3::from(middle)).norm() < 1e-12);
    assert!((solid.inertia(0.7) - cuboid.inertia(0.7)).norm() < 1e-13, "{}", solid.inertia(0.7));
    let direction = Vector3::new(0.3, -0.8, 0.2).normalize();
    let reach = cuboid.extent_along(&direction) + direction.dot(&Vector3::from(middle));
    assert!((solid.extent_along(&direction) - reach).abs() < 1e-12);
    assert_eq!(solid.support(&direction), Point3::new(1.1, -2.02, 0.8));
    for shape in [cuboid, Shape::Capsule { radius: 0.1, half_length: 0.3 }, Shape::Cylinder { radius: 0.1, half_length: 0.3 }] {
        let reach = shape.support(&direction).coords.dot(&direction);
        assert!((reach - shape.extent_along(&direction)).abs() < 1e-12, "{shape:?}");
    }
}

#[test]
fn the_inertia_of_primitives_is_that_of_points_spread_in_them() {
    let mut stream = Stream::new(3, &[]);
    let (radius, half_length) = (0.3, 0.5);
    for shape in [
        Shape::Sphere { radius },
        Shape::Capsule { radius, half_length },
        Shape::Cylinder { radius, half_length },
        Shape::Box { half_extents: [radius, half_length, 0.2] },
        Shape::Convex(ConvexHull::around(&stone(2, 60), 60).unwrap()),
    ] {
        let solid = Convex::new(&shape, &Pose::identity());
        let (mut sum, mut count) = (Matrix3::zeros(), 0.0);
        let size =
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| shape.extent_along(&axis).max(shape.extent_along(&-axis)));
        while count < 40_000.0 {
            let point = Vector3::from(size.map(|half| stream.range(-half, half)));
            let dot = Convex::new(&Shape::Sphere { radius: 0.0 }, &translation(point.x, point.y, point.z));
            if solid.signed_distance(&dot) <= 0.0 {
                let arm = point - shape.centroid().coords;
                sum += Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
                count += 1.0;
            }
        }
        let error = (sum / count - shape.inertia(1.0)).norm() / shape.inertia(1.0).norm();
        // the prism around a cylinder is up to 3.5 % too wide
        assert!(error < 0.04, "{shape:?}: {error}");
    }
}

#[test]
fn documents_hold_hulls_and_reading_checks_them() {
    let shape = Shape::Convex(ConvexHull::around(&stone(1, 40), 40).unwrap());
    let text = serde_json::to_string(&shape).unwrap();
    assert!(text.starts_with(r#"{"type":"convex","vertices":[["#), "{text}");
    let (Shape::Convex(before), Shape::Convex(after)) = (&shape, serde_json::from_str(&text).unwrap()) else { panic!("a hull") };
    assert_eq!(after.faces(), before.faces());
    for (before, after) in before.vertices().iter().zip(after.vertices()) {
        assert!((after - before).norm() < 1e-16, "as exact as this reader of numbers is");
    }
    let torn = text.replace("\"faces\":[[", "\"faces\":[[0,1,2],[");
    assert!(serde_json::from_str::<Shape>(&torn).unwrap_err().to_string().contains("expected"), "one face too many");
}

#[test]
fn hulls_around_points_hold_them_all_or_those_that_matter() {
    for seed in 0..20 {
        let points = stone(seed, 200);
        let whole = ConvexHull::around(&points, MAX_VERTICES).unwrap();
        assert_eq!(whole.vertices().len(), 200, "all lie on an ellipsoid");
        let coarse = ConvexHull::around(&points, 24).unwrap();
        assert_eq!(coarse.vertices().len(), 24);
        assert!(coarse.volume() < whole.volume() && coarse.volume() > 0.6 * whole.volume(), "{seed}");
    }
    // A lattice: faces full of points in one plane and edges full of points in one line.
    let lattice: Vec<Point3<f64>> =
        (0..125).map(|i| Point3::new(f64::from(i % 5) * 0.01, f64::from(i / 5 % 5) * 0.02, f64::from(i / 25) * 0.03)).collect();
    let corners = ConvexHull::around(&lattice, MAX_VERTICES).unwrap();
    assert_eq!((corners.vertices().len(), corners.faces().len()), (8, 12));
    assert!((corners.volume() - 0.04 * 0.08 * 0.12).abs() < 1e-12);
    let flat: Vec<Point3<f64>> = lattice.iter().map(|point| Point3::new(point.x, point.y, 0.0)).collect();
    assert!(matches!(ConvexHull::around(&flat, 99), Err(HullError::Flat { .. })));
    assert!(matches!(ConvexHull::around(&vec![Point3::origin(); 9], 99), Err(HullError::Flat { .. })));
    assert!(matches!(ConvexHull::around(&lattice[..3], 99), Err(HullError::VertexCount { count: 3 })));
    let mut wild = lattice.clone();
    wild[77].z = f64::NAN;
    assert!(matches!(ConvexHull::around(&wild, 99), Err(HullError::Vertex { vertex: 77, .. })));
}

fn poses(spread: f64) -> impl Strategy<Value = Pose> {
    let unit = -1.0..1.0_f64;
    let turn = [unit.clone(), unit.clone(), unit.clone(), unit.clone()];
    ([unit.clone(), unit.clone(), unit], turn)
        .prop_filter("a rotation", |(_, turn)| turn.iter().map(|x| x * x).sum::<f64>() > 0.01)
        .prop_map(move |(position, turn)| pose(position.map(|x| x * spread), turn))
}

fn primitives() -> impl Strategy<Value = Shape> {
    let size = 0.02..0.4_f64;
    prop_oneof![
        size.clone().prop_map(|radius| Shape::Sphere { radius }),
        (size.clone(), size.clone()).prop_map(|(radius, half_length)| Shape::Capsule { radius, half_length }),
        (size.clone(), size.clone()).prop_map(|(radius, half_length)| Shape::Cylinder { radius, half_length }),
        [size.clone(), size.clone(), size].prop_map(|half_extents| Shape::Box { half_extents }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    /// A box and the same box as a hull, about another origin, are as far from anything, apart or overlapping.
    #[test]
    fn a_box_as_a_hull_is_as_far_from_everything(
        half in [0.02..0.4_f64, 0.02..0.4_f64, 0.02..0.4_f64], middle in [-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64],
        (at, other_at, other) in (poses(0.5), poses(0.5), primitives()), other_half in [0.02..0.4_f64, 0.02..0.4_f64, 0.02..0.4_f64],
    ) {
        let back = translation(-middle[0], -middle[1], -middle[2]);
        let cuboid = Convex::new(&Shape::Box { half_extents: half }, &at);
        let solid = Convex::new(&Shape::Convex(hull(half, middle)), &(at * back));
        let other = Convex::new(&other, &other_at);
        let expected = cuboid.signed_distance(&other);
        for found in [solid.signed_distance(&other), other.signed_distance(&solid)] {
            prop_assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
        }
        for margin in [-0.05, 0.0, 0.01, 0.3, expected - 1e-6, expected + 1e-6] {
            prop_assert_eq!(solid.closer_than(&other, margin), expected < margin);
        }
        prop_assert!((solid.height_above(0.1) - cuboid.height_above(0.1)).abs() < 1e-12);
        let two = Convex::new(&Shape::Box { half_extents: other_half }, &other_at);
        let two_hulls = Convex::new(&Shape::Convex(hull(other_half, [0.0; 3])), &other_at);
        let (expected, found) = (cuboid.signed_distance(&two), solid.signed_distance(&two_hulls));
        prop_assert!((found - expected).abs() < 1e-9, "two hulls: {found}, not {expected}");
    }

}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// The depth of two stones is the shortest way out.
    #[test]
    fn the_depth_of_two_hulls_is_the_shortest_way_out(seeds in [0_u64..1000, 0_u64..1000], at in poses(0.04)) {
        let [a, b] = seeds.map(|seed| Shape::Convex(ConvexHull::around(&stone(seed, 24), 24).unwrap()));
        let first = Convex::new(&a, &Pose::identity());
        let depth = -first.signed_distance(&Convex::new(&b, &at));
        prop_assume!(depth > 1e-4);
        let freed = best_way_out(&first, (&b, &at), depth, 200, &mut Stream::new(seeds[0], &[seeds[1]]));
        prop_assert!(freed > -0.1 * depth, "some way of about that length leads out, best {freed} of {depth}");
    }
}
