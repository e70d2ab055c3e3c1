//! The document: defaults, assets and the tree of bodies, whatever is read from it. Bounded by [`crate::xml`].

use crate::xml::{at, numbers};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use roxmltree::{Document, Node};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vmao_core::{
    geometry::{Pose, pose},
    wording::quoted,
};

/// Attributes of an element, its class's among them.
pub type Attributes<'a> = BTreeMap<&'a str, &'a str>;

/// A body. Parents come before their children.
#[derive(Debug)]
pub struct Body<'a> {
    /// Its element.
    pub node: Node<'a, 'a>,
    /// Its index; none in the world.
    pub parent: Option<usize>,
    /// Where it is.
    pub parent_from_body: Pose,
}

/// An element of a body.
#[derive(Debug)]
pub struct Element<'a> {
    /// It.
    pub node: Node<'a, 'a>,
    /// Its attributes over those of its class.
    pub attributes: Attributes<'a>,
    /// The body it belongs to; none in the world.
    pub body: Option<usize>,
    /// The frame that it is placed in, in its body.
    pub body_from_frame: Pose,
}

/// A mesh that geoms may name.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshAsset {
    /// As the model names it, below the model's own folder; not checked.
    pub file: PathBuf,
    /// Factors along the file's axes.
    pub scale: [f64; 3],
}

/// A model's settings, defaults, assets and bodies.
#[derive(Debug)]
pub struct Model<'a> {
    /// The root element.
    pub root: Node<'a, 'a>,
    /// All bodies.
    pub bodies: Vec<Body<'a>>,
    /// Joints and geoms of all bodies, in the order of the text.
    pub elements: Vec<Element<'a>>,
    /// Whether a range alone makes a joint limited.
    pub autolimits: bool,
    degrees: bool,
    mesh_folder: PathBuf,
    texture_folder: PathBuf,
    /// By class and element.
    defaults: BTreeMap<(&'a str, &'a str), Attributes<'a>>,
    main_class: &'a str,
    meshes: BTreeMap<String, Node<'a, 'a>>,
    materials: BTreeMap<&'a str, Node<'a, 'a>>,
    textures: BTreeMap<&'a str, Node<'a, 'a>>,
}

/// The name of an asset: what it says, or its file's without extension.
fn asset_name(node: Node<'_, '_>) -> Option<String> {
    let stem = || Some(Path::new(node.attribute("file")?).file_stem()?.to_string_lossy().into_owned());
    node.attribute("name").map(str::to_owned).or_else(stem)
}

impl<'a> Model<'a> {
    /// The model in a parsed `document`. Fails with a place in the text and what was found there.
    pub fn new(document: &'a Document<'a>) -> Result<Self, String> {
        let root = document.root_element();
        let mut model = Self {
            root,
            bodies: Vec::new(),
            elements: Vec::new(),
            autolimits: true,
            degrees: true,
            mesh_folder: PathBuf::new(),
            texture_folder: PathBuf::new(),
            defaults: BTreeMap::new(),
            main_class: "main",
            meshes: BTreeMap::new(),
            materials: BTreeMap::new(),
            textures: BTreeMap::new(),
        };
        let sections = |name: &'static str| root.children().filter(move |node| node.has_tag_name(name));
        for compiler in sections("compiler") {
            model.read_compiler(compiler)?;
        }
        for default in sections("default") {
            model.main_class = default.attribute("class").unwrap_or("main");
            model.read_defaults(default, model.main_class, &BTreeMap::new())?;
        }
        for node in sections("asset").flat_map(|asset| asset.children()).filter(Node::is_element) {
            match (node.tag_name().name(), node.attribute("name")) {
                ("mesh", _) => drop(asset_name(node).map(|name| model.meshes.insert(name, node))),
                ("material", Some(name)) => drop(model.materials.insert(name, node)),
                ("texture", Some(name)) => drop(model.textures.insert(name, node)),
                _ => {}
            }
        }
        for world in sections("worldbody") {
            model.walk(world, None, Pose::identity(), None)?;
        }
        Ok(model)
    }

    fn read_compiler(&mut self, compiler: Node<'a, 'a>) -> Result<(), String> {
        self.degrees = compiler.attribute("angle").map_or(self.degrees, |unit| unit != "radian");
        self.autolimits = compiler.attribute("autolimits").map_or(self.autolimits, |value| value != "false");
        let folder = |name| compiler.attribute(name).or(compiler.attribute("assetdir")).map(PathBuf::from);
        self.mesh_folder = folder("meshdir").unwrap_or_else(|| std::mem::take(&mut self.mesh_folder));
        self.texture_folder = folder("texturedir").unwrap_or_else(|| std::mem::take(&mut self.texture_folder));
        for (name, only) in [("eulerseq", "xyz"), ("coordinate", "local")] {
            if let Some(other) = compiler.attribute(name).filter(|value| *value != only) {
                return Err(at(compiler, &format!("{name} is {}, expected `{only}`", quoted(other))));
            }
        }
        Ok(())
    }

    /// A class has what its parent class has, and what it says itself.
    fn read_defaults(
        &mut self,
        node: Node<'a, 'a>,
        class: &'a str,
        inherited: &BTreeMap<&'a str, Attributes<'a>>,
    ) -> Result<(), String> {
        let mut own = inherited.clone();
        for child in node.children().filter(|child| child.is_element() && !child.has_tag_name("default")) {
            own.entry(child.tag_name().name()).or_default().extend(own_attributes(child));
        }
        for (element, attributes) in &own {
            self.defaults.insert((class, element), attributes.clone());
        }
        for child in node.children().filter(|child| child.has_tag_name("default")) {
            let name = child.attribute("class").ok_or_else(|| at(child, "a nested default has no class"))?;
            self.read_defaults(child, name, &own)?;
        }
        Ok(())
    }

    /// The element's attributes over those of its class.
    fn resolved(&self, node: Node<'a, 'a>, class: Option<&'a str>) -> Attributes<'a> {
        let class = node.attribute("class").or(class).unwrap_or(self.main_class);
        let mut attributes = self.defaults.get(&(class, node.tag_name().name())).cloned().unwrap_or_default();
        attributes.extend(own_attributes(node));
        attributes
    }

    /// Reads what hangs on `parent`; frames (`<frame>`) only displace what is in them.
    fn walk(&mut self, node: Node<'a, 'a>, parent: Option<usize>, here: Pose, class: Option<&'a str>) -> Result<(), String> {
        for child in node.children().filter(Node::is_element) {
            let class = child.attribute("childclass").or(class);
            match child.tag_name().name() {
                "body" => {
                    let parent_from_body = here * self.placement(child, &own_attributes(child).collect())?;
                    self.bodies.push(Body { node: child, parent, parent_from_body });
                    self.walk(child, Some(self.bodies.len() - 1), Pose::identity(), class)?;
                }
                "frame" => {
                    let placement = self.placement(child, &own_attributes(child).collect())?;
                    self.walk(child, parent, here * placement, class)?;
                }
                "joint" | "freejoint" | "geom" | "inertial" => {
                    let attributes = self.resolved(child, class);
                    self.elements.push(Element { node: child, attributes, body: parent, body_from_frame: here });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The factor from the model's unit of angles to radians.
    pub fn angle_unit(&self) -> f64 {
        if self.degrees { std::f64::consts::PI / 180.0 } else { 1.0 }
    }

    /// The mesh asset of this name, for a geom at `node`.
    pub fn mesh(&self, node: Node<'a, 'a>, name: &str) -> Result<MeshAsset, String> {
        let mesh = *self.meshes.get(name).ok_or_else(|| at(node, &format!("no mesh is named {}", quoted(name))))?;
        let asset = self.resolved(mesh, None);
        if let Some(moved) = ["refpos", "refquat"].into_iter().find(|attribute| asset.contains_key(attribute)) {
            return Err(at(mesh, &format!("{moved} is not understood")));
        }
        let file = asset.get("file").ok_or_else(|| at(mesh, "a mesh without a file is not understood"))?;
        let scale = numbers(mesh, "scale", asset.get("scale").copied())?.unwrap_or([1.0; 3]);
        if scale.contains(&0.0) {
            return Err(at(mesh, "a scale is 0"));
        }
        Ok(MeshAsset { file: self.mesh_folder.join(file), scale })
    }

    /// Red, green, blue and opacity of a geom with these attributes: its own, or its material's.
    pub fn color(&self, node: Node<'a, 'a>, attributes: &Attributes<'a>) -> Result<Option<[f32; 4]>, String> {
        let painted = match self.material(attributes) {
            Some((node, attributes)) => numbers(node, "rgba", attributes.get("rgba").copied())?,
            None => None,
        };
        let rgba: Option<[f64; 4]> = numbers(node, "rgba", attributes.get("rgba").copied())?.or(painted);
        Ok(rgba.map(|rgba| rgba.map(|value| value.clamp(0.0, 1.0) as f32)))
    }

    /// The image file of a geom's material, as the model names it.
    pub fn texture(&self, attributes: &Attributes<'a>) -> Option<PathBuf> {
        let (_, material) = self.material(attributes)?;
        let texture = self.textures.get(material.get("texture")?)?;
        Some(self.texture_folder.join(texture.attribute("file")?))
    }

    fn material(&self, attributes: &Attributes<'a>) -> Option<(Node<'a, 'a>, Attributes<'a>)> {
        let node = *self.materials.get(attributes.get("material")?)?;
        Some((node, self.resolved(node, None)))
    }

    /// Where an element with these attributes is placed.
    pub fn placement(&self, node: Node<'_, '_>, attributes: &Attributes<'_>) -> Result<Pose, String> {
        let get = |name: &str| attributes.get(name).copied();
        let position = numbers(node, "pos", get("pos"))?.unwrap_or([0.0; 3]);
        if attributes.contains_key("fromto") {
            return Err(at(node, "fromto is not understood here; quat, euler, axisangle, xyaxes and zaxis are"));
        }
        let rotation = self.rotation(node, attributes)?;
        Ok(Pose::from_parts(Vector3::from(position).into(), rotation))
    }

    fn rotation(&self, node: Node<'_, '_>, attributes: &Attributes<'_>) -> Result<UnitQuaternion<f64>, String> {
        let (get, unit) = (|name: &str| attributes.get(name).copied(), self.angle_unit());
        let direction = |vector: Vector3<f64>, of: &str| {
            vector.try_normalize(1e-12).ok_or_else(|| at(node, &format!("the axis of {of} is zero")))
        };
        if let Some([x, y, z]) = numbers(node, "euler", get("euler"))? {
            let turn = |axis, angle: f64| UnitQuaternion::from_axis_angle(&axis, angle * unit);
            return Ok(turn(Vector3::x_axis(), x) * turn(Vector3::y_axis(), y) * turn(Vector3::z_axis(), z));
        }
        if let Some([x, y, z, angle]) = numbers(node, "axisangle", get("axisangle"))? {
            return Ok(UnitQuaternion::from_scaled_axis(direction(Vector3::new(x, y, z), "axisangle")? * angle * unit));
        }
        if let Some([a, b, c, d, e, f]) = numbers(node, "xyaxes", get("xyaxes"))? {
            let x = direction(Vector3::new(a, b, c), "xyaxes")?;
            let y = Vector3::new(d, e, f);
            let y = direction(y - x * x.dot(&y), "xyaxes")?;
            let matrix = Matrix3::from_columns(&[x, y, x.cross(&y)]);
            return Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix)));
        }
        if let Some(z) = numbers(node, "zaxis", get("zaxis"))? {
            return Ok(turn_z_to(&direction(Vector3::from(z), "zaxis")?));
        }
        let quaternion: [f64; 4] = numbers(node, "quat", get("quat"))?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        if quaternion.iter().all(|x| x.abs() < 1e-12) {
            return Err(at(node, "quat is zero"));
        }
        Ok(pose([0.0; 3], quaternion).rotation)
    }
}

/// The smallest turn that takes +z to this direction.
pub(super) fn turn_z_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between(&Vector3::z(), direction).unwrap_or_else(half_turn)
}

/// What an element says itself.
fn own_attributes<'a>(node: Node<'a, 'a>) -> impl Iterator<Item = (&'a str, &'a str)> {
    node.attributes().map(|attribute| (attribute.name(), attribute.value()))
}
