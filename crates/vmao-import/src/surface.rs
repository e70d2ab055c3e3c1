//! Loads the meshes, materials and images of placed geometries; everything ends up in the object's frame.

use crate::description::Form;
use crate::{
    error::Error,
    files::Files,
    mesh::{GREY, Material, Mesh, read_mtl, read_obj, read_stl, tessellated},
    repairs::{Quirk, Repairs},
    structure::PlacedGeometry,
    texture::{self, Texture},
};
use nalgebra::{Point3, Vector3};
use std::{collections::BTreeMap, path::Path, rc::Rc};
use vmao_core::wording::quoted;

/// The largest mesh or material file that is read (bytes).
pub const MAX_MESH_BYTES: u64 = 64 << 20;
/// The most faces of all meshes of one object.
pub const MAX_OBJECT_FACES: usize = 1_000_000;
/// The most pixels of all images of one object.
const MAX_PIXELS: u64 = 64 << 20;

/// What was read so far; every file once.
#[derive(Debug)]
pub struct Loader<'a> {
    files: &'a Files,
    meshes: BTreeMap<String, Rc<Mesh>>,
    /// Images by path; none where the file is missing.
    textures: BTreeMap<String, Option<Texture>>,
    faces: usize,
    pixels: u64,
}

impl<'a> Loader<'a> {
    /// Reads from these files.
    pub fn new(files: &'a Files) -> Self {
        Self { files, meshes: BTreeMap::new(), textures: BTreeMap::new(), faces: 0, pixels: 0 }
    }

    /// The image of this path, if it was there.
    pub fn texture(&self, path: &str) -> Option<&Texture> {
        self.textures.get(path).and_then(Option::as_ref)
    }

    /// The geometry as a mesh in the object's frame; its materials name images by their paths in this loader.
    pub fn load(&mut self, geometry: &PlacedGeometry, repairs: &mut Repairs) -> Result<Mesh, Error> {
        let mut mesh = match &geometry.form {
            Form::Mesh { file, scale } => {
                let scale = Vector3::from(*scale);
                let mut mesh = (*self.mesh(file, repairs)?).clone().mapped(|vertex| vertex.coords.component_mul(&scale).into());
                if scale.product() < 0.0 {
                    // A mirror image faces inward until its corners run the other way.
                    for face in &mut mesh.faces {
                        face.corners.swap(1, 2);
                        if let Some(uvs) = &mut face.uvs {
                            uvs.swap(1, 2);
                        }
                    }
                }
                mesh
            }
            form => tessellated(form, Material::plain("", GREY)).unwrap_or_default(),
        };
        self.faces += mesh.faces.len();
        if self.faces > MAX_OBJECT_FACES {
            let message = format!("more than {MAX_OBJECT_FACES} faces in all, the most that is read; simplify the meshes first");
            return Err(Error::refused(&geometry.name, message));
        }
        // What the description says of the looks goes before what the mesh's own file says.
        if let Some(color) = geometry.color {
            mesh.materials.iter_mut().for_each(|material| *material = Material::plain(&material.name, color));
        }
        if let Some(name) = &geometry.texture {
            let path = self.image(Path::new(""), name, repairs)?;
            mesh.materials.iter_mut().for_each(|material| material.texture.clone_from(&path));
        }
        let pose = geometry.object_from_geometry;
        Ok(mesh.mapped(|vertex| pose * vertex))
    }

    fn mesh(&mut self, name: &str, repairs: &mut Repairs) -> Result<Rc<Mesh>, Error> {
        let path = self.files.resolved(name, repairs);
        if let Some(mesh) = self.meshes.get(&path) {
            return Ok(Rc::clone(mesh));
        }
        let extension = Path::new(&path).extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let refuse = |message: String| Error::refused(quoted(name).trim_matches('`'), message);
        if !["obj", "stl"].contains(&extension.as_str()) {
            return Err(refuse(format!("a mesh of kind {}; kinds are: obj, stl", quoted(&extension))));
        }
        let bytes = self.files.read(&path, MAX_MESH_BYTES)?;
        let mut mesh = if extension == "stl" {
            read_stl(&bytes).map_err(refuse)?
        } else {
            let found = read_obj(&bytes).map_err(refuse)?;
            let mut mesh = found.mesh;
            let folder = Path::new(&path).parent().unwrap_or(Path::new("")).to_owned();
            for library in &found.libraries {
                self.paint(&mut mesh, &folder, library, repairs)?;
            }
            mesh
        };
        check_faces(&mut mesh, name, repairs);
        let mesh = Rc::new(mesh);
        self.meshes.insert(path, Rc::clone(&mesh));
        Ok(mesh)
    }

    /// Gives the mesh's materials what an MTL file says of them.
    fn paint(&mut self, mesh: &mut Mesh, folder: &Path, library: &str, repairs: &mut Repairs) -> Result<(), Error> {
        let path = folder.join(self.files.resolved(library, repairs)).to_string_lossy().into_owned();
        if !self.files.has(&path) {
            repairs.add(Quirk::Colour, &path, "a material file that is not there: grey");
            return Ok(());
        }
        let bytes = self.files.read(&path, MAX_MESH_BYTES)?;
        let materials = read_mtl(&bytes).map_err(|message| Error::refused(quoted(&path).trim_matches('`'), message))?;
        let beside = Path::new(&path).parent().unwrap_or(Path::new("")).to_owned();
        for material in &mut mesh.materials {
            let Some(found) = materials.iter().find(|found| found.name == material.name) else { continue };
            material.color = found.color;
            if let Some(name) = &found.texture {
                material.texture = self.image(&beside, name, repairs)?;
            }
        }
        Ok(())
    }

    /// The path of an image in this loader; none if it is not there.
    fn image(&mut self, folder: &Path, name: &str, repairs: &mut Repairs) -> Result<Option<String>, Error> {
        let path = folder.join(self.files.resolved(name, repairs)).to_string_lossy().into_owned();
        if !self.textures.contains_key(&path) {
            let texture = self.read_image(&path, repairs)?;
            self.textures.insert(path.clone(), texture);
        }
        Ok(self.textures[&path].is_some().then_some(path))
    }

    fn read_image(&mut self, path: &str, repairs: &mut Repairs) -> Result<Option<Texture>, Error> {
        if !self.files.has(path) {
            repairs.add(Quirk::Texture, path, "an image that is not there: the colour alone");
            return Ok(None);
        }
        let refuse = |message: String| Error::refused(quoted(path).trim_matches('`'), message);
        let bytes = self.files.read(path, texture::MAX_BYTES)?;
        let texture = texture::read(&bytes).map_err(refuse)?;
        self.pixels += texture.pixel_count();
        if self.pixels > MAX_PIXELS {
            return Err(refuse(format!("more than {MAX_PIXELS} pixels in all images, the most that is read")));
        }
        if texture.format != "PNG" {
            repairs.add(Quirk::Texture, path, format!("{} made PNG, which the simulator reads", texture.format));
        }
        Ok(Some(texture))
    }
}

/// Takes out faces that have no area, and says so.
fn check_faces(mesh: &mut Mesh, name: &str, repairs: &mut Repairs) {
    let before = mesh.faces.len();
    let mut used = vec![false; mesh.vertices.len()];
    for face in &mesh.faces {
        face.corners.iter().for_each(|&corner| used[corner as usize] = true);
    }
    let unused = used.iter().filter(|used| !**used).count();
    let vertices = std::mem::take(&mut mesh.vertices);
    let distinct = |a: u32, b: u32| vertices[a as usize] != vertices[b as usize];
    mesh.faces.retain(|face| {
        let [a, b, c] = face.corners;
        distinct(a, b) && distinct(b, c) && distinct(c, a)
    });
    mesh.vertices = vertices;
    let gone = before - mesh.faces.len();
    if gone + unused > 0 {
        let what = format!("{gone} faces with two corners in one place and {unused} vertices of no face left out");
        repairs.add(Quirk::BrokenMesh, name, what);
    }
}

/// Area and colour of a triangle, at its middle.
pub fn triangle_color(loader: &Loader<'_>, mesh: &Mesh, face: &crate::mesh::Face) -> (Point3<f64>, f64, [f32; 3]) {
    let corners = mesh.triangle(face);
    let middle = Point3::from((corners[0].coords + corners[1].coords + corners[2].coords) / 3.0);
    let area = crate::mesh::area_vector(&corners).norm() / 2.0;
    let material = &mesh.materials[face.material as usize];
    let [r, g, b, _] = material.color;
    let texture = material.texture.as_deref().and_then(|path| loader.texture(path));
    let color = match (texture, face.uvs) {
        (None, _) => [r, g, b],
        (Some(texture), None) => texture.mean_color(),
        (Some(texture), Some(uvs)) => {
            let uvs = uvs.map(|index| mesh.uvs[index as usize]);
            let mean = |axis: usize| (uvs[0][axis] + uvs[1][axis] + uvs[2][axis]) / 3.0;
            texture.color_at([mean(0), mean(1)])
        }
    };
    (middle, area, color)
}
