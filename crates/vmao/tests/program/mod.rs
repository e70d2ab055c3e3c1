//! The real program with a request on its standard input, for all commands that answer one.

use serde_json::Value;
use std::{
    io::Write,
    process::{Command, Output, Stdio},
};

/// Runs `vmao COMMAND - OPTIONS` on this request.
pub(crate) fn run(command: &str, options: &[&str], request: impl AsRef<[u8]>) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_vmao"))
        .args([command, "-"])
        .args(options)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A refusal may come before the whole request was read.
    drop(child.stdin.take().unwrap().write_all(request.as_ref()));
    child.wait_with_output().unwrap()
}

/// What the program answers; it must succeed without a word on stderr.
#[track_caller]
pub(crate) fn answer(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty());
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Checks that the program refuses its input or usage with this message and answers nothing; returns all it said.
#[track_caller]
pub(crate) fn check_refusal(output: Output, message: &str) -> String {
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(error.contains(message), "{error}");
    assert!(output.stdout.is_empty() && !error.contains("panicked"), "{error}");
    error
}
