//! The committed corpus of the fuzzers, replayed on the stable compiler.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::{fs, path::Path};
use vmao_import::readers;

/// Runs every file of a target's corpus, and every cut of it at an eighth, through the target's reader.
fn replay(target: &str, reader: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target);
    let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 4, "{target} has only {} files", files.len());
    for file in files {
        let bytes = fs::read(file).unwrap();
        (0..=8).for_each(|eighth| reader(&bytes[..bytes.len() * eighth / 8]));
    }
}

#[test]
fn urdf_corpus() {
    replay("urdf", readers::urdf);
}

#[test]
fn mjcf_corpus() {
    replay("mjcf", readers::mjcf);
}

#[test]
fn mesh_corpus() {
    replay("mesh", readers::mesh);
}

#[test]
fn json_corpus() {
    replay("json", readers::json);
}
