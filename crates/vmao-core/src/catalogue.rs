//! The catalogue: articulated objects generated from parameters, with a few demonstrated ways to hold them.

mod pliers;

use crate::{contact::ContactTuple, object::ArticulatedObject};

/// A catalogue object of one size, with its demonstrations.
#[derive(Debug, Clone, PartialEq)]
pub struct CatalogueItem {
    /// The object.
    pub object: ArticulatedObject,
    /// Demonstrated contact tuples (Algorithm 1's D): one contact per part, in the order of the parts.
    pub demonstrations: Vec<ContactTuple>,
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
pub const NAMES: [&str; 1] = ["pliers"];

/// How many sizes each instance set has.
pub const INSTANCES: u16 = 6;

/// The object `name` in its `instance`-th size of `set`, if the name is known; instances wrap around at [`INSTANCES`].
pub fn item(name: &str, set: InstanceSet, instance: u16) -> Option<CatalogueItem> {
    match name {
        "pliers" => Some(pliers::item(set, instance % INSTANCES)),
        _ => None,
    }
}
