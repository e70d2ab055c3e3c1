//! Names that are safe in every document, path and terminal, and unique.

use crate::{
    repairs::{Quirk, Repairs},
    source::Source,
    structure::Structure,
};
use vmao_core::wording::quoted;

/// The longest name.
const MAX_NAME: usize = 64;

/// The names of parts and joints, in order.
pub(super) struct Names {
    pub(super) parts: Vec<String>,
    pub(super) joints: Vec<String>,
}

/// Letters, digits, `-`, `_` and `.` stay; anything else becomes `_`.
fn safe(name: &str, otherwise: &str) -> String {
    let letter = |letter: char| if letter.is_ascii_alphanumeric() || "-_.".contains(letter) { letter } else { '_' };
    let name: String = name.chars().take(MAX_NAME - 6).map(letter).collect();
    if name.is_empty() { otherwise.to_owned() } else { name }
}

/// The name, with a number if it is taken.
fn unique(name: String, taken: &[String]) -> String {
    if !taken.contains(&name) {
        return name;
    }
    let numbered = |number: usize| format!("{name}-{number}");
    // Of one more name than are taken, one is free.
    (2..taken.len() + 3).map(numbered).find(|name| !taken.contains(name)).unwrap_or(name.clone())
}

/// The object's name.
pub(super) fn object(name: &str) -> String {
    safe(name, "object")
}

pub(super) fn names(structure: &Structure, source: &Source, repairs: &mut Repairs) -> Names {
    let mut names = Names { parts: Vec::new(), joints: Vec::new() };
    for (index, part) in structure.parts.iter().enumerate() {
        let wanted = source.name_of(&part.name, repairs).to_owned();
        let name = unique(safe(&wanted, &format!("part{index}")), &names.parts);
        said(&wanted, &name, repairs);
        names.parts.push(name);
    }
    for (index, joint) in structure.joints.iter().enumerate() {
        let name = unique(safe(&joint.name, &format!("joint{index}")), &names.joints);
        said(&joint.name, &name, repairs);
        names.joints.push(name);
    }
    names
}

fn said(wanted: &str, name: &str, repairs: &mut Repairs) {
    if wanted != name {
        repairs.add(Quirk::Name, wanted, format!("not usable everywhere, or used before: {}", quoted(name)));
    }
}
