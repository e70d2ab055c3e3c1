//! Records the commit that is built, without failing where there is none, and finds the simulator library.

#[path = "../../tools/rpath.rs"]
mod rpath;

use std::{path::Path, process::Command};

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

fn main() {
    rpath::main();
    println!("cargo::rerun-if-changed=build.rs");
    // A source archive unpacked inside some other repository must not take that one's commit.
    let ours = git(&["ls-files", "--error-unmatch", "build.rs"]).is_some();
    let commit = if ours { git(&["rev-parse", "HEAD"]) } else { None };
    // The log of HEAD grows with every commit and checkout.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|log| Path::new(log).exists()) {
        println!("cargo::rerun-if-changed={log}");
    }
    println!("cargo::rustc-env=VMAO_COMMIT={}", commit.as_deref().unwrap_or("unknown"));
}
