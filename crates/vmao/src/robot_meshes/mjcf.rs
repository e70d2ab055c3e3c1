//! Reads what pictures need of a MuJoCo model: the tree of bodies and their meshes that take no part in collisions.
//!
//! Bounded in size, nodes and nesting. Includes are not followed; textures are ignored.

use crate::wording::{Place, quoted};
use nalgebra::{UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vmao_core::geometry::{Pose, pose};

/// The largest model that is read (bytes).
pub(super) const MAX_BYTES: u64 = 4 << 20;
const MAX_NODES: u32 = 100_000;
const MAX_DEPTH: usize = 100;
/// No robot has a length (m) or a factor beyond it.
const MAX_NUMBER: f64 = 1e4;

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
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| format!("not XML: {error}"))?;
    let root = document.root_element();
    if root.tag_name().name() != "mujoco" {
        return Err(format!("the root element is {}, expected `mujoco`", quoted(root.tag_name().name())));
    }
    // The XML reader does not recurse; what follows does.
    if let Some(deep) = root.descendants().find(|node| node.ancestors().nth(MAX_DEPTH).is_some()) {
        return Err(at(deep, &format!("more than {MAX_DEPTH} elements inside one another")));
    }
    let mut reader = Reader::new(root)?;
    for world in root.children().filter(|node| node.has_tag_name("worldbody")) {
        reader.walk(world, None, Pose::identity(), None)?;
    }
    Ok(reader.bodies)
}

type Attributes<'a> = BTreeMap<&'a str, &'a str>;

struct Reader<'a> {
    degrees: bool,
    mesh_folder: PathBuf,
    /// By class and element.
    defaults: BTreeMap<(&'a str, &'a str), Attributes<'a>>,
    main_class: &'a str,
    meshes: BTreeMap<String, Node<'a, 'a>>,
    materials: BTreeMap<&'a str, Node<'a, 'a>>,
    bodies: Vec<Body>,
}

impl<'a> Reader<'a> {
    fn new(root: Node<'a, 'a>) -> Result<Self, String> {
        let mut reader = Self {
            degrees: true,
            mesh_folder: PathBuf::new(),
            defaults: BTreeMap::new(),
            main_class: "main",
            meshes: BTreeMap::new(),
            materials: BTreeMap::new(),
            bodies: Vec::new(),
        };
        let sections = |name: &'static str| root.children().filter(move |node| node.has_tag_name(name));
        for compiler in sections("compiler") {
            reader.degrees = compiler.attribute("angle").map_or(reader.degrees, |unit| unit != "radian");
            if let Some(folder) = compiler.attribute("meshdir").or(compiler.attribute("assetdir")) {
                reader.mesh_folder = PathBuf::from(folder);
            }
            if let Some(sequence) = compiler.attribute("eulerseq").filter(|sequence| *sequence != "xyz") {
                return Err(at(compiler, &format!("eulerseq is {}, expected `xyz`", quoted(sequence))));
            }
        }
        for default in sections("default") {
            reader.main_class = default.attribute("class").unwrap_or("main");
            reader.read_defaults(default, reader.main_class, &BTreeMap::new())?;
        }
        for asset in sections("asset") {
            for node in asset.children().filter(Node::is_element) {
                match (node.tag_name().name(), node.attribute("name")) {
                    ("mesh", Some(name)) => drop(reader.meshes.insert(name.to_owned(), node)),
                    ("mesh", None) => {
                        let stem = node.attribute("file").and_then(|file| Path::new(file).file_stem());
                        if let Some(stem) = stem {
                            reader.meshes.insert(stem.to_string_lossy().into_owned(), node);
                        }
                    }
                    ("material", Some(name)) => drop(reader.materials.insert(name, node)),
                    _ => {}
                }
            }
        }
        Ok(reader)
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
            let attributes = child.attributes().map(|attribute| (attribute.name(), attribute.value()));
            own.entry(child.tag_name().name()).or_default().extend(attributes);
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
        attributes.extend(node.attributes().map(|attribute| (attribute.name(), attribute.value())));
        attributes
    }

    /// Reads what hangs on `parent`; frames (`<frame>`) only displace what is in them.
    fn walk(
        &mut self,
        node: Node<'a, 'a>,
        parent: Option<usize>,
        parent_from_here: Pose,
        class: Option<&'a str>,
    ) -> Result<(), String> {
        for child in node.children().filter(Node::is_element) {
            let class = child.attribute("childclass").or(class);
            match child.tag_name().name() {
                "body" => {
                    let parent_from_body = parent_from_here * self.placement(child, &child_attributes(child))?;
                    let name = child.attribute("name").unwrap_or_default().to_owned();
                    self.bodies.push(Body { name, parent, parent_from_body, joints: Vec::new(), meshes: Vec::new() });
                    self.walk(child, Some(self.bodies.len() - 1), Pose::identity(), class)?;
                }
                "frame" => {
                    let placement = self.placement(child, &child_attributes(child))?;
                    self.walk(child, parent, parent_from_here * placement, class)?;
                }
                "joint" | "freejoint" => {
                    let joint = self.joint(child, class)?;
                    if let Some(parent) = parent {
                        self.bodies[parent].joints.push(joint);
                    }
                }
                "geom" => {
                    if let (Some(parent), Some(mut mesh)) = (parent, self.mesh_geom(child, class)?) {
                        mesh.body_from_mesh = parent_from_here * mesh.body_from_mesh;
                        self.bodies[parent].meshes.push(mesh);
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn joint(&self, node: Node<'a, 'a>, class: Option<&'a str>) -> Result<Joint, String> {
        let attributes = self.resolved(node, class);
        let axis = Vector3::from(numbers(node, &attributes, "axis")?.unwrap_or([0.0, 0.0, 1.0]));
        let axis = axis.try_normalize(1e-12).ok_or_else(|| at(node, "axis is zero"))?;
        Ok(match attributes.get("type").copied() {
            _ if node.has_tag_name("freejoint") => Joint::Other,
            None | Some("hinge") => Joint::Hinge { axis },
            Some("slide") => Joint::Slide { axis, range: numbers(node, &attributes, "range")? },
            Some(_) => Joint::Other,
        })
    }

    fn mesh_geom(&self, node: Node<'a, 'a>, class: Option<&'a str>) -> Result<Option<MeshGeom>, String> {
        let attributes = self.resolved(node, class);
        let collides = |name: &str| attributes.get(name).is_none_or(|bits| *bits != "0");
        let Some(name) = attributes.get("mesh").filter(|_| attributes.get("type") == Some(&"mesh")) else { return Ok(None) };
        if collides("contype") || collides("conaffinity") {
            return Ok(None);
        }
        let mesh = *self.meshes.get(*name).ok_or_else(|| at(node, &format!("no mesh is named {}", quoted(name))))?;
        let asset = self.resolved(mesh, None);
        if let Some(moved) = ["refpos", "refquat"].into_iter().find(|attribute| asset.contains_key(attribute)) {
            return Err(at(mesh, &format!("{moved} is not understood")));
        }
        let file = asset.get("file").ok_or_else(|| at(mesh, "a mesh without a file is not understood"))?;
        let scale = numbers(mesh, &asset, "scale")?.unwrap_or([1.0; 3]);
        if scale.contains(&0.0) {
            return Err(at(mesh, "a scale is 0"));
        }
        let material = attributes.get("material").and_then(|name| self.materials.get(name));
        let painted = material.map(|node| (*node, self.resolved(*node, None)));
        let painted = painted.map_or(Ok(None), |(node, attributes)| numbers(node, &attributes, "rgba"))?;
        let rgba = numbers(node, &attributes, "rgba")?.or(painted).unwrap_or([0.5, 0.5, 0.5, 1.0]);
        Ok(Some(MeshGeom {
            body_from_mesh: self.placement(node, &attributes)?,
            file: self.mesh_folder.join(file),
            scale,
            rgba: rgba.map(|value| value.clamp(0.0, 1.0) as f32),
        }))
    }

    fn placement(&self, node: Node<'_, '_>, attributes: &Attributes<'_>) -> Result<Pose, String> {
        let position = numbers(node, attributes, "pos")?.unwrap_or([0.0; 3]);
        if let Some(other) = ["xyaxes", "zaxis", "fromto"].into_iter().find(|name| attributes.contains_key(name)) {
            return Err(at(node, &format!("{other} is not understood; quat, euler and axisangle are")));
        }
        let unit = if self.degrees { std::f64::consts::PI / 180.0 } else { 1.0 };
        if let Some([x, y, z]) = numbers(node, attributes, "euler")? {
            let turn = |axis, angle: f64| UnitQuaternion::from_axis_angle(&axis, angle * unit);
            let rotation = turn(Vector3::x_axis(), x) * turn(Vector3::y_axis(), y) * turn(Vector3::z_axis(), z);
            return Ok(Pose::from_parts(Vector3::from(position).into(), rotation));
        }
        if let Some([x, y, z, angle]) = numbers(node, attributes, "axisangle")? {
            let axis = Vector3::new(x, y, z).try_normalize(1e-12).ok_or_else(|| at(node, "the axis of axisangle is zero"))?;
            return Ok(Pose::from_parts(Vector3::from(position).into(), UnitQuaternion::from_scaled_axis(axis * angle * unit)));
        }
        let quaternion: [f64; 4] = numbers(node, attributes, "quat")?.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        if quaternion.iter().all(|x| x.abs() < 1e-12) {
            return Err(at(node, "quat is zero"));
        }
        Ok(pose(position, quaternion))
    }
}

/// A body's own attributes: bodies have no defaults.
fn child_attributes<'a>(node: Node<'a, 'a>) -> Attributes<'a> {
    node.attributes().map(|attribute| (attribute.name(), attribute.value())).collect()
}

/// The attribute's `N` finite numbers; none if it is not there.
fn numbers<const N: usize>(node: Node<'_, '_>, attributes: &Attributes<'_>, name: &str) -> Result<Option<[f64; N]>, String> {
    let Some(text) = attributes.get(name) else { return Ok(None) };
    let refuse = || at(node, &format!("{name} is {}, expected {N} numbers of at most {MAX_NUMBER}", quoted(text)));
    let read = |word: &str| word.parse::<f64>().ok().filter(|x| x.abs() <= MAX_NUMBER).ok_or_else(refuse);
    // One more than expected is enough to see that there are too many.
    let values = text.split_whitespace().take(N + 1).map(read).collect::<Result<Vec<f64>, _>>()?;
    let exact: Option<[f64; N]> = values.try_into().ok();
    exact.map(Some).ok_or_else(refuse)
}

/// The message with the node's place and element.
fn at(node: Node<'_, '_>, message: &str) -> String {
    let place = Place::of(node.document().input_text().as_bytes(), node.range().start);
    let name = node.attribute("name").map_or_else(String::new, |name| format!(" {}", quoted(name)));
    format!("{place}: <{}>{name}: {message}", node.tag_name().name())
}
