//! Every reader of foreign bytes, to its end: what the fuzzers run, and the replay of their corpus.
//!
//! A reader either refuses with a message or gives something sound; both are checked, nothing is returned.

use crate::{
    cache, decompose, files,
    mesh::{Mesh, read_mtl, read_obj, read_stl},
    mjcf, partnet,
    repairs::Repairs,
    structure::{HelperMotion, structure},
    texture, urdf,
};

/// Longer texts tell a fuzzer nothing new.
const MOST: usize = 64 << 10;

fn text_of(bytes: &[u8]) -> Option<String> {
    files::text(bytes.get(..MOST).unwrap_or(bytes).to_vec()).ok()
}

/// Every number of a structure is finite and every index in range.
fn check_structure(description: &crate::description::Description) {
    for helper in [HelperMotion::Slide, HelperMotion::Turn] {
        let mut repairs = Repairs::default();
        let Ok(found) = structure(description, &[], helper, &mut repairs) else { continue };
        assert!(found.joints.len() + 1 == found.parts.len(), "{} joints of {} parts", found.joints.len(), found.parts.len());
        for joint in &found.joints {
            assert!(joint.parent < found.parts.len() && joint.child < found.parts.len());
            assert!(joint.anchor.iter().chain(joint.axis.iter()).all(|x| x.is_finite()), "{joint:?}");
            assert!(joint.limits.is_none_or(|[low, high]| low <= 0.0 && 0.0 <= high && low < high), "{joint:?}");
        }
        drop(repairs.into_list());
    }
}

/// URDF.
pub fn urdf(bytes: &[u8]) {
    if let Some(Ok(description)) = text_of(bytes).map(|text| urdf::read(&text)) {
        check_structure(&description);
    }
}

/// MJCF.
pub fn mjcf(bytes: &[u8]) {
    if let Some(Ok(description)) = text_of(bytes).map(|text| mjcf::read(&text, None)) {
        check_structure(&description);
    }
}

/// OBJ, MTL, STL, images; what is small enough is decomposed, too.
pub fn mesh(bytes: &[u8]) {
    drop(read_mtl(bytes));
    if bytes.len() < 4096 {
        drop(texture::read(bytes));
    }
    let meshes = [read_obj(bytes).ok().map(|file| file.mesh), read_stl(bytes).ok()];
    for mesh in meshes.into_iter().flatten() {
        check_mesh(&mesh);
        if mesh.faces.len() <= 24
            && let Some(made) = decompose::decompose(&[&mesh], 4, |soup, make| make(soup))
        {
            assert!(!made.hulls.is_empty() && made.hulls.len() <= 4);
            let sound = made.hulls.iter().all(|hull| hull.vertices.iter().all(|vertex| vertex.iter().all(|x| x.is_finite())));
            assert!(sound, "{made:?}");
        }
    }
}

fn check_mesh(mesh: &Mesh) {
    for face in &mesh.faces {
        assert!(mesh.triangle(face).iter().all(|corner| corner.iter().all(|x| x.is_finite())));
        assert!((face.material as usize) < mesh.materials.len());
        assert!(face.uvs.is_none_or(|uvs| uvs.iter().all(|&uv| (uv as usize) < mesh.uvs.len())));
    }
}

/// The JSON and text files beside a PartNet-Mobility description, and stored hulls.
pub fn json(bytes: &[u8]) {
    let Some(text) = text_of(bytes) else { return };
    drop(partnet::mobility(&text));
    drop(partnet::meta(&text));
    drop(partnet::bounding_box(&text));
    drop(partnet::semantics(&text));
    for hull in cache::read(&text).unwrap_or_default() {
        assert!(hull.is_sound());
    }
}
