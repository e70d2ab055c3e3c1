//! The catalogue: articulated objects generated from parameters, with a few demonstrated ways to hold them.

mod cabinet;
mod drawer;
mod eyeglasses;
mod kit;
mod laptop;
mod levers;
mod lid;
mod lidded_box;
mod pliers;
mod scissors;
mod stapler;
mod sticks;

use crate::{
    contact::{ContactTuple, PartId},
    object::ArticulatedObject,
    robots::Gripper,
};

/// A catalogue object of one size, with its demonstrations.
#[derive(Debug, Clone, PartialEq)]
pub struct CatalogueItem {
    /// The object.
    pub object: ArticulatedObject,
    /// Demonstrated contact tuples (Algorithm 1's D): one contact per part, in the order of the parts.
    pub demonstrations: Vec<ContactTuple>,
}

/// A part that no demonstration shows how to hold with some gripper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// The part.
    pub part: PartId,
    /// Least and greatest width at which the demonstrations hold it (m).
    pub widths: [f64; 2],
}

/// A gripper must open wider than what it takes by this much on both sides together (m) ...
const CLEARANCE: f64 = 0.006;
/// ... and have this much left to close (m), or it cannot press.
const SQUEEZE: f64 = 0.0005;

/// Least and greatest width that `gripper` can take and press on (m).
pub fn widths_held(gripper: &Gripper) -> [f64; 2] {
    [gripper.closed_gap + SQUEEZE, gripper.max_opening() - CLEARANCE]
}

impl CatalogueItem {
    /// The parts that `gripper` cannot hold in any demonstrated way; none if the object suits it.
    pub fn misfits(&self, gripper: &Gripper) -> Vec<Misfit> {
        let [least, greatest] = widths_held(gripper);
        let misfit = |part: PartId| {
            let contacts = self.demonstrations.iter().flatten().filter(|contact| contact.part == part);
            let widths: Vec<f64> = contacts.map(crate::contact::Contact::width).collect();
            let extremes = [widths.iter().copied().fold(f64::INFINITY, f64::min), widths.iter().copied().fold(0.0, f64::max)];
            let held = widths.iter().any(|width| (least..=greatest).contains(width));
            (!held).then_some(Misfit { part, widths: extremes })
        };
        (0..self.object.parts.len()).filter_map(|part| misfit(PartId(part as u16))).collect()
    }
}

/// Which sizes of an object: those to explore and train on, or those kept back for evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InstanceSet {
    /// Sizes seen in training.
    Train,
    /// Sizes never explored.
    HeldOut,
}

/// Names of all catalogue objects.
pub const NAMES: [&str; 16] = [
    "pliers",
    "scissors",
    "stapler",
    "laptop",
    "lidded-box",
    "eyeglasses",
    "drawer",
    "cabinet",
    "three-sticks",
    "three-sticks-chain",
    "sticks-1",
    "sticks-2",
    "sticks-3",
    "sticks-4",
    "sticks-5",
    "sticks-6",
];

/// How many sizes each instance set has.
pub const INSTANCES: u16 = 6;

/// The object `name` in its `instance`-th size of `set`, if the name is known; instances wrap around at [`INSTANCES`].
pub fn item(name: &str, set: InstanceSet, instance: u16) -> Option<CatalogueItem> {
    let instance = instance % INSTANCES;
    let generate = match name {
        "pliers" => pliers::item,
        "scissors" => scissors::item,
        "stapler" => stapler::item,
        "laptop" => laptop::item,
        "lidded-box" => lidded_box::item,
        "eyeglasses" => eyeglasses::item,
        "drawer" => drawer::item,
        "cabinet" => cabinet::item,
        "three-sticks" => return Some(sticks::star(name, 3, set, instance)),
        "three-sticks-chain" => return Some(sticks::chain(name, set, instance)),
        _ => {
            let count = name.strip_prefix("sticks-")?.parse().ok()?;
            // As listed: `sticks-03` is no name.
            return NAMES.contains(&name).then(|| sticks::star(name, count, set, instance));
        }
    };
    Some(generate(set, instance))
}
