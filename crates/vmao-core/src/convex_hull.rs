//! Convex polyhedra with triangle faces, checked once and cheap to copy.

mod around;
mod measure;

use measure::Measures;
use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};
use std::{fmt, sync::Arc};
use thiserror::Error;

/// The most vertices of one hull.
pub const MAX_VERTICES: usize = 256;
/// Vertices lie within this distance of the hull's frame along each axis (m).
pub const MAX_COORDINATE: f64 = 100.0;
/// The least volume of a hull (m³): a tenth of a millimetre cubed.
pub const MIN_VOLUME: f64 = 1e-12;
/// Vertices may stand out of a face by this share of the hull's size: files round their numbers.
const CONVEXITY: f64 = 1e-4;
/// Vertices are uncertain by this share of the hull's size (single precision), which tilts narrow faces.
const UNCERTAINTY: f64 = 1e-7;

/// Why vertices and faces are no convex hull. Vertices and faces are given by index.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum HullError {
    /// A coordinate that is no number, or too far away.
    #[error("vertex {vertex} is {found:?}, expected finite numbers within {MAX_COORDINATE} m of the hull's frame")]
    Vertex {
        /// The vertex.
        vertex: usize,
        /// Its coordinates.
        found: [f64; 3],
    },
    /// Too few or too many vertices.
    #[error("{count} vertices, expected 4 to {MAX_VERTICES}")]
    VertexCount {
        /// How many there are.
        count: usize,
    },
    /// A face without three vertices of the hull.
    #[error("face {face} is {found:?}, expected three different vertices of 0 to {}", count - 1)]
    Face {
        /// The face.
        face: usize,
        /// The vertices it names.
        found: [u32; 3],
        /// Number of vertices.
        count: usize,
    },
    /// A hole, or faces that turn against their neighbours, or more than two at one edge.
    #[error(
        "the edge from vertex {from} to {to} is not shared by two faces with the same sense of turn, expected a closed surface"
    )]
    Open {
        /// The edge's start in the walk around one face.
        from: u32,
        /// Its end.
        to: u32,
    },
    /// Several surfaces, a surface with handles, or vertices that no face uses.
    #[error(
        "{vertices} vertices and {faces} faces, expected one surface like a ball's with every vertex used: 2·vertices − 4 faces"
    )]
    Topology {
        /// Number of vertices.
        vertices: usize,
        /// Number of faces.
        faces: usize,
    },
    /// Less than [`MIN_VOLUME`] inside.
    #[error("a volume of {volume:.3e} m³, expected at least {MIN_VOLUME:.0e}")]
    Flat {
        /// The volume (m³).
        volume: f64,
    },
    /// The faces are seen counter-clockwise from inside.
    #[error("faces turned inwards, expected each counter-clockwise seen from outside")]
    Inward,
    /// A dent.
    #[error("vertex {vertex} stands {height:.2e} m out of the plane of face {face}, expected a convex surface")]
    NotConvex {
        /// The vertex.
        vertex: usize,
        /// The face.
        face: usize,
        /// Its height over that face (m).
        height: f64,
    },
}

/// A convex polyhedron about its own frame: vertices (m) and triangles, counter-clockwise seen from outside.
///
/// Copies share their data. Documents write `{"vertices": [[x, y, z], …], "faces": [[i, j, k], …]}`; reading checks.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Surface", into = "Surface")]
pub struct ConvexHull(Arc<Prepared>);

#[derive(PartialEq)]
struct Prepared {
    vertices: Vec<Point3<f64>>,
    faces: Vec<[u32; 3]>,
    planes: Vec<Plane>,
    edges: Vec<Edge>,
    measures: Measures,
    capsule: Capsule,
}

/// { x : `normal`·x ≤ `offset` } holds the hull and touches it (unit normal, m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plane {
    pub(crate) normal: Vector3<f64>,
    pub(crate) offset: f64,
}

/// Two vertices and the two faces between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) ends: [u32; 2],
    pub(crate) faces: [u32; 2],
}

/// A capsule around a hull: middle and half axis in the hull's frame, radius, and a ball's radius about the middle (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Capsule {
    pub(crate) middle: Vector3<f64>,
    pub(crate) spine: Vector3<f64>,
    pub(crate) girth: f64,
    pub(crate) bound: f64,
}

/// How documents write a hull.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Surface {
    vertices: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl TryFrom<Surface> for ConvexHull {
    type Error = HullError;

    fn try_from(surface: Surface) -> Result<Self, HullError> {
        Self::new(surface.vertices.into_iter().map(Point3::from).collect(), surface.faces)
    }
}

impl From<ConvexHull> for Surface {
    fn from(hull: ConvexHull) -> Self {
        Self { vertices: hull.vertices().iter().map(|&vertex| vertex.into()).collect(), faces: hull.faces().to_vec() }
    }
}

impl fmt::Debug for ConvexHull {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "ConvexHull({} vertices, {} faces)", self.vertices().len(), self.faces().len())
    }
}

impl ConvexHull {
    /// The hull with these vertices (m) and triangles, counter-clockwise seen from outside; fails unless they bound one.
    pub fn new(vertices: Vec<Point3<f64>>, faces: Vec<[u32; 3]>) -> Result<Self, HullError> {
        let count = vertices.len();
        if !(4..=MAX_VERTICES).contains(&count) {
            return Err(HullError::VertexCount { count });
        }
        let wild = |vertex: &Point3<f64>| !vertex.iter().all(|x| x.abs() <= MAX_COORDINATE);
        if let Some(vertex) = vertices.iter().position(wild) {
            return Err(HullError::Vertex { vertex, found: vertices[vertex].into() });
        }
        let edges = edges(count, &faces)?;
        let measures = Measures::new(&vertices, &faces);
        if measures.volume.abs() < MIN_VOLUME {
            return Err(HullError::Flat { volume: measures.volume });
        }
        if measures.volume < 0.0 {
            return Err(HullError::Inward);
        }
        let planes = planes(&vertices, &faces)?;
        let capsule = Capsule::around(&vertices, &measures);
        Ok(Self(Arc::new(Prepared { vertices, faces, planes, edges, measures, capsule })))
    }

    /// Its vertices, own frame (m).
    pub fn vertices(&self) -> &[Point3<f64>] {
        &self.0.vertices
    }

    /// Its triangles, counter-clockwise seen from outside.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.0.faces
    }

    /// Its volume (m³).
    pub fn volume(&self) -> f64 {
        self.0.measures.volume
    }

    /// Its centre of mass at even density, own frame (m).
    pub fn centroid(&self) -> Point3<f64> {
        self.0.measures.centroid
    }

    /// Its inertia about the centroid with `mass` (kg) spread evenly, own axes (kg·m²).
    pub fn inertia(&self, mass: f64) -> Matrix3<f64> {
        self.0.measures.inertia * (mass / self.0.measures.volume)
    }

    /// The vertex furthest along `direction`; of several the first.
    pub fn support(&self, direction: &Vector3<f64>) -> Point3<f64> {
        let (mut best, mut furthest) = (self.0.vertices[0], f64::NEG_INFINITY);
        for vertex in &self.0.vertices {
            let along = vertex.coords.dot(direction);
            if along > furthest {
                (best, furthest) = (*vertex, along);
            }
        }
        best
    }

    pub(crate) fn planes(&self) -> &[Plane] {
        &self.0.planes
    }

    pub(crate) fn edges(&self) -> &[Edge] {
        &self.0.edges
    }

    pub(crate) fn capsule(&self) -> &Capsule {
        &self.0.capsule
    }
}

/// The edges of a closed surface like a ball's; fails if the faces do not form one.
fn edges(count: usize, faces: &[[u32; 3]]) -> Result<Vec<Edge>, HullError> {
    if faces.len() > 2 * MAX_VERTICES {
        return Err(HullError::Topology { vertices: count, faces: faces.len() });
    }
    let mut walks = Vec::with_capacity(3 * faces.len());
    for (face, &[a, b, c]) in faces.iter().enumerate() {
        let valid = [a, b, c].iter().all(|&vertex| (vertex as usize) < count);
        if !valid || a == b || b == c || c == a {
            return Err(HullError::Face { face, found: [a, b, c], count });
        }
        walks.extend([(a, b, face as u32), (b, c, face as u32), (c, a, face as u32)]);
    }
    walks.sort_unstable();
    if let Some(twice) = walks.windows(2).find(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1)) {
        return Err(HullError::Open { from: twice[0].0, to: twice[0].1 });
    }
    let mut edges = Vec::with_capacity(walks.len() / 2);
    for &(from, to, face) in &walks {
        let back = walks.binary_search_by_key(&(to, from), |&(from, to, _)| (from, to));
        let Ok(back) = back else { return Err(HullError::Open { from, to }) };
        if from < to {
            edges.push(Edge { ends: [from, to], faces: [face, walks[back].2] });
        }
    }
    // Euler: vertices − edges + faces = 2, and every triangle has three half edges.
    if faces.len() + 4 != 2 * count {
        return Err(HullError::Topology { vertices: count, faces: faces.len() });
    }
    Ok(edges)
}

/// The planes of the faces; fails if a vertex stands out of one. A face without area has a plane that touches the hull.
fn planes(vertices: &[Point3<f64>], faces: &[[u32; 3]]) -> Result<Vec<Plane>, HullError> {
    let (low, high) = measure::corners(vertices);
    let size = (high - low).norm();
    let mut planes = Vec::with_capacity(faces.len());
    for (face, corners) in faces.iter().enumerate() {
        let [a, b, c] = corners.map(|corner| vertices[corner as usize]);
        let cross = (b - a).cross(&(c - a));
        let longest = [b - a, c - b, a - c].iter().map(nalgebra::Vector3::norm).fold(0.0, f64::max);
        let Some(normal) = cross.try_normalize(UNCERTAINTY * size * longest) else {
            // Narrower than its vertices are certain: any direction across the long side will do.
            let normal = (a.coords + b.coords + c.coords - (low + high) * 1.5).try_normalize(0.0).unwrap_or_else(Vector3::x);
            planes.push(Plane { normal, offset: furthest(vertices, &normal).1 });
            continue;
        };
        let (vertex, offset) = furthest(vertices, &normal);
        let height = offset - a.coords.dot(&normal);
        if height > size * (CONVEXITY + UNCERTAINTY * size * longest / cross.norm()) {
            return Err(HullError::NotConvex { vertex, face, height });
        }
        planes.push(Plane { normal, offset });
    }
    Ok(planes)
}

fn furthest(vertices: &[Point3<f64>], direction: &Vector3<f64>) -> (usize, f64) {
    let mut best = (0, f64::NEG_INFINITY);
    for (index, vertex) in vertices.iter().enumerate() {
        let along = vertex.coords.dot(direction);
        if along > best.1 {
            best = (index, along);
        }
    }
    best
}

impl Capsule {
    /// Along the direction in which the mass is drawn out the most.
    fn around(vertices: &[Point3<f64>], measures: &Measures) -> Self {
        let axes = measures.inertia.symmetric_eigen().eigenvectors;
        let (x, y) = (axes.column(0).into_owned(), axes.column(1).into_owned());
        let turn = Rotation3::from_basis_unchecked(&[x, y, x.cross(&y)]);
        let local: Vec<Point3<f64>> = vertices.iter().map(|vertex| turn.inverse() * vertex).collect();
        let (low, high) = measure::corners(&local);
        let middle = turn * ((low + high) / 2.0);
        let offsets = || vertices.iter().map(|vertex| vertex.coords - middle);
        let extent = high - low;
        let axis = turn * Vector3::ith(extent.imax(), 1.0);
        let across = |offset: &Vector3<f64>| (offset - axis * offset.dot(&axis)).norm();
        let girth = offsets().map(|offset| across(&offset)).fold(0.0, f64::max);
        let beyond = |offset: Vector3<f64>| offset.dot(&axis).abs() - (girth * girth - across(&offset).powi(2)).max(0.0).sqrt();
        let half = offsets().map(beyond).fold(0.0, f64::max);
        let bound = offsets().map(|offset| offset.norm()).fold(0.0, f64::max);
        Self { middle, spine: axis * half, girth, bound }
    }
}
