//! How a stage of a trial ends early: the stage's name and why, in words. Recorded and counted, never raised.

use vmao_core::outcome::FailureStage;

/// The first stage that failed, and why.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Failure {
    pub(crate) stage: FailureStage,
    pub(crate) why: String,
}

impl Failure {
    pub(crate) fn new(stage: FailureStage, why: impl Into<String>) -> Self {
        Self { stage, why: why.into() }
    }
}
