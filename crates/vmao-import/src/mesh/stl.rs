//! STL, binary and text: triangles without colours.

use super::{GREY, MAX_FACES, MAX_VERTICES, Material, Mesh, coordinate, obj};
use crate::files::check_encoding;
use nalgebra::Point3;

const HEADER: usize = 84;
const RECORD: usize = 50;

/// The mesh in `bytes`. Fails with a place and what was found there.
pub fn read(bytes: &[u8]) -> Result<Mesh, String> {
    let points = match bytes.get(80..HEADER) {
        Some(&[a, b, c, d]) => {
            let count = u32::from_le_bytes([a, b, c, d]) as usize;
            // A text file's 81st bytes are no sensible count; a binary file may begin with `solid`, too.
            let binary = bytes.len() >= HEADER + count.saturating_mul(RECORD);
            if binary || !bytes.trim_ascii_start().starts_with(b"solid") {
                binary_points(bytes, count)?
            } else {
                text_points(bytes)?
            }
        }
        _ => text_points(bytes)?,
    };
    if points.is_empty() {
        return Err("no faces".to_owned());
    }
    let triangles: Vec<[u32; 3]> = (0..points.len() as u32 / 3).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    Ok(Mesh::of(points, &triangles, Material::plain("", GREY)))
}

fn binary_points(bytes: &[u8], count: usize) -> Result<Vec<Point3<f64>>, String> {
    let most = MAX_FACES.min(MAX_VERTICES / 3);
    if count > most {
        return Err(format!("{count} faces, expected at most {most}; simplify the mesh first"));
    }
    let records = bytes[HEADER..].chunks_exact(RECORD);
    if records.len() < count {
        return Err(format!("{} bytes for {count} faces, expected {}", bytes.len(), HEADER + count * RECORD));
    }
    let mut points = Vec::with_capacity(3 * count);
    for (face, record) in records.take(count).enumerate() {
        for corner in record[12..48].chunks_exact(12) {
            let number = |at: usize| f64::from(f32::from_le_bytes([corner[at], corner[at + 1], corner[at + 2], corner[at + 3]]));
            let point = Point3::new(number(0), number(4), number(8));
            if !point.iter().all(|value| value.abs() <= super::MAX_COORDINATE) {
                return Err(format!(
                    "face {face}: a vertex at {point}, expected finite numbers of at most {}",
                    super::MAX_COORDINATE
                ));
            }
            points.push(point);
        }
    }
    Ok(points)
}

fn text_points(bytes: &[u8]) -> Result<Vec<Point3<f64>>, String> {
    check_encoding(bytes)?;
    let mut points = Vec::new();
    for (index, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let (key, rest) = obj::split_line(line);
        if key == b"vertex" {
            if points.len() == MAX_VERTICES {
                return Err(format!("line {}: more than {MAX_VERTICES} vertices; simplify the mesh first", index + 1));
            }
            let words: Option<Vec<f64>> =
                rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).map(coordinate).collect();
            let [x, y, z] = words.and_then(|words| words.try_into().ok()).ok_or_else(|| {
                format!("line {}: a vertex that is not 3 finite numbers of at most {}", index + 1, super::MAX_COORDINATE)
            })?;
            points.push(Point3::new(x, y, z));
        }
    }
    if points.len() % 3 != 0 {
        return Err(format!("{} vertices, expected three for each face", points.len()));
    }
    Ok(points)
}
