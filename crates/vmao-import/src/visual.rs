//! What an object looks like, as files that MuJoCo reads: OBJ and MTL in metres, PNG over them.

use crate::{mesh::Mesh, surface::Loader};
use std::{collections::BTreeMap, fmt::Write};

/// The most faces of one written mesh; MuJoCo's own limit.
const MAX_FACES: usize = 200_000;

/// A file for pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Its name, without a folder.
    pub file: String,
    /// What is in it.
    pub bytes: Vec<u8>,
    /// The part that is shown with it; none of what another file names.
    pub part: Option<usize>,
}

/// The files of all parts: for each part one OBJ and MTL for every material that it has.
pub(crate) fn pictures(parts: &[Vec<Mesh>], names: &[String], loader: &Loader<'_>) -> Result<Vec<Picture>, String> {
    let mut files = Vec::new();
    let mut images: BTreeMap<String, String> = BTreeMap::new();
    for (part, meshes) in parts.iter().enumerate() {
        for (index, looks) in by_material(meshes).into_iter().enumerate() {
            let stem = format!("{}-{index}", names[part]);
            let image = match looks.texture.filter(|path| loader.texture(path).is_some()) {
                None => None,
                Some(path) => Some(match images.get(path) {
                    Some(name) => name.clone(),
                    None => {
                        let name = format!("texture-{}.png", images.len());
                        let bytes = loader.texture(path).map(crate::texture::Texture::png).transpose()?.unwrap_or_default();
                        files.push(Picture { file: name.clone(), bytes, part: None });
                        images.insert(path.to_owned(), name.clone());
                        name
                    }
                }),
            };
            files.push(Picture { file: format!("{stem}.obj"), bytes: obj(&stem, &looks).into_bytes(), part: Some(part) });
            files.push(Picture { file: format!("{stem}.mtl"), bytes: mtl(&looks, image.as_deref()).into_bytes(), part: None });
        }
    }
    Ok(files)
}

/// Faces that look the same.
struct Looks<'a> {
    color: [f32; 4],
    texture: Option<&'a str>,
    faces: Vec<(&'a Mesh, usize)>,
}

/// All faces of a part by how they look, in the order in which looks first appear; none longer than MuJoCo reads.
fn by_material(meshes: &[Mesh]) -> Vec<Looks<'_>> {
    let mut found: Vec<Looks<'_>> = Vec::new();
    for mesh in meshes {
        for (index, face) in mesh.faces.iter().enumerate() {
            let material = &mesh.materials[face.material as usize];
            let texture = material.texture.as_deref();
            let same = |looks: &&mut Looks<'_>| {
                looks.color == material.color && looks.texture == texture && looks.faces.len() < MAX_FACES
            };
            match found.iter_mut().find(same) {
                Some(looks) => looks.faces.push((mesh, index)),
                None => found.push(Looks { color: material.color, texture, faces: vec![(mesh, index)] }),
            }
        }
    }
    found
}

fn obj(stem: &str, looks: &Looks<'_>) -> String {
    let mut text = format!("mtllib {stem}.mtl\nusemtl looks\n");
    let (mut vertices, mut uvs, mut faces) = (String::new(), String::new(), String::new());
    // By address: one mesh's vertices follow the other's.
    let mut known: BTreeMap<(usize, u32), usize> = BTreeMap::new();
    let mut known_uvs: BTreeMap<(usize, u32), usize> = BTreeMap::new();
    let mut order: Vec<*const Mesh> = Vec::new();
    for &(mesh, index) in &looks.faces {
        let which = order.iter().position(|other| std::ptr::eq(*other, mesh)).unwrap_or_else(|| {
            order.push(mesh);
            order.len() - 1
        });
        let face = mesh.faces[index];
        faces.push('f');
        for corner in 0..3 {
            let next = known.len() + 1;
            let vertex = *known.entry((which, face.corners[corner])).or_insert_with(|| {
                let point = mesh.vertices[face.corners[corner] as usize];
                let _infallible = writeln!(vertices, "v {:.7} {:.7} {:.7}", point.x, point.y, point.z);
                next
            });
            let _infallible = write!(faces, " {vertex}");
            if let Some(uv) = face.uvs.map(|uvs| uvs[corner]).filter(|_| looks.texture.is_some()) {
                let next = known_uvs.len() + 1;
                let uv = *known_uvs.entry((which, uv)).or_insert_with(|| {
                    let [u, v] = mesh.uvs[uv as usize];
                    let _infallible = writeln!(uvs, "vt {u:.6} {v:.6}");
                    next
                });
                let _infallible = write!(faces, "/{uv}");
            }
        }
        faces.push('\n');
    }
    text += &vertices;
    text += &uvs;
    text += &faces;
    text
}

fn mtl(looks: &Looks<'_>, image: Option<&str>) -> String {
    let [r, g, b, a] = looks.color;
    let image = image.map_or_else(String::new, |image| format!("map_Kd {image}\n"));
    format!("newmtl looks\nKd {r} {g} {b}\nd {a}\n{image}")
}
