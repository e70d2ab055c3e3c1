//! `reproduce` from nothing, killed again and again: the same table as if nothing had happened, for any number of workers.

mod explorations;

use explorations::{answer, check_failure, vmao};
use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Duration,
};
use vmao_core::random::Stream;

/// All stages with little to see, to learn and to try.
fn reproduce(out: &Path, workers: &str) -> Command {
    let mut command = vmao(&["reproduce", "--json", "--trials", "2", "--workers", workers]);
    for setting in [
        "cameras.width=64",
        "cameras.height=48",
        "cameras.points=256",
        "explore.successes=3",
        "explore.round_size=4",
        "train.epochs=1",
        "motion.max_steps=4000",
    ] {
        command.args(["--set", setting]);
    }
    command.arg("--out").arg(out);
    command
}

const LEFT: [&str; 4] = ["trials.jsonl", "results.json", "results.md", "report.html"];

#[test]
fn a_table_killed_again_and_again_is_the_same_table() {
    let directory = tempfile::tempdir().unwrap();
    let (whole, killed) = (directory.path().join("whole"), directory.path().join("killed"));
    let expected = answer(&reproduce(&whole, "2").output().unwrap());
    assert_eq!(expected["cells"].as_array().unwrap().len(), 9, "three methods in three orders");
    assert_eq!(expected["comparisons"].as_array().unwrap().len(), 9, "three pairs in three orders");
    let mut stream = Stream::new(7, &[]);
    for _ in 0..8 {
        let mut child = reproduce(&killed, "1").stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        thread::sleep(Duration::from_millis(4000).mul_f64(stream.unit()));
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert_eq!(answer(&reproduce(&killed, "1").output().unwrap()), expected);
    let left = |run: &Path, name: &str| fs::read_to_string(run.join(name)).unwrap();
    for name in &LEFT[..3] {
        assert_eq!(left(&killed, name), left(&whole, name), "{name}");
    }
    assert!(!killed.join("trials.partial.jsonl").exists());

    // A table whose last trials are missing, and half a line: only those run again.
    let lines = left(&whole, LEFT[0]);
    let (cut, name) = (lines.len() / 2, killed.join("trials.partial.jsonl"));
    fs::write(&name, &lines[..cut]).unwrap();
    assert_eq!(answer(&reproduce(&killed, "2").output().unwrap()), expected);
    assert_eq!(left(&killed, LEFT[0]), lines);

    // What is no line of this table is refused, and nothing is lost.
    fs::write(&name, "{}\n").unwrap();
    check_failure(&reproduce(&killed, "2").output().unwrap(), 2, &["trials.partial.jsonl: line 1: missing field"]);
    let other = lines.lines().next().unwrap().replacen("\"index\":0", "\"index\":77", 1) + "\n";
    fs::write(&name, other).unwrap();
    check_failure(&reproduce(&killed, "2").output().unwrap(), 2, &["kept trial 77 of ", "not of this table"]);
    let mut otherwise = reproduce(&killed, "2");
    check_failure(&otherwise.args(["--seed", "3"]).output().unwrap(), 2, &["a run with seed 0, expected 3"]);
    assert!(LEFT.iter().all(|name| killed.join(name).exists()));
}
