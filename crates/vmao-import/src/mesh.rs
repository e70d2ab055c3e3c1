//! Triangle meshes with materials, read from OBJ and STL.

mod mtl;
mod obj;
mod solids;
mod stl;

pub use mtl::read as read_mtl;
pub use obj::{ObjFile, read as read_obj};
pub use solids::tessellated;
pub use stl::read as read_stl;

use nalgebra::{Point3, Vector3};

/// The most vertices of one mesh.
pub const MAX_VERTICES: usize = 600_000;
/// The most faces of one mesh.
pub const MAX_FACES: usize = 400_000;
/// The most materials of one mesh.
pub const MAX_MATERIALS: usize = 256;
/// No coordinate is beyond it, in whatever unit.
pub const MAX_COORDINATE: f64 = 1e6;

/// How a surface looks.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Red, green, blue and opacity in [0, 1].
    pub color: [f32; 4],
    /// The file of an image over it.
    pub texture: Option<String>,
}

/// The colour of what has none (MuJoCo's).
pub const GREY: [f32; 4] = [0.5, 0.5, 0.5, 1.0];

impl Material {
    /// Without a texture.
    pub fn plain(name: &str, color: [f32; 4]) -> Self {
        Self { name: name.to_owned(), color, texture: None }
    }
}

/// A triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Its vertices.
    pub corners: [u32; 3],
    /// Its texture coordinates, if it has them.
    pub uvs: Option<[u32; 3]>,
    /// Index of its material.
    pub material: u32,
    /// Number of the object or group of the file that it belongs to.
    pub group: u32,
}

/// A triangle mesh. Every index of every face is in range, every number is finite.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertices, in the file's unit.
    pub vertices: Vec<Point3<f64>>,
    /// Texture coordinates.
    pub uvs: Vec<[f64; 2]>,
    /// Triangles.
    pub faces: Vec<Face>,
    /// Materials; at least one.
    pub materials: Vec<Material>,
}

impl Mesh {
    /// The corners of a face.
    pub fn triangle(&self, face: &Face) -> [Point3<f64>; 3] {
        face.corners.map(|corner| self.vertices[corner as usize])
    }

    /// A mesh of these triangles in one material and one group.
    pub fn of(vertices: Vec<Point3<f64>>, triangles: &[[u32; 3]], material: Material) -> Self {
        let faces = triangles.iter().map(|&corners| Face { corners, uvs: None, material: 0, group: 0 }).collect();
        Self { vertices, uvs: Vec::new(), faces, materials: vec![material] }
    }

    /// The same, moved vertex by vertex.
    #[must_use]
    pub fn mapped(mut self, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> Self {
        for vertex in &mut self.vertices {
            *vertex = place(vertex);
        }
        self
    }
}

/// Twice the area of a triangle, along its normal.
pub fn area_vector([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

/// A number that may stand in a mesh.
pub(crate) fn coordinate(word: &[u8]) -> Option<f64> {
    let value: f64 = std::str::from_utf8(word).ok()?.parse().ok()?;
    (value.abs() <= MAX_COORDINATE).then_some(value)
}
