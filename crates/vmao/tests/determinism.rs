//! The same seed gives the same bytes with one worker and with two: data set, weights, maps, results, motions with forces.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

fn vmao(arguments: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_vmao")).args(arguments).output().unwrap();
    assert!(output.status.success(), "vmao {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Runs the loop at its smallest into `directory` and returns the answer of `explore`.
fn run_loop(directory: &Path, workers: &str, seed: &str) -> String {
    let at = |name: &str| directory.join(name).to_str().unwrap().to_owned();
    let (data, models, table) = (at("data"), at("models"), at("table"));
    let common = ["--workers", workers, "--seed", seed, "--json", "--set", "train.epochs=2", "--set", "explore.round_size=8"];
    let both = "explore.orders=[\"sequential\",\"parallel\"]";
    let with = |first: &[&str]| vmao(&[first, &common].concat());
    let explored = with(&["explore", "--successes", "6", "--max-trials", "24", "--set", both, "--out", &data]);
    for model in ["vmao", "top1"] {
        with(&["train", "--data", &data, "--model", model, "--out", &format!("{models}/{model}")]);
    }
    with(&["evaluate", "--checkpoint", &models, "--trials", "2", "--out", &table]);
    let (checkpoint, sample) = (format!("{models}/vmao"), at("sample"));
    with(&["sample", "--checkpoint", &checkpoint, "--samples", "2", "--scenes", "1", "--out", &sample]);
    String::from_utf8(explored.stdout).unwrap()
}

#[test]
fn one_worker_and_two_write_the_same_bytes() {
    let directory = tempfile::tempdir().unwrap();
    let (one, two) = (directory.path().join("one"), directory.path().join("two"));
    let answer = run_loop(&one, "1", "3");
    assert_eq!(answer, run_loop(&two, "2", "3"));
    assert!(answer.contains("\"digest\":"), "{answer}");
    let mut files =
        ["table/results.json", "table/trials.jsonl", "table/rollouts/sequential-vmao-0.json"].map(str::to_owned).to_vec();
    for model in ["vmao", "top1"] {
        files.push(format!("models/{model}/training.jsonl"));
        for grasp in ["grasp-0", "grasp-1"] {
            files.push(format!("models/{model}/{grasp}/model.safetensors"));
        }
    }
    let maps = ["sample/maps/scene-0-grasp-1-code-0.ply", "sample/maps/scene-0-grasp-1-code-1.ply"];
    assert_ne!(fs::read(one.join(maps[0])).unwrap(), fs::read(one.join(maps[1])).unwrap(), "another code, another map");
    files.extend(maps.map(str::to_owned));
    for file in files {
        assert_eq!(fs::read(one.join(&file)).unwrap(), fs::read(two.join(&file)).unwrap(), "{file}");
    }
    let explore = |name: &str, seed: &str| {
        let out = directory.path().join(name);
        let first =
            ["explore", "--successes", "6", "--max-trials", "8", "--json", "--seed", seed, "--out", out.to_str().unwrap()];
        String::from_utf8(vmao(&first).stdout).unwrap()
    };
    assert_ne!(explore("a", "3"), explore("b", "4"), "another seed explores otherwise");
}

#[test]
fn an_exploration_that_is_resumed_ends_with_the_digest_of_an_undisturbed_one() {
    let directory = tempfile::tempdir().unwrap();
    let explore = |name: &str, more: &[&str]| {
        let out = directory.path().join(name);
        let first = ["explore", "--successes", "99", "--max-trials", "12", "--json", "--out", out.to_str().unwrap()];
        let arguments: Vec<&str> = first.iter().chain(&["--set", "explore.round_size=4"]).chain(more).copied().collect();
        String::from_utf8(vmao(&arguments).stdout).unwrap()
    };
    let whole = explore("whole", &[]);
    assert_eq!(explore("torn", &[]), whole);
    // What a kill during the last round leaves: its file missing, a partial file beside.
    let torn = directory.path().join("torn");
    fs::rename(torn.join("trials-00000008-00000011.parquet"), torn.join(".trials-00000008-00000011.parquet.partial")).unwrap();
    assert_eq!(explore("torn", &["--resume"]), whole);
}
