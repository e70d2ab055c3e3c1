//! Primitive solids as meshes: for pictures, for colours, and for shapes that core has no word for.

use super::{Material, Mesh};
use crate::description::Form;
use nalgebra::Point3;
use std::f64::consts::PI;

/// How finely round things are cut: corners of a circle, and rows from pole to pole.
const CORNERS: u32 = 24;
const ROWS: u32 = 12;

/// The form as a closed mesh, faces outward; none for a mesh in a file.
pub fn tessellated(form: &Form, material: Material) -> Option<Mesh> {
    Some(match *form {
        Form::Mesh { .. } => return None,
        Form::Box { half_extents: [x, y, z] } => {
            let sign = |corner: u32, bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let vertices = (0..8).map(|corner| Point3::new(x * sign(corner, 0), y * sign(corner, 1), z * sign(corner, 2)));
            let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
            let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
            Mesh::of(vertices.collect(), &triangles, material)
        }
        Form::Ellipsoid { radii } => round(|_| 0.0, radii, ROWS, material),
        Form::Capsule { radius, half_length } => {
            round(|height| if height > 0.0 { half_length } else { -half_length }, [radius; 3], ROWS + 1, material)
        }
        Form::Cylinder { radius, half_length } => {
            // Two rings and two poles in the end planes.
            lathe(&[(radius, -half_length), (radius, half_length)], [-half_length, half_length], [1.0, 1.0], material)
        }
    })
}

/// An ellipsoid whose rows are lifted; an odd number of rows has none on the equator.
fn round(lift: impl Fn(f64) -> f64, [x, y, z]: [f64; 3], rows: u32, material: Material) -> Mesh {
    let ring = |row: u32| {
        let latitude = PI * (f64::from(row) / f64::from(rows) - 0.5);
        (latitude.cos(), z * latitude.sin() + lift(latitude))
    };
    let rings: Vec<(f64, f64)> = (1..rows).map(ring).collect();
    lathe(&rings, [lift(-1.0) - z, lift(1.0) + z], [x, y], material)
}

/// Rings (radius, height) from low to high, closed by a pole at each end; x and y are stretched.
fn lathe(rings: &[(f64, f64)], poles: [f64; 2], [x, y]: [f64; 2], material: Material) -> Mesh {
    let angle = |corner: u32| 2.0 * PI * f64::from(corner) / f64::from(CORNERS);
    let mut vertices: Vec<Point3<f64>> = poles.map(|height| Point3::new(0.0, 0.0, height)).into();
    for &(radius, height) in rings {
        vertices.extend(
            (0..CORNERS).map(|corner| Point3::new(x * radius * angle(corner).cos(), y * radius * angle(corner).sin(), height)),
        );
    }
    let at = |ring: u32, corner: u32| 2 + ring * CORNERS + corner % CORNERS;
    let last = rings.len() as u32 - 1;
    let mut triangles = Vec::new();
    for corner in 0..CORNERS {
        triangles.push([0, at(0, corner + 1), at(0, corner)]);
        triangles.push([1, at(last, corner), at(last, corner + 1)]);
        for ring in 0..last {
            let (a, b, c, d) = (at(ring, corner), at(ring, corner + 1), at(ring + 1, corner + 1), at(ring + 1, corner));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Mesh::of(vertices, &triangles, material)
}
