//! Wavefront OBJ: vertices, texture coordinates, polygons as fans, objects or groups, materials by name.

use super::{Face, GREY, MAX_FACES, MAX_MATERIALS, MAX_VERTICES, Material, Mesh, coordinate};
use crate::files::check_encoding;
use nalgebra::Point3;
use vmao_core::wording::quoted;

/// The most corners of a polygon.
const MAX_CORNERS: usize = 1024;

/// What an OBJ file says; its materials have names only.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ObjFile {
    /// The mesh. Materials are grey until an MTL file says more.
    pub mesh: Mesh,
    /// The MTL files it names.
    pub libraries: Vec<String>,
}

/// The mesh in `bytes`. Fails with a line and what was found there.
pub fn read(bytes: &[u8]) -> Result<ObjFile, String> {
    check_encoding(bytes)?;
    let mut reader = Reader::default();
    for (index, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        reader.line(line).map_err(|message| format!("line {}: {message}", index + 1))?;
    }
    let mesh = &mut reader.file.mesh;
    if mesh.faces.is_empty() {
        return Err("no faces".to_owned());
    }
    if mesh.materials.is_empty() {
        mesh.materials.push(Material::plain("", GREY));
    }
    Ok(reader.file)
}

#[derive(Default)]
struct Reader {
    file: ObjFile,
    material: Option<u32>,
    groups: u32,
}

/// A name of the file: bounded, and text whatever its bytes are.
pub(super) fn name_of(rest: &[u8]) -> String {
    String::from_utf8_lossy(&rest[..rest.len().min(1024)]).trim().to_owned()
}

/// The first word of a line, and the rest.
pub(super) fn split_line(line: &[u8]) -> (&[u8], &[u8]) {
    let line = line.trim_ascii();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii())
}

fn words(rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// The first `N` numbers of a line.
pub(super) fn numbers<const N: usize>(rest: &[u8]) -> Result<[f64; N], String> {
    let values: Option<Vec<f64>> = words(rest).take(N).map(coordinate).collect();
    let exact = values.and_then(|values| <[f64; N]>::try_from(values).ok());
    exact.ok_or_else(|| format!("{}, expected {N} finite numbers of at most {}", quoted(&name_of(rest)), super::MAX_COORDINATE))
}

impl Reader {
    fn line(&mut self, line: &[u8]) -> Result<(), String> {
        let (key, rest) = split_line(line);
        let mesh = &mut self.file.mesh;
        match key {
            b"v" => {
                if mesh.vertices.len() == MAX_VERTICES {
                    return Err(format!("more than {MAX_VERTICES} vertices, the most that is read; simplify the mesh first"));
                }
                mesh.vertices.push(Point3::from(numbers(rest)?));
            }
            b"vt" => {
                if mesh.uvs.len() == MAX_VERTICES {
                    return Err(format!("more than {MAX_VERTICES} texture coordinates, the most that is read"));
                }
                // The second may be left out.
                let u = numbers::<1>(rest)?[0];
                mesh.uvs.push(numbers::<2>(rest).unwrap_or([u, 0.0]));
            }
            b"f" => self.face(rest)?,
            b"o" | b"g" => self.groups = self.groups.saturating_add(1),
            b"usemtl" => {
                let name = name_of(rest);
                let known = mesh.materials.iter().position(|material| material.name == name);
                let index = known.unwrap_or(mesh.materials.len());
                if index == MAX_MATERIALS {
                    return Err(format!("more than {MAX_MATERIALS} materials"));
                }
                if known.is_none() {
                    mesh.materials.push(Material::plain(&name, GREY));
                }
                self.material = Some(index as u32);
            }
            b"mtllib" if self.file.libraries.len() < 16 => self.file.libraries.push(name_of(rest)),
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, rest: &[u8]) -> Result<(), String> {
        let mesh = &mut self.file.mesh;
        if self.material.is_none() {
            mesh.materials.push(Material::plain("", GREY));
            self.material = Some(mesh.materials.len() as u32 - 1);
        }
        let mut corners: Vec<(u32, Option<u32>)> = Vec::new();
        for word in words(rest) {
            if corners.len() == MAX_CORNERS {
                return Err(format!("a face with more than {MAX_CORNERS} corners"));
            }
            let mut indices = word.split(|&byte| byte == b'/');
            let vertex = index(indices.next().unwrap_or_default(), mesh.vertices.len(), "vertices")?;
            let uv = match indices.next() {
                None | Some(b"") => None,
                Some(word) => Some(index(word, mesh.uvs.len(), "texture coordinates")?),
            };
            corners.push((vertex, uv));
        }
        if corners.len() < 3 {
            return Err(format!("a face with {} corners, expected 3 or more", corners.len()));
        }
        if mesh.faces.len() + corners.len() - 2 > MAX_FACES {
            return Err(format!("more than {MAX_FACES} faces, the most that is read; simplify the mesh first"));
        }
        for pair in corners[1..].windows(2) {
            let fan = [corners[0], pair[0], pair[1]];
            let uvs = fan.map(|(_, uv)| uv);
            let uvs = if let [Some(a), Some(b), Some(c)] = uvs { Some([a, b, c]) } else { None };
            let material = self.material.unwrap_or_default();
            mesh.faces.push(Face { corners: fan.map(|(vertex, _)| vertex), uvs, material, group: self.groups });
        }
        Ok(())
    }
}

/// An index from zero: the file counts from one, or back from the last one with negative numbers.
fn index(word: &[u8], count: usize, of: &str) -> Result<u32, String> {
    let value: Option<i64> = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
    let index = value.and_then(|value| match value {
        1.. => usize::try_from(value - 1).ok(),
        0 => None,
        _ => count.checked_sub(usize::try_from(value.checked_neg()?).ok()?),
    });
    let refuse = || format!("a face names {}, but there are {count} {of} so far", quoted(&name_of(word)));
    index.filter(|index| *index < count).map(|index| index as u32).ok_or_else(refuse)
}
