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
}
