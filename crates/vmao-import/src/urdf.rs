//! Reads URDF: links, visuals, collisions and joints. Only what an object needs; nothing is looked up in other files.

use crate::{
    description::{Description, Form, Geometry, Joint, Link, MAX_GEOMETRIES, MAX_LINKS, Motion},
    repairs::{Quirk, Repairs},
    xml::{at, numbers, parse, roll_pitch_yaw},
};
use nalgebra::{Unit, Vector3};
use roxmltree::Node;
use std::collections::BTreeMap;
use vmao_core::{
    geometry::Pose,
    wording::{quoted, unknown},
};

/// The description in `text`. Fails with a place in the text and what was found there.
pub fn read(text: &str) -> Result<Description, String> {
    let document = parse(text, "robot")?;
    let robot = document.root_element();
    let mut reader = Reader { materials: materials(robot)?, ..Reader::default() };
    let elements = |name: &'static str| robot.children().filter(move |node| node.has_tag_name(name));
    for node in elements("link") {
        reader.link(node)?;
    }
    for node in elements("joint") {
        reader.joint(node)?;
    }
    let known = ["link", "joint", "material"];
    for node in robot.children().filter(|node| node.is_element() && !known.contains(&node.tag_name().name())) {
        reader.repairs.add(Quirk::Ignored, node.tag_name().name(), "an element that an object has no place for");
    }
    let name = robot.attribute("name").unwrap_or_default().to_owned();
    Ok(Description { name, links: reader.links, joints: reader.joints, repairs: reader.repairs })
}

/// A material that a `<visual>` may name.
#[derive(Debug, Clone, Default)]
struct Material {
    color: Option<[f32; 4]>,
    texture: Option<String>,
}

#[derive(Default)]
struct Reader {
    materials: BTreeMap<String, Material>,
    links: Vec<Link>,
    joints: Vec<Joint>,
    /// Index of every link.
    by_name: BTreeMap<String, usize>,
    geometries: usize,
    repairs: Repairs,
}

fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// One number of an attribute.
fn number(node: Node<'_, '_>, name: &str) -> Result<Option<f64>, String> {
    Ok(numbers::<1>(node, name, node.attribute(name))?.map(|[value]| value))
}

fn required(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    number(node, name)?.ok_or_else(|| at(node, &format!("{name} is missing")))
}

/// A length that is more than nothing (m).
fn length(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    let value = required(node, name)?;
    if value > 0.0 { Ok(value) } else { Err(at(node, &format!("{name} is {value}, expected more than 0"))) }
}

fn materials(robot: Node<'_, '_>) -> Result<BTreeMap<String, Material>, String> {
    let mut found = BTreeMap::new();
    for node in robot.children().filter(|node| node.has_tag_name("material")) {
        if let Some(name) = node.attribute("name") {
            found.insert(name.to_owned(), material(node)?);
        }
    }
    Ok(found)
}

fn material(node: Node<'_, '_>) -> Result<Material, String> {
    let mut found = Material::default();
    if let Some(color) = child(node, "color") {
        let rgba: Option<[f64; 4]> = numbers(color, "rgba", color.attribute("rgba"))?;
        found.color = rgba.map(|rgba| rgba.map(|value| value.clamp(0.0, 1.0) as f32));
    }
    found.texture = child(node, "texture").and_then(|texture| texture.attribute("filename")).map(str::to_owned);
    Ok(found)
}

/// The pose in the element's `<origin>`; none is the identity.
fn origin(node: Node<'_, '_>) -> Result<Pose, String> {
    let Some(origin) = child(node, "origin") else { return Ok(Pose::identity()) };
    let position = numbers(origin, "xyz", origin.attribute("xyz"))?.unwrap_or([0.0; 3]);
    let angles = numbers(origin, "rpy", origin.attribute("rpy"))?.unwrap_or([0.0; 3]);
    Ok(Pose::from_parts(Vector3::from(position).into(), roll_pitch_yaw(angles)))
}

impl Reader {
    fn link(&mut self, node: Node<'_, '_>) -> Result<(), String> {
        let name = node.attribute("name").ok_or_else(|| at(node, "a link has no name"))?;
        if self.links.len() == MAX_LINKS {
            return Err(at(node, &format!("more than {MAX_LINKS} links")));
        }
        if self.by_name.insert(name.to_owned(), self.links.len()).is_some() {
            return Err(at(node, &format!("two links are named {}", quoted(name))));
        }
        let mut link = Link { name: name.to_owned(), ..Link::default() };
        for part in node.children().filter(Node::is_element) {
            match part.tag_name().name() {
                "visual" => link.visuals.extend(self.geometry(part)?),
                "collision" => link.collisions.extend(self.geometry(part)?),
                "inertial" => {
                    let mass = child(part, "mass").map(|mass| required(mass, "value")).transpose()?;
                    link.mass = mass.filter(|mass| *mass > 0.0);
                }
                _ => {}
            }
        }
        self.links.push(link);
        Ok(())
    }

    fn geometry(&mut self, node: Node<'_, '_>) -> Result<Option<Geometry>, String> {
        self.geometries += 1;
        if self.geometries > MAX_GEOMETRIES {
            return Err(at(node, &format!("more than {MAX_GEOMETRIES} visuals and collisions")));
        }
        let holder = child(node, "geometry").ok_or_else(|| at(node, "has no <geometry>"))?;
        let shape = holder.children().find(Node::is_element).ok_or_else(|| at(holder, "is empty"))?;
        let Some(form) = self.form(shape)? else { return Ok(None) };
        let mut painted = Material::default();
        if let Some(node) = child(node, "material") {
            painted = material(node)?;
            if let Some(named) = node.attribute("name").and_then(|name| self.materials.get(name)) {
                painted.color = painted.color.or(named.color);
                painted.texture = painted.texture.or_else(|| named.texture.clone());
            }
        }
        Ok(Some(Geometry {
            name: node.attribute("name").map(str::to_owned),
            link_from_geometry: origin(node)?,
            form,
            color: painted.color,
            texture: painted.texture,
        }))
    }

    fn form(&mut self, node: Node<'_, '_>) -> Result<Option<Form>, String> {
        Ok(Some(match node.tag_name().name() {
            "mesh" => {
                let file = node.attribute("filename").ok_or_else(|| at(node, "filename is missing"))?.to_owned();
                let scale = numbers(node, "scale", node.attribute("scale"))?.unwrap_or([1.0; 3]);
                if scale.contains(&0.0) {
                    return Err(at(node, "a scale is 0"));
                }
                Form::Mesh { file, scale }
            }
            "box" => {
                let size: [f64; 3] = numbers(node, "size", node.attribute("size"))?.ok_or_else(|| at(node, "size is missing"))?;
                if size.iter().any(|edge| *edge <= 0.0) {
                    return Err(at(node, &format!("size is {size:?}, expected more than 0")));
                }
                Form::Box { half_extents: size.map(|edge| edge / 2.0) }
            }
            "sphere" => Form::Ellipsoid { radii: [length(node, "radius")?; 3] },
            "cylinder" => Form::Cylinder { radius: length(node, "radius")?, half_length: length(node, "length")? / 2.0 },
            "capsule" => Form::Capsule { radius: length(node, "radius")?, half_length: length(node, "length")? / 2.0 },
            other => {
                self.repairs.add(Quirk::Ignored, other, "a geometry of a kind that an object has no place for");
                return Ok(None);
            }
        }))
    }

    /// The index of the link that the joint's child element names.
    fn end(&self, node: Node<'_, '_>, which: &str) -> Result<usize, String> {
        let element = child(node, which).ok_or_else(|| at(node, &format!("has no <{which}>")))?;
        let name = element.attribute("link").ok_or_else(|| at(element, "link is missing"))?;
        let known = || self.links.iter().map(|link| link.name.as_str());
        self.by_name.get(name).copied().ok_or_else(|| at(element, &unknown("the file", "link", name, known())))
    }

    fn joint(&mut self, node: Node<'_, '_>) -> Result<(), String> {
        let name = node.attribute("name").ok_or_else(|| at(node, "a joint has no name"))?;
        if self.joints.iter().any(|joint| joint.name == name) {
            return Err(at(node, &format!("two joints are named {}", quoted(name))));
        }
        let kinds = ["revolute", "continuous", "prismatic", "fixed", "floating", "ball", "spherical"];
        let kind = node.attribute("type").unwrap_or_default();
        let motion = match kind {
            "revolute" | "continuous" => Motion::Turn,
            "prismatic" => Motion::Slide,
            "fixed" => Motion::Fixed,
            "floating" => Motion::Free,
            "ball" | "spherical" => Motion::Ball,
            _ => return Err(at(node, &unknown("an object", "joint type", kind, kinds))),
        };
        let dynamics = child(node, "dynamics");
        let resistance = |attribute| dynamics.map_or(Ok(None), |dynamics| number(dynamics, attribute));
        let joint = Joint {
            name: name.to_owned(),
            motion,
            parent: self.end(node, "parent")?,
            child: self.end(node, "child")?,
            parent_from_child: origin(node)?,
            anchor: Vector3::zeros(),
            axis: if matches!(motion, Motion::Turn | Motion::Slide) { self.axis(node, name)? } else { Vector3::x_axis() },
            limits: self.limits(node, name)?,
            endless: kind == "continuous",
            damping: resistance("damping")?,
            friction: resistance("friction")?,
        };
        self.joints.push(joint);
        Ok(())
    }

    fn axis(&mut self, node: Node<'_, '_>, name: &str) -> Result<Unit<Vector3<f64>>, String> {
        let element = child(node, "axis");
        let given = element.map_or(Ok(None), |axis| numbers(axis, "xyz", axis.attribute("xyz")))?;
        let Some(given) = given else {
            self.repairs.add(Quirk::Axis, name, "no axis: x, as the standard has it");
            return Ok(Vector3::x_axis());
        };
        let vector = Vector3::from(given);
        let axis = Unit::try_new_and_get(vector, 1e-9);
        let (axis, norm) =
            axis.ok_or_else(|| at(element.unwrap_or(node), &format!("the axis is {given:?}, expected a direction")))?;
        if (norm - 1.0).abs() > 1e-6 {
            self.repairs.add(Quirk::Axis, name, format!("an axis of length {norm:.4} brought to 1"));
        }
        Ok(axis)
    }

    /// Limits as they stand; infinite ones are kept, for they have a meaning of their own.
    fn limits(&mut self, node: Node<'_, '_>, name: &str) -> Result<Option<[f64; 2]>, String> {
        let Some(limit) = child(node, "limit") else { return Ok(None) };
        let moves = !matches!(node.attribute("type"), Some("fixed" | "floating"));
        if moves && ["effort", "velocity"].iter().any(|attribute| limit.attribute(*attribute).is_none()) {
            self.repairs.add(Quirk::IncompleteLimit, name, "a limit without effort or velocity, which objects need not have");
        }
        let bound = |attribute: &str| match limit.attribute(attribute) {
            None => Ok(None),
            Some(text) => {
                let value = text.trim().parse::<f64>().ok().filter(|value| !value.is_nan());
                value.map(Some).ok_or_else(|| at(limit, &format!("{attribute} is {}, expected a number", quoted(text))))
            }
        };
        // The standard's default is 0.
        Ok(match (bound("lower")?, bound("upper")?) {
            (None, None) => None,
            (lower, upper) => Some([lower.unwrap_or(0.0), upper.unwrap_or(0.0)]),
        })
    }
}
