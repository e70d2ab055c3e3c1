//! From a MuJoCo model to one object's links and joints.

use super::document::{Attributes, Element, Model, turn_z_to};
use crate::{
    description::{Description, Form, Geometry, Joint, Link, MAX_GEOMETRIES, MAX_LINKS, Motion},
    repairs::{Quirk, Repairs},
    xml::{at, list, numbers, parse},
};
use nalgebra::{Point3, Unit, Vector3};
use std::collections::BTreeSet;
use vmao_core::{
    geometry::Pose,
    wording::{listed, quoted, unknown},
};

/// Sections that say nothing of an object.
const SURROUNDINGS: [&str; 7] = ["compiler", "default", "asset", "worldbody", "option", "size", "visual"];

/// The description of the object in `text`: of the top body `body`, or of the only one that there is.
///
/// Fails with a place in the text and what was found there.
pub fn read(text: &str, body: Option<&str>) -> Result<Description, String> {
    let document = parse(text, "mujoco")?;
    if let Some(include) = document.descendants().find(|node| node.has_tag_name("include") || node.has_tag_name("attach")) {
        return Err(at(include, "other files are not included; write the model into one file first"));
    }
    let model = Model::new(&document)?;
    let top = top_body(&model, body)?;
    let mut reader = Reader { model, links: Vec::new(), joints: Vec::new(), geometries: 0, repairs: Repairs::default() };
    reader.object(top)?;
    let names = reader.model.root.children().filter(roxmltree::Node::is_element).map(|node| node.tag_name().name());
    let ignored: BTreeSet<&str> = names.filter(|name| !SURROUNDINGS.contains(name)).collect();
    for name in ignored {
        reader.repairs.add(Quirk::Ignored, name, "a section that an object has no place for");
    }
    let name = reader.model.root.attribute("model").unwrap_or(&reader.links[0].name).to_owned();
    Ok(Description { name, links: reader.links, joints: reader.joints, repairs: reader.repairs })
}

/// The index of the body in the world that is the object.
fn top_body(model: &Model<'_>, wanted: Option<&str>) -> Result<usize, String> {
    let tops: Vec<usize> = (0..model.bodies.len()).filter(|&body| model.bodies[body].parent.is_none()).collect();
    let name = |body: usize| model.bodies[body].node.attribute("name").unwrap_or_default();
    if let Some(wanted) = wanted {
        let found = tops.iter().copied().find(|&body| name(body) == wanted);
        let names = || listed(tops.iter().map(|&body| name(body)));
        return found.ok_or_else(|| format!("the world has no body {}; its bodies are: {}", quoted(wanted), names()));
    }
    match tops[..] {
        [top] => Ok(top),
        [] => Err("the world has no body, expected the object's".to_owned()),
        _ => {
            let names = listed(tops.iter().map(|&body| name(body)));
            Err(format!("the world has {} bodies, expected one object; choose one with --body: {names}", tops.len()))
        }
    }
}

struct Reader<'a> {
    model: Model<'a>,
    links: Vec<Link>,
    joints: Vec<Joint>,
    geometries: usize,
    repairs: Repairs,
}

impl Reader<'_> {
    /// Every body below `top` becomes a link; the world becomes one, too, for `top` to be joined to.
    fn object(&mut self, top: usize) -> Result<(), String> {
        self.links.push(Link { name: "world".to_owned(), ..Link::default() });
        let mut link_of = vec![None; self.model.bodies.len()];
        for body in top..self.model.bodies.len() {
            let parent = match self.model.bodies[body].parent {
                None if body == top => 0,
                None => continue,
                Some(parent) => match link_of[parent] {
                    None => continue,
                    Some(link) => link,
                },
            };
            link_of[body] = Some(self.body(body, parent)?);
        }
        for index in 0..self.model.elements.len() {
            let element = &self.model.elements[index];
            if let Some(link) = element.body.and_then(|body| link_of[body]) {
                self.element(index, link)?;
            }
        }
        Ok(())
    }

    /// The link of a body, with one more link for each joint beyond the first between it and its parent.
    fn body(&mut self, body: usize, parent: usize) -> Result<usize, String> {
        let node = self.model.bodies[body].node;
        let name = node.attribute("name").map_or_else(|| format!("body{body}"), str::to_owned);
        if self.links.iter().any(|link| link.name == name) {
            return Err(at(node, &format!("two bodies are named {}", quoted(&name))));
        }
        let joints: Vec<usize> = (0..self.model.elements.len())
            .filter(|&index| {
                let element = &self.model.elements[index];
                element.body == Some(body) && ["joint", "freejoint"].contains(&element.node.tag_name().name())
            })
            .collect();
        let mut parent = parent;
        let mut parent_from_child = self.model.bodies[body].parent_from_body;
        for (position, &index) in joints.iter().enumerate() {
            let last = position + 1 == joints.len();
            let link = if last { name.clone() } else { format!("{name}_helper{}", position + 1) };
            let child = self.add_link(link, node)?;
            let joint = self.joint(index, parent, child, parent_from_child)?;
            self.joints.push(joint);
            (parent, parent_from_child) = (child, Pose::identity());
        }
        if joints.is_empty() {
            let child = self.add_link(name.clone(), node)?;
            self.joints.push(Joint {
                name: format!("{name}_fixed"),
                motion: Motion::Fixed,
                parent,
                child,
                parent_from_child,
                anchor: Vector3::zeros(),
                axis: Vector3::z_axis(),
                limits: None,
                endless: false,
                damping: None,
                friction: None,
            });
            parent = child;
        }
        Ok(parent)
    }

    fn add_link(&mut self, name: String, node: roxmltree::Node<'_, '_>) -> Result<usize, String> {
        if self.links.len() == MAX_LINKS {
            return Err(at(node, &format!("more than {MAX_LINKS} bodies and joints")));
        }
        self.links.push(Link { name, ..Link::default() });
        Ok(self.links.len() - 1)
    }

    fn joint(&self, element: usize, parent: usize, child: usize, parent_from_child: Pose) -> Result<Joint, String> {
        let Element { node, attributes, body_from_frame, .. } = &self.model.elements[element];
        let get = |name: &str| attributes.get(name).copied();
        let number = |name: &str| numbers::<1>(*node, name, get(name)).map(|value| value.map(|[value]| value));
        let motion = match get("type").unwrap_or("hinge") {
            _ if node.has_tag_name("freejoint") => Motion::Free,
            "hinge" => Motion::Turn,
            "slide" => Motion::Slide,
            "ball" => Motion::Ball,
            "free" => Motion::Free,
            other => return Err(at(*node, &unknown("an object", "joint type", other, ["hinge", "slide", "ball", "free"]))),
        };
        let axis = Vector3::from(numbers(*node, "axis", get("axis"))?.unwrap_or([0.0, 0.0, 1.0]));
        let axis = axis.try_normalize(1e-9).ok_or_else(|| at(*node, "axis is zero"))?;
        let anchor = Point3::from(numbers(*node, "pos", get("pos"))?.unwrap_or([0.0; 3]));
        let range: Option<[f64; 2]> = numbers(*node, "range", get("range"))?;
        let limited = match get("limited").unwrap_or("auto") {
            "true" => true,
            "false" => false,
            _ => self.model.autolimits && range.is_some(),
        };
        let turns = matches!(motion, Motion::Turn | Motion::Ball);
        let unit = if turns { self.model.angle_unit() } else { 1.0 };
        // The model is drawn with the joint at its reference, which is zero for us.
        let reference = if motion == Motion::Ball { 0.0 } else { number("ref")?.unwrap_or(0.0) };
        let limits = range.filter(|_| limited).map(|range| range.map(|value| (value - reference) * unit));
        Ok(Joint {
            name: node.attribute("name").map_or_else(|| format!("{}_joint", self.links[child].name), str::to_owned),
            motion,
            parent,
            child,
            parent_from_child,
            anchor: (body_from_frame * anchor).coords,
            axis: Unit::new_normalize(body_from_frame * axis),
            limits,
            endless: !limited,
            damping: number("damping")?,
            friction: number("frictionloss")?,
        })
    }

    fn element(&mut self, index: usize, link: usize) -> Result<(), String> {
        let Element { node, attributes, body_from_frame, .. } = &self.model.elements[index];
        let get = |name: &str| attributes.get(name).copied();
        if node.has_tag_name("inertial") {
            let mass = numbers::<1>(*node, "mass", get("mass"))?.map(|[mass]| mass);
            self.links[link].mass = mass.filter(|mass| *mass > 0.0);
            return Ok(());
        }
        if !node.has_tag_name("geom") {
            return Ok(());
        }
        self.geometries += 1;
        if self.geometries > MAX_GEOMETRIES {
            return Err(at(*node, &format!("more than {MAX_GEOMETRIES} geoms")));
        }
        let Some((form, placement)) = form(&self.model, *node, attributes)? else {
            let kind = get("type").unwrap_or("sphere");
            self.repairs.add(Quirk::Ignored, kind, "a geom of a kind that an object has no place for");
            return Ok(());
        };
        let geometry = Geometry {
            name: node.attribute("name").map(str::to_owned),
            link_from_geometry: body_from_frame * placement,
            form,
            color: self.model.color(*node, attributes)?,
            texture: self.model.texture(attributes).map(|path| path.to_string_lossy().into_owned()),
        };
        let never = |name: &str| get(name) == Some("0");
        let collides = !(never("contype") && never("conaffinity"));
        let mass = numbers::<1>(*node, "mass", get("mass"))?.map(|[mass]| mass).filter(|mass| collides && *mass > 0.0);
        let target = &mut self.links[link];
        if let Some(mass) = mass {
            target.mass = Some(target.mass.unwrap_or(0.0) + mass);
        }
        if collides {
            target.collisions.push(geometry);
        } else {
            target.visuals.push(geometry);
        }
        Ok(())
    }
}

/// What a geom is, and where; none of a kind that is of no use.
fn form<'a>(
    model: &Model<'a>,
    node: roxmltree::Node<'a, 'a>,
    attributes: &Attributes<'a>,
) -> Result<Option<(Form, Pose)>, String> {
    let get = |name: &str| attributes.get(name).copied();
    let kind = get("type").unwrap_or("sphere");
    if kind == "mesh" {
        let name = get("mesh").ok_or_else(|| at(node, "mesh is missing"))?;
        let asset = model.mesh(node, name)?;
        let form = Form::Mesh { file: asset.file.to_string_lossy().into_owned(), scale: asset.scale };
        return Ok(Some((form, model.placement(node, attributes)?)));
    }
    let needed = match kind {
        "sphere" => 1,
        "capsule" | "cylinder" => 2,
        "box" | "ellipsoid" => 3,
        "plane" | "hfield" | "sdf" => return Ok(None),
        other => {
            let kinds = ["sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh"];
            return Err(at(node, &unknown("an object", "geom type", other, kinds)));
        }
    };
    if attributes.contains_key("mesh") {
        return Err(at(node, "a solid fitted to a mesh is not understood"));
    }
    let ends: Option<[f64; 6]> = numbers(node, "fromto", get("fromto"))?.filter(|_| kind != "sphere");
    let needed = if ends.is_some() { 1 } else { needed };
    let mut size = list(node, "size", get("size").unwrap_or_default(), 3, "at most 3 numbers")?;
    if size.len() < needed || size[..needed].iter().any(|x| *x <= 0.0) {
        return Err(at(node, &format!("size is {size:?}, expected {needed} numbers above 0")));
    }
    let mut placement = attributes.clone();
    placement.remove("fromto");
    let mut placement = model.placement(node, &placement)?;
    if let Some([a, b, c, d, e, f]) = ends {
        let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
        let direction = (from - to).try_normalize(1e-9).ok_or_else(|| at(node, "both ends of fromto are the same"))?;
        placement = Pose::from_parts(((from + to) / 2.0).into(), turn_z_to(&direction));
        // With fromto a box and an ellipsoid have one size for x and y; the last one is half the distance.
        let half_length = (from - to).norm() / 2.0;
        size =
            if ["box", "ellipsoid"].contains(&kind) { vec![size[0], size[0], half_length] } else { vec![size[0], half_length] };
    }
    let form = match kind {
        "sphere" => Form::Ellipsoid { radii: [size[0]; 3] },
        "capsule" => Form::Capsule { radius: size[0], half_length: size[1] },
        "cylinder" => Form::Cylinder { radius: size[0], half_length: size[1] },
        "box" => Form::Box { half_extents: [size[0], size[1], size[2]] },
        _ => Form::Ellipsoid { radii: [size[0], size[1], size[2]] },
    };
    Ok(Some((form, placement)))
}
