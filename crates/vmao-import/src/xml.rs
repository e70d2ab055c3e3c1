//! XML that others wrote: bounded in size, elements and nesting; every refusal says where in the text it is.

use nalgebra::{UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};
use vmao_core::wording::{Place, quoted};

/// The largest document that is read (bytes).
pub const MAX_BYTES: u64 = 4 << 20;
const MAX_NODES: u32 = 100_000;
const MAX_DEPTH: usize = 100;
/// No length (m), factor or angle of an object or a robot is beyond it.
pub const MAX_NUMBER: f64 = 1e4;

/// DTDs, and with them entities, are refused.
fn document(text: &str) -> Result<Document<'_>, String> {
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| format!("not XML: {error}"))
}

/// The name of the root element.
pub fn root_name(text: &str) -> Result<String, String> {
    document(text).map(|document| document.root_element().tag_name().name().to_owned())
}

/// The document, whose root element must have this name.
pub fn parse<'a>(text: &'a str, root: &str) -> Result<Document<'a>, String> {
    let document = document(text)?;
    let found = document.root_element().tag_name().name();
    if found != root {
        return Err(format!("the root element is {}, expected {}", quoted(found), quoted(root)));
    }
    // The XML reader does not recurse; what follows may.
    if let Some(deep) = document.descendants().find(|node| node.ancestors().nth(MAX_DEPTH).is_some()) {
        return Err(at(deep, &format!("more than {MAX_DEPTH} elements inside one another")));
    }
    Ok(document)
}

/// The message with the node's place and element.
pub fn at(node: Node<'_, '_>, message: &str) -> String {
    let place = Place::of(node.document().input_text().as_bytes(), node.range().start);
    let name = node.attribute("name").map_or_else(String::new, |name| format!(" {}", quoted(name)));
    format!("{place}: <{}>{name}: {message}", node.tag_name().name())
}

/// The `N` finite numbers of an attribute with this text; none if it is not there.
pub fn numbers<const N: usize>(node: Node<'_, '_>, name: &str, text: Option<&str>) -> Result<Option<[f64; N]>, String> {
    let Some(text) = text else { return Ok(None) };
    let values = list(node, name, text, N, &format!("{N} numbers"))?;
    values.try_into().map(Some).map_err(|_too_few: Vec<f64>| refusal(node, name, text, &format!("{N} numbers")))
}

/// At most `most` finite numbers of an attribute with this text.
pub(crate) fn list(node: Node<'_, '_>, name: &str, text: &str, most: usize, expected: &str) -> Result<Vec<f64>, String> {
    let read = |word: &str| word.parse::<f64>().ok().filter(|x| x.abs() <= MAX_NUMBER).ok_or(());
    // One more than expected is enough to see that there are too many.
    let values = text.split_whitespace().take(most + 1).map(read).collect::<Result<Vec<f64>, ()>>();
    match values {
        Ok(values) if values.len() <= most => Ok(values),
        _ => Err(refusal(node, name, text, expected)),
    }
}

fn refusal(node: Node<'_, '_>, name: &str, text: &str, expected: &str) -> String {
    at(node, &format!("{name} is {}, expected {expected} of at most {MAX_NUMBER}", quoted(text)))
}

/// Turns about the fixed x, then y, then z axis by these angles (rad): URDF's `rpy`.
pub(crate) fn roll_pitch_yaw([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
    let turn = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    turn(Vector3::z_axis(), yaw) * turn(Vector3::y_axis(), pitch) * turn(Vector3::x_axis(), roll)
}
