//! Small explorations through the real program, for the tests that stop it, share it out and look at what it left.
#![allow(dead_code, reason = "each test binary uses its own share of this module")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use serde_json::Value;
use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
};

/// Little to see, so that trials are quick, and a radius at which some of them fail.
const QUICK: [&str; 10] = [
    "--set",
    "cameras.width=64",
    "--set",
    "cameras.height=48",
    "--set",
    "cameras.points=256",
    "--set",
    "explore.radius=0.02",
    "--set",
    "explore.successes=1000",
];

/// `vmao explore` of so many trials in rounds of so many, into `out`.
pub(crate) fn explore(out: &Path, trials: u64, round: u64, more: &[&str]) -> Command {
    let mut command = vmao(&["explore", "--json", "--max-trials", &trials.to_string()]);
    command.args(["--set", &format!("explore.round_size={round}"), "--out"]).arg(out).args(QUICK).args(more);
    command
}

pub(crate) fn vmao(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vmao"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// What the program answers; it must succeed.
#[track_caller]
pub(crate) fn answer(output: &Output) -> Value {
    assert!(output.status.success(), "{}", words(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What it says on stderr.
pub(crate) fn words(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Checks the exit code and that stderr says all of `expected`.
#[track_caller]
pub(crate) fn check_failure(output: &Output, code: i32, expected: &[&str]) {
    let said = words(output);
    assert_eq!(output.status.code(), Some(code), "{said}");
    for expected in expected {
        assert!(said.contains(expected), "`{expected}` is not in: {said}");
    }
    assert!(!said.contains("panicked"), "{said}");
}

/// Sends a signal to a process that this test started.
pub(crate) fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap().success());
}

/// The rounds of a data set: names and bytes.
pub(crate) fn rounds(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let named = files.map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), path));
    named.filter(|(name, _)| name.starts_with("trials-")).map(|(name, path)| (name, fs::read(path).unwrap())).collect()
}
