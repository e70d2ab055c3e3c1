//! What can go wrong with a scene. A failed trial is not an error: it is an outcome.

/// Why a scene or a run could not be set up.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The simulator refused the model, or the compiled model is not what was written.
    #[error("the simulator refused the scene: {cause}")]
    Model {
        /// The simulator's words.
        cause: String,
    },
    /// The object's joints are not a tree over its parts.
    #[error("object `{name}`: {cause}")]
    Object {
        /// Which object.
        name: String,
        /// What is wrong with it.
        cause: vmao_core::object_graph::GraphError,
    },
    /// The robots cannot be shown with these meshes.
    #[error("meshes: {cause}")]
    Meshes {
        /// What was found and what was expected, or the simulator's words.
        cause: String,
    },
    /// The arms cannot be placed so.
    #[error("placement of the arms: {cause}")]
    Placement {
        /// What was found and what was expected.
        cause: String,
    },
    /// Fewer arms than parts.
    #[error("{arms} arms for {parts} parts of `{object}`; every part needs an arm of its own")]
    ArmCount {
        /// How many arms.
        arms: usize,
        /// How many parts.
        parts: usize,
        /// Which object.
        object: String,
    },
    /// The dependency root names no part.
    #[error("object `{object}` has no part `{name}`; a root is one of: first, auto, {}", parts.join(", "))]
    UnknownRoot {
        /// The name given.
        name: String,
        /// Which object.
        object: String,
        /// The names of its parts.
        parts: Vec<String>,
    },
}
