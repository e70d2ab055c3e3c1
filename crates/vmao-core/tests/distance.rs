//! Signed distances against closed forms and against an independent slow search.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::needless_pass_by_value, reason = "tests build what they compare in the call")]

mod slow;
mod way_out;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use slow::slow_distance;
use vmao_core::{
    convex_hull::ConvexHull,
    distance::Convex,
    geometry::{Pose, pose, translation},
    random::Stream,
    shape::Shape,
};
use way_out::best_way_out;

const BALL: Shape = Shape::Sphere { radius: 0.1 };
const ROD: Shape = Shape::Capsule { radius: 0.1, half_length: 0.5 };
const CUBE: Shape = Shape::Box { half_extents: [0.5, 0.5, 0.5] };

fn distance(a: (Shape, Pose), b: (Shape, Pose)) -> f64 {
    let (a, b) = (Convex::new(&a.0, &a.1), Convex::new(&b.0, &b.1));
    let there = a.signed_distance(&b);
    assert!((there - b.signed_distance(&a)).abs() < 1e-9, "the same both ways");
    for margin in [-0.05, 0.0, 0.01, 0.3, there - 1e-6, there + 1e-6] {
        if (margin - there).abs() < 1e-9 {
            continue; // rounding decides
        }
        assert_eq!(a.closer_than(&b, margin), there < margin, "margin {margin}, distance {there}");
    }
    there
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    translation(x, y, z)
}

#[test]
fn closed_forms() {
    let lying = pose([0.0, 0.0, 0.5], [1.0, 1.0, 0.0, 0.0]); // a rod along y
    let edge_up = pose([2.0, 0.0, 0.0], [(std::f64::consts::FRAC_PI_8).cos(), 0.0, 0.0, (std::f64::consts::FRAC_PI_8).sin()]);
    let root = std::f64::consts::SQRT_2;
    let cases = [
        ("balls", (BALL, at(0.0, 0.0, 0.0)), (BALL, at(0.0, 3.0, 4.0)), 4.8),
        ("balls that touch", (BALL, at(0.0, 0.0, 0.0)), (BALL, at(0.2, 0.0, 0.0)), 0.0),
        ("one ball in the other", (BALL, at(0.0, 0.0, 0.0)), (BALL, at(0.0, 0.0, 0.0)), -0.2),
        ("parallel rods", (ROD, at(0.0, 0.0, 0.0)), (ROD, at(0.7, 0.0, 0.3)), 0.5),
        ("parallel rods end to end", (ROD, at(0.0, 0.0, 0.0)), (ROD, at(0.0, 0.0, 2.0)), 0.8),
        ("crossed rods", (ROD, at(0.3, 0.0, 0.5)), (ROD, lying), 0.1),
        ("rods that cross", (ROD, at(0.0, 0.0, 0.5)), (ROD, lying), -0.2),
        (
            "a rod of no length",
            (Shape::Capsule { radius: 0.1, half_length: 0.0 }, at(0.0, 0.0, 0.0)),
            (ROD, at(0.0, 1.0, 0.0)),
            0.8,
        ),
        ("cubes face to face", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, at(1.5, 0.2, -0.3)), 0.5),
        ("cubes edge to edge", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, at(2.0, 2.0, 0.0)), root),
        ("cubes corner to corner", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, at(2.0, 2.0, 2.0)), 3.0_f64.sqrt()),
        ("face to a turned cube's edge", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, edge_up), 1.5 - root / 2.0),
        ("cubes that touch", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, at(1.0, 0.0, 0.0)), 0.0),
        ("cubes that overlap", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, at(0.7, 0.1, 0.2)), -0.3),
        ("a cube in itself", (CUBE, at(0.0, 0.0, 0.0)), (CUBE, at(0.0, 0.0, 0.0)), -1.0),
        ("ball over face", (BALL, at(0.2, 0.1, 0.9)), (CUBE, at(0.0, 0.0, 0.0)), 0.3),
        ("ball off a corner", (BALL, at(1.5, 1.5, 1.5)), (CUBE, at(0.0, 0.0, 0.0)), 3.0_f64.sqrt() - 0.1),
        ("ball inside", (BALL, at(0.0, 0.0, 0.3)), (CUBE, at(0.0, 0.0, 0.0)), -0.3),
        ("rod along a face", (ROD, at(0.8, 0.0, 0.0)), (CUBE, at(0.0, 0.0, 0.0)), 0.2),
        ("rod through a cube", (ROD, at(0.3, 0.0, 0.0)), (CUBE, at(0.0, 0.0, 0.0)), -0.3),
        ("rod end over a face", (ROD, at(0.1, 0.2, 1.2)), (CUBE, at(0.0, 0.0, 0.0)), 0.1),
    ];
    for (name, a, b, expected) in cases {
        let found = distance(a.clone(), b.clone());
        assert!((found - expected).abs() < 1e-9, "{name}: {found}, not {expected}");
    }
}

#[test]
fn a_cylinder_is_at_most_its_prism_too_large() {
    let cylinder = Shape::Cylinder { radius: 0.2, half_length: 0.4 };
    for step in 0..48 {
        let angle = f64::from(step) * std::f64::consts::TAU / 48.0;
        let side = distance((cylinder.clone(), at(0.0, 0.0, 0.0)), (BALL, at(angle.cos(), angle.sin(), 0.1)));
        assert!(side <= 0.7 + 1e-9 && side > 0.7 - 0.2 * 0.0353, "{angle}: {side}");
    }
    let top = distance((cylinder.clone(), at(0.0, 0.0, 0.0)), (BALL, at(0.05, 0.02, 1.0)));
    assert!((top - 0.5).abs() < 1e-9, "{top}");
}

#[test]
fn heights_over_the_floor() {
    let over = |shape, pose| Convex::new(&shape, &pose).height_above(0.25);
    let lying = pose([0.0, 0.0, 0.5], [1.0, 1.0, 0.0, 0.0]);
    assert!((over(BALL, at(1.0, 2.0, 1.0)) - 0.65).abs() < 1e-12);
    assert!((over(ROD, at(0.0, 0.0, 1.0)) - 0.15).abs() < 1e-12);
    assert!((over(ROD, lying) - 0.15).abs() < 1e-12);
    assert!((over(CUBE, at(0.0, 0.0, 0.5)) + 0.25).abs() < 1e-12);
    let on_edge = pose([0.0, 0.0, 1.0], [(std::f64::consts::FRAC_PI_8).cos(), (std::f64::consts::FRAC_PI_8).sin(), 0.0, 0.0]);
    assert!((over(CUBE, on_edge) - (0.75 - std::f64::consts::FRAC_1_SQRT_2)).abs() < 1e-9);
}

/// A hull of few vertices, its frame anywhere near.
fn stone(seed: u64) -> Shape {
    let mut stream = Stream::new(seed, &[]);
    let middle = Vector3::new(stream.normal(), stream.normal(), stream.normal()) * 0.2;
    let mut point = || Point3::from(middle + Vector3::new(stream.normal(), stream.normal(), stream.normal()) * 0.15);
    let points: Vec<Point3<f64>> = (0..9).map(|_| point()).collect();
    Shape::Convex(ConvexHull::around(&points, 9).unwrap())
}

fn shapes() -> impl Strategy<Value = Shape> {
    let size = 0.02..0.4_f64;
    prop_oneof![
        size.clone().prop_map(|radius| Shape::Sphere { radius }),
        (size.clone(), size.clone()).prop_map(|(radius, half_length)| Shape::Capsule { radius, half_length }),
        [size.clone(), size.clone(), size].prop_map(|half_extents| Shape::Box { half_extents }),
        (0_u64..10_000).prop_map(stone),
    ]
}

fn poses(spread: f64) -> impl Strategy<Value = Pose> {
    let unit = -1.0..1.0_f64;
    let turn = [unit.clone(), unit.clone(), unit.clone(), unit.clone()];
    ([unit.clone(), unit.clone(), unit], turn)
        .prop_filter("a rotation", |(_, turn)| turn.iter().map(|x| x * x).sum::<f64>() > 0.01)
        .prop_map(move |(position, turn)| pose(position.map(|x| x * spread), turn))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, max_global_rejects: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn distances_agree_with_alternating_projections(a in (shapes(), poses(1.0)), b in (shapes(), poses(1.0))) {
        let found = distance(a.clone(), b.clone());
        let slow = slow_distance(&a, &b);
        // the slow search only ever comes from above, and stalls where two faces are nearly parallel
        prop_assert!(found.max(0.0) <= slow + 1e-9 && found.max(0.0) > slow - 2e-3, "{found} against {slow}");
    }

    #[test]
    fn the_depth_is_the_shortest_way_out(a in (shapes(), poses(0.2)), b in (shapes(), poses(0.2))) {
        let depth = -distance(a.clone(), b.clone());
        prop_assume!(depth > 1e-3);
        let freed = best_way_out(&Convex::new(&a.0, &a.1), (&b.0, &b.1), depth, 300, &mut Stream::new(depth.to_bits(), &[]));
        prop_assert!(freed > -0.05 * depth, "some way of about that length leads out, best {freed} of {depth}");
    }

    /// Sizes, places and turns on a lattice: parallel faces, shared edges and exact touching all the time.
    #[test]
    fn distances_hold_in_degenerate_positions(
        kinds in [0_usize..4, 0_usize..4], sizes in [[0_u8..4, 0_u8..4, 0_u8..4], [0_u8..4, 0_u8..4, 0_u8..4]],
        offset in [-6_i8..7, -6_i8..7, -6_i8..7], turns in [0_u8..4, 0_u8..4], axes in [0_usize..3, 0_usize..3],
    ) {
        let solid = |i: usize, place: Pose| {
            let [x, y, z] = sizes[i].map(|size| 0.1 * f64::from(size));
            let mut turn = [(f64::from(turns[i]) * std::f64::consts::FRAC_PI_4).cos(), 0.0, 0.0, 0.0];
            turn[1 + axes[i]] = (f64::from(turns[i]) * std::f64::consts::FRAC_PI_4).sin();
            let shape = match kinds[i] {
                0 => Shape::Sphere { radius: x },
                1 => Shape::Capsule { radius: x, half_length: y },
                _ => Shape::Box { half_extents: [x, y, z] },
            };
            (shape, place * pose([0.0; 3], turn))
        };
        let [x, y, z] = offset.map(|step| 0.1 * f64::from(step));
        let (a, b) = (solid(0, Pose::identity()), solid(1, at(x, y, z)));
        let (found, slow) = (distance(a.clone(), b.clone()), slow_distance(&a, &b));
        prop_assert!((found.max(0.0) - slow).abs() < 1e-6, "{found} against {slow}");
    }
}
