//! What pictures need of a MuJoCo model: the tree of bodies and their meshes that take no part in collisions.
//!
//! Includes are not followed; textures are ignored.

use nalgebra::Vector3;
use std::path::PathBuf;
use vmao_core::geometry::Pose;
use vmao_import::{
    mjcf::{Element, Model},
    xml::{at, numbers, parse},
};

/// The largest model that is read (bytes).
pub(super) const MAX_BYTES: u64 = vmao_import::xml::MAX_BYTES;

/// A body. Parents come before their children.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) name: String,
    /// Its index; none in the world.
    pub(super) parent: Option<usize>,
    pub(super) parent_from_body: Pose,
    pub(super) joints: Vec<Joint>,
    pub(super) meshes: Vec<MeshGeom>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Joint {
    Hinge {
        axis: Vector3<f64>,
    },
    /// Its range in metres; none if unlimited.
    Slide {
        axis: Vector3<f64>,
        range: Option<[f64; 2]>,
    },
    Other,
}

/// A mesh that is only looked at.
#[derive(Debug, Clone)]
pub(super) struct MeshGeom {
    pub(super) body_from_mesh: Pose,
    /// As the model names it, below the model's own folder; not checked.
    pub(super) file: PathBuf,
    pub(super) scale: [f64; 3],
    pub(super) rgba: [f32; 4],
}

/// The bodies of the model. Fails with a place in the text and what was found there.
pub(super) fn bodies(text: &str) -> Result<Vec<Body>, String> {
    let document = parse(text, "mujoco")?;
    let model = Model::new(&document)?;
    let plain = |body: &vmao_import::mjcf::Body<'_>| Body {
        name: body.node.attribute("name").unwrap_or_default().to_owned(),
        parent: body.parent,
        parent_from_body: body.parent_from_body,
        joints: Vec::new(),
        meshes: Vec::new(),
    };
    let mut bodies: Vec<Body> = model.bodies.iter().map(plain).collect();
    for element in &model.elements {
        let Some(body) = element.body.map(|index| &mut bodies[index]) else { continue };
        match element.node.tag_name().name() {
            "joint" | "freejoint" => body.joints.push(joint(element)?),
            "geom" => body.meshes.extend(mesh_geom(&model, element)?),
            _ => {}
        }
    }
    Ok(bodies)
}

fn joint(element: &Element<'_>) -> Result<Joint, String> {
    let Element { node, attributes, .. } = element;
    let get = |name: &str| attributes.get(name).copied();
    let axis = Vector3::from(numbers(*node, "axis", get("axis"))?.unwrap_or([0.0, 0.0, 1.0]));
    let axis = axis.try_normalize(1e-12).ok_or_else(|| at(*node, "axis is zero"))?;
    Ok(match get("type") {
        _ if node.has_tag_name("freejoint") => Joint::Other,
        None | Some("hinge") => Joint::Hinge { axis },
        Some("slide") => Joint::Slide { axis, range: numbers(*node, "range", get("range"))? },
        Some(_) => Joint::Other,
    })
}

fn mesh_geom<'a>(model: &Model<'a>, element: &Element<'a>) -> Result<Option<MeshGeom>, String> {
    let Element { node, attributes, body_from_frame, .. } = element;
    let collides = |name: &str| attributes.get(name).is_none_or(|bits| *bits != "0");
    let Some(name) = attributes.get("mesh").filter(|_| attributes.get("type") == Some(&"mesh")) else { return Ok(None) };
    if collides("contype") || collides("conaffinity") {
        return Ok(None);
    }
    let asset = model.mesh(*node, name)?;
    Ok(Some(MeshGeom {
        body_from_mesh: body_from_frame * model.placement(*node, attributes)?,
        file: asset.file,
        scale: asset.scale,
        rgba: model.color(*node, attributes)?.unwrap_or([0.5, 0.5, 0.5, 1.0]),
    }))
}
