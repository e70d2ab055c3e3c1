//! Depth pictures of solids by ray casting: exact surfaces, each solid tried only for the pixels that it can cover.

use crate::geometry::Pose;
use crate::rays::{Span, ahead, ball, capsule, cuboid, cylinder, polyhedron};
use crate::shape::Shape;
use nalgebra::Vector3;
use std::ops::Range;

/// A pinhole camera that looks along its own z, y up; columns run along x, which in a right-handed frame is leftwards.
///
/// Pixel (row, column) is the ray through `(X, Y, 1)` with X = (2 (column + ½)/width − 1) · width/height · s,
/// Y = (1 − 2 (row + ½)/height) · s and s = tan(field of view / 2).
#[derive(Debug, Clone, PartialEq)]
pub struct Pinhole {
    /// Where it is.
    pub world_from_camera: Pose,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Tangent of half the vertical field of view.
    pub half_tangent: f64,
}

impl Pinhole {
    /// X of a column's rays, for depth 1.
    pub fn x(&self, column: usize) -> f64 {
        let aspect = self.width as f64 / self.height as f64;
        (2.0 * (column as f64 + 0.5) / self.width as f64 - 1.0) * self.half_tangent * aspect
    }

    /// Y of a row's rays, for depth 1.
    pub fn y(&self, row: usize) -> f64 {
        (1.0 - 2.0 * (row as f64 + 0.5) / self.height as f64) * self.half_tangent
    }

    /// The pixels that a solid can cover, none missed.
    ///
    /// A column lies left of the whole solid if the plane through the eye and that column does, and so for the others.
    pub fn window(&self, shape: &Shape, world_from_solid: &Pose) -> Window {
        let camera_from_solid = self.world_from_camera.inv_mul(world_from_solid);
        let solid_from_camera = camera_from_solid.rotation.inverse();
        let center = camera_from_solid.translation.vector;
        // Largest of p · direction over the solid's points p, camera frame.
        let furthest = |direction: Vector3<f64>| {
            let norm = direction.norm();
            center.dot(&direction) + norm * shape.extent_along(&(solid_from_camera * (direction / norm)))
        };
        let everything = Window { rows: 0..self.height, columns: 0..self.width };
        if -furthest(-Vector3::z()) <= EPSILON {
            return everything; // part of it is beside the eye or behind
        }
        let across = |x: f64| Vector3::new(1.0, 0.0, -x);
        let above = |y: f64| Vector3::new(0.0, 1.0, -y);
        Window {
            rows: first(self.height, |row| furthest(above(self.y(row))) < -EPSILON)..first(self.height, |row| {
                furthest(-above(self.y(row))) >= -EPSILON
            }),
            columns: first(self.width, |column| furthest(-across(self.x(column))) < -EPSILON)..first(self.width, |column| {
                furthest(across(self.x(column))) >= -EPSILON
            }),
        }
    }
}

/// Slack of windows (m).
const EPSILON: f64 = 1e-9;

/// How many of `0..count` come before the first for which `before` no longer holds.
fn first(count: usize, before: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut high) = (0, count);
    while low < high {
        let middle = usize::midpoint(low, high);
        if before(middle) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

/// A rectangle of pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Window {
    /// From the top.
    pub rows: Range<usize>,
    /// From column 0.
    pub columns: Range<usize>,
}

impl Window {
    /// What both hold.
    pub fn intersection(&self, other: &Self) -> Self {
        let both = |a: &Range<usize>, b: &Range<usize>| {
            let start = a.start.max(b.start);
            start..a.end.min(b.end).max(start)
        };
        Self { rows: both(&self.rows, &other.rows), columns: both(&self.columns, &other.columns) }
    }
}

/// What each pixel's ray meets first, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthPicture {
    width: usize,
    columns: Vec<f64>,
    depths: Vec<f64>,
    nearest: Vec<u32>,
}

/// In place of a solid's number where nothing is seen.
const NOTHING: u32 = u32::MAX;

impl DepthPicture {
    /// What `camera` sees of nothing.
    pub fn new(camera: &Pinhole) -> Self {
        let pixels = camera.width * camera.height;
        Self {
            width: camera.width,
            columns: (0..camera.width).map(|column| camera.x(column)).collect(),
            depths: vec![f64::INFINITY; pixels],
            nearest: vec![NOTHING; pixels],
        }
    }

    /// Number of the solid seen at this pixel, and its depth along the camera's z (m).
    pub fn at(&self, row: usize, column: usize) -> Option<(u32, f64)> {
        let pixel = row * self.width + column;
        (self.nearest[pixel] != NOTHING).then(|| (self.nearest[pixel], self.depths[pixel]))
    }

    /// Whether a neighbour of this pixel sees something nearer or further by more than `step` (m), or nothing.
    pub fn on_edge(&self, row: usize, column: usize, step: f64) -> bool {
        let depth = |row: usize, column: usize| self.depths[row * self.width + column];
        let (here, height) = (depth(row, column), self.depths.len() / self.width);
        let other = |row: usize, column: usize| (depth(row, column) - here).abs() > step;
        (row > 0 && other(row - 1, column))
            || (row + 1 < height && other(row + 1, column))
            || (column > 0 && other(row, column - 1))
            || (column + 1 < self.width && other(row, column + 1))
    }

    /// Adds a solid under the number `index`, in front of what is further away; looked at within `window` only.
    pub fn add_solid(&mut self, camera: &Pinhole, window: &Window, index: u32, shape: &Shape, world_from_solid: &Pose) {
        let window = camera.window(shape, world_from_solid).intersection(window);
        let ray = Rays { camera, solid_from_camera: world_from_solid.inv_mul(&camera.world_from_camera) };
        let origin = ray.solid_from_camera.translation.vector;
        let meet = |span: Option<Span>| span.and_then(ahead);
        match *shape {
            Shape::Sphere { radius } => self.scan(&ray, &window, index, |d| meet(ball(&origin, d, radius))),
            Shape::Capsule { radius, half_length } => {
                self.scan(&ray, &window, index, |d| meet(capsule(&origin, d, radius, half_length)));
            }
            Shape::Cylinder { radius, half_length } => {
                self.scan(&ray, &window, index, |d| meet(cylinder(&origin, d, radius, half_length)));
            }
            Shape::Convex(ref hull) => self.scan(&ray, &window, index, |d| meet(polyhedron(&origin, d, hull))),
            Shape::Box { half_extents } => self.scan(&ray, &window, index, |d| meet(cuboid(&origin, d, &half_extents))),
        }
    }

    /// Adds the rectangle |x| ≤ `half_widths[0]`, |y| ≤ `half_widths[1]`, z = 0 of its own frame, seen from +z only.
    pub fn add_rectangle(
        &mut self,
        camera: &Pinhole,
        window: &Window,
        index: u32,
        half_widths: &[f64; 2],
        world_from_rectangle: &Pose,
    ) {
        let ray = Rays { camera, solid_from_camera: world_from_rectangle.inv_mul(&camera.world_from_camera) };
        let origin = ray.solid_from_camera.translation.vector;
        self.scan(&ray, window, index, |d| {
            let t = -origin.z / d.z;
            let (x, y) = (origin.x + t * d.x, origin.y + t * d.y);
            (d.z < 0.0 && t >= 0.0 && x.abs() <= half_widths[0] && y.abs() <= half_widths[1]).then_some(t)
        });
    }

    /// Directions have depth 1, so that how far along one the surface lies is its depth.
    #[inline]
    fn scan(&mut self, rays: &Rays<'_>, window: &Window, index: u32, meet: impl Fn(&Vector3<f64>) -> Option<f64>) {
        let rotation = rays.solid_from_camera.rotation.to_rotation_matrix();
        let [along_x, along_y, along_z] = [0, 1, 2].map(|axis| rotation.matrix().column(axis).into_owned());
        let columns = window.columns.clone();
        for row in window.rows.clone() {
            let middle = along_y * rays.camera.y(row) + along_z;
            let first = row * self.width;
            let depths = &mut self.depths[first..first + self.width][columns.clone()];
            let nearest = &mut self.nearest[first..first + self.width][columns.clone()];
            for ((x, depth), nearest) in self.columns[columns.clone()].iter().zip(depths).zip(nearest) {
                if let Some(met) = meet(&(middle + along_x * *x))
                    && met < *depth
                {
                    *depth = met;
                    *nearest = index;
                }
            }
        }
    }
}

/// A camera's rays as a solid sees them.
struct Rays<'c> {
    camera: &'c Pinhole,
    solid_from_camera: Pose,
}
