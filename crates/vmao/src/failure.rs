//! How a command ends without its result, and the exit code that says so.

use std::{
    cell::Cell,
    fmt,
    panic::{self, AssertUnwindSafe},
    process::ExitCode,
};

/// Why a command ended without its result.
///
/// `?` turns any error into [`Failure::Work`]; input is refused explicitly, with [`OrBadInput::or_bad_input`].
#[derive(Debug)]
pub enum Failure {
    /// The work failed: disk full, the simulator refused. Exit code 1.
    Work(anyhow::Error),
    /// Bad input or bad usage. Exit code 2.
    BadInput(anyhow::Error),
}

impl Failure {
    /// A refusal of what the user gave.
    pub fn bad_input(message: impl fmt::Display + fmt::Debug + Send + Sync + 'static) -> Self {
        Self::BadInput(anyhow::Error::msg(message))
    }

    /// The exit code that stands for this failure.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Work(_) => ExitCode::from(1),
            Self::BadInput(_) => ExitCode::from(2),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Work(error) | Self::BadInput(error) => write!(formatter, "{error:#}"),
        }
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Work(error.into())
    }
}

/// Marks an error as the fault of the input.
pub trait OrBadInput<T> {
    /// The value, or a failure with exit code 2.
    fn or_bad_input(self) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrBadInput<T> for Result<T, E> {
    fn or_bad_input(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::BadInput(error.into()))
    }
}

thread_local! {
    /// Whether a panic of this thread will be caught by [`contained`] and reported as an error.
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a foreign decoder that may panic on damaged input; none if it did.
pub(crate) fn contained<T>(decode: impl FnOnce() -> T) -> Option<T> {
    let before = CONTAINED.replace(true);
    // What the decoder half built is dropped with its closure, so nothing broken is seen afterwards.
    let result = panic::catch_unwind(AssertUnwindSafe(decode)).ok();
    CONTAINED.set(before);
    result
}

/// Keeps panics that end up as errors from printing; for the program, not for its library.
pub(crate) fn silence_contained_panics() {
    let report = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if !CONTAINED.get() {
            report(info);
        }
    }));
}
