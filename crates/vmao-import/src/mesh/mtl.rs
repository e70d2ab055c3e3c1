//! MTL, the materials of OBJ files: diffuse colour, opacity and the image over it.

use super::{GREY, MAX_MATERIALS, Material, obj};
use crate::files::check_encoding;

/// The materials in `bytes`. Fails with a line and what was found there.
pub fn read(bytes: &[u8]) -> Result<Vec<Material>, String> {
    check_encoding(bytes)?;
    let mut materials: Vec<Material> = Vec::new();
    for (index, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        let refuse = |message: String| format!("line {}: {message}", index + 1);
        let (key, rest) = obj::split_line(line);
        if key == b"newmtl" {
            if materials.len() == MAX_MATERIALS {
                return Err(refuse(format!("more than {MAX_MATERIALS} materials")));
            }
            materials.push(Material::plain(&obj::name_of(rest), GREY));
        }
        let Some(material) = materials.last_mut() else { continue };
        let unit = |value: f64| value.clamp(0.0, 1.0) as f32;
        match key {
            b"Kd" => {
                let [r, g, b] = obj::numbers::<3>(rest).map_err(refuse)?.map(unit);
                material.color = [r, g, b, material.color[3]];
            }
            b"d" => material.color[3] = opacity(rest).map(unit).map_err(refuse)?,
            b"Tr" => material.color[3] = 1.0 - opacity(rest).map(unit).map_err(refuse)?,
            // Options come before the name; a name with blanks and options together cannot be told apart.
            b"map_Kd" if rest.starts_with(b"-") => {
                let last = rest.rsplit(u8::is_ascii_whitespace).next().unwrap_or_default();
                material.texture = Some(obj::name_of(last));
            }
            b"map_Kd" if !rest.is_empty() => material.texture = Some(obj::name_of(rest)),
            _ => {}
        }
    }
    Ok(materials)
}

/// The last number of `d 0.5` or `d -halo 0.5`.
fn opacity(rest: &[u8]) -> Result<f64, String> {
    let word = rest.rsplit(u8::is_ascii_whitespace).next().unwrap_or_default();
    obj::numbers::<1>(word).map(|[value]| value)
}
