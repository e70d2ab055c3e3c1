//! What can be wrong with what is handed to this crate.

/// A configuration, dataset or checkpoint that cannot be used, or a training run that broke down.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A configuration value is outside what the network can be built or trained with.
    #[error("{field} is {found}; it must be {expected}")]
    Config {
        /// The field.
        field: String,
        /// Its value.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// The JSON beside a checkpoint cannot be read.
    #[error("the checkpoint's configuration cannot be read: {reason}")]
    ConfigJson {
        /// serde's words, with line and column.
        reason: String,
    },
    /// A training example cannot be used.
    #[error("training example {index}: {problem}")]
    Example {
        /// Which one, from zero.
        index: usize,
        /// What is wrong with it and what was expected.
        problem: String,
    },
    /// Too few examples to train and validate on.
    #[error("{found} training examples; at least {needed} are needed")]
    TooFewExamples {
        /// How many there are.
        found: usize,
        /// How many there must be.
        needed: usize,
    },
    /// The loss or a weight is no longer a number.
    #[error(
        "the {what} became {value} at step {step} (epoch {epoch}, {}, examples {}); a lower learning rate may help",
        batch.map_or("the validation after it".to_owned(), |batch| format!("batch {batch} of it")),
        listed(examples)
    )]
    Diverged {
        /// Loss or weight.
        what: String,
        /// The value met.
        value: f32,
        /// Optimiser steps done before.
        step: usize,
        /// Epoch, from one.
        epoch: usize,
        /// Batch of the epoch, from one; none for the validation after it.
        batch: Option<usize>,
        /// The examples of the batch, from zero.
        examples: Vec<usize>,
    },
    /// The device that trains failed.
    #[error("the {device} device failed: {reason}; train on the CPU, or with smaller batches if it ran out of memory")]
    Device {
        /// Its name.
        device: String,
        /// The first line of what it said.
        reason: String,
    },
    /// A checkpoint or a training state of something else than what is asked for.
    #[error("{what} has {field} = {found}, expected {expected} as {whose} says")]
    Differs {
        /// Which of the two.
        what: &'static str,
        /// The first value that differs.
        field: String,
        /// Its value.
        found: String,
        /// What it should be.
        expected: String,
        /// Where that stands.
        whose: &'static str,
    },
    /// A file whose content is not what was once written.
    #[error(
        "the file was changed after it was written: its content has the digest {found}, expected {expected} as it says itself"
    )]
    Altered {
        /// Digest of what is there.
        found: String,
        /// Digest that the file states.
        expected: String,
    },
    /// Weights were asked for before the first epoch.
    #[error("nothing was trained yet, expected at least one epoch")]
    NothingToSave,
    /// The bytes are not a safetensors file.
    #[error("not a readable safetensors file of {bytes} bytes: {reason}")]
    NotSafetensors {
        /// Length of what was given.
        bytes: usize,
        /// What the reader met.
        reason: String,
    },
    /// The set of tensors is not the network's.
    #[error("the checkpoint has no tensor `{name}`; it has: {available}")]
    MissingTensor {
        /// The tensor that the configuration asks for.
        name: String,
        /// Those that are there.
        available: String,
    },
    /// A tensor that the network does not have.
    #[error("the checkpoint has a tensor `{name}` that a {kind} does not have")]
    UnknownTensor {
        /// Its name.
        name: String,
        /// What the file should hold.
        kind: String,
    },
    /// A tensor of the wrong shape or element type.
    #[error("tensor `{name}` is {found}; expected {expected}")]
    TensorShape {
        /// Its name.
        name: String,
        /// Element type and shape found.
        found: String,
        /// Element type and shape expected.
        expected: String,
    },
    /// A tensor with a value that cannot be used.
    #[error("tensor `{name}` holds {value} at element {element}; expected {expected}")]
    TensorValue {
        /// Its name.
        name: String,
        /// The value.
        value: f32,
        /// Where, in row-major order.
        element: usize,
        /// What values it may hold.
        expected: String,
    },
    /// A cloud or latent code that the network cannot take.
    #[error("{what}: found {found}, expected {expected}")]
    Input {
        /// Which input.
        what: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
}

/// Numbers, comma-separated.
fn listed(numbers: &[usize]) -> String {
    numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}
