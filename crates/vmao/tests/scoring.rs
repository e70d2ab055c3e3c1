//! `vmao reference` and `vmao score` through the real program: any number of workers, any interruption, what they refuse.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

fn vmao(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vmao")).args(arguments).output().unwrap()
}

#[track_caller]
fn answer(arguments: &[&str]) -> String {
    let output = vmao(arguments);
    assert!(output.status.success(), "vmao {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Checks that the program refuses this input with exit code 2, this message and nothing on stdout.
#[track_caller]
fn refused(arguments: &[&str], message: &str) {
    let output = vmao(arguments);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && error.contains(message) && output.stdout.is_empty(), "{error}");
}

const SMALL: [&str; 6] = ["--set", "trial.order=parallel", "--set", "explore.round_size=2", "--set", "train.epochs=2"];

fn reference(out: &str, more: &[&str]) -> Vec<String> {
    let first = ["reference", "--scenes", "1", "--tries", "4", "--out", out, "--json"];
    first.iter().chain(&SMALL).chain(more).map(|word| (*word).to_owned()).collect()
}

fn with(words: &[String]) -> Vec<&str> {
    words.iter().map(String::as_str).collect()
}

/// Every file below a directory but those that say how it was made, with its bytes.
fn contents(directory: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![directory.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(directory).unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                open.push(path);
            } else if name != "run.json" {
                found.push((name, fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn references_and_scores_are_the_same_for_any_workers_and_after_an_interruption() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (one, two, models) = (at("one"), at("two"), at("models"));
    answer(&with(&reference(&one, &["--workers", "1"])));
    answer(&with(&reference(&two, &["--workers", "2"])));
    assert_eq!(contents(one.as_ref()), contents(two.as_ref()));
    // Another try of the same scene differs in its contacts only.
    let names: Vec<String> = contents(one.as_ref()).into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"held-out-000/trials-00000002-00000003.parquet".to_owned()), "{names:?}");
    // What a kill leaves behind is finished with --resume; without it, and under another configuration, nothing is touched.
    fs::remove_file(Path::new(&two).join("train-000/trials-00000002-00000003.parquet")).unwrap();
    let score = |reference: &str, out: &str, workers: &str| {
        let counts = "score.samples=[1, 2]";
        let first = ["score", "--models", &models, "--data", reference, "--out", out, "--workers", workers];
        let first: Vec<String> = first.iter().map(|word| (*word).to_owned()).collect();
        let more = ["--execute", "1", "--set", counts, "--set", "score.codes=4", "--set", "score.resamples=20"];
        first.into_iter().chain(more.map(str::to_owned)).collect::<Vec<String>>()
    };
    let data = at("data");
    let explore = ["explore", "--successes", "6", "--max-trials", "12", "--out", &data];
    answer(&explore.iter().chain(&SMALL).copied().collect::<Vec<&str>>());
    for model in ["vmao", "top1"] {
        let out = format!("{models}/{model}");
        let train = ["train", "--data", &data, "--model", model, "--out", &out];
        answer(&train.iter().chain(&SMALL).copied().collect::<Vec<&str>>());
    }
    refused(&with(&score(&two, &at("unfinished"), "1")), "--resume finishes it");
    refused(&with(&reference(&two, &[])), "--resume goes on with it");
    refused(&with(&reference(&two, &["--resume", "--seed", "1"])), "expected 1 to resume it");
    answer(&with(&reference(&two, &["--resume"])));
    assert_eq!(contents(one.as_ref()), contents(two.as_ref()));

    let table = answer(&with(&score(&one, &at("score-one"), "1")));
    assert_eq!(table, answer(&with(&score(&two, &at("score-two"), "2"))));
    for said in ["negative log-likelihood", "mode coverage", "calibration error", "executed: success", "grasp 2"] {
        assert!(table.contains(said), "{table}");
    }
    let (first, second) = (contents(at("score-one").as_ref()), contents(at("score-two").as_ref()));
    assert_eq!(first.iter().map(|(name, _)| name).collect::<Vec<_>>(), second.iter().map(|(name, _)| name).collect::<Vec<_>>());
    assert!(first == second, "the same bytes");
    let scores = first.iter().find(|(name, _)| name == "scores.json").unwrap();
    let scores: Value = serde_json::from_slice(&scores.1).unwrap();
    let rows = scores["rows"].as_array().unwrap();
    let number = |measure: &str, method: &str| {
        let row = rows.iter().find(|row| row["measure"] == measure && row["method"] == method && row["sizes"] == "both").unwrap();
        row["value"].as_f64().unwrap()
    };
    let nll = "negative log-likelihood (nats)";
    // 2048 points, two fingers: what every cloud of the default cameras gives a uniform map.
    assert!((number(nll, "uniform") - 2.0 * 2048.0_f64.ln()).abs() < 1e-9);
    assert!(number(nll, "uniform on the part") < number(nll, "uniform"));
    assert!((number(nll, "V-MAO, prior codes") - number(nll, "Top-1") - number(nll, "V-MAO, prior codes − Top-1")).abs() < 1e-9);
    assert!(first.iter().any(|(name, bytes)| name.ends_with("-grasp-2.svg") && bytes.starts_with(b"<svg")));
    refused(
        &["score", "--models", &format!("{models}/vmao"), &models, "--data", &one, "--out", &at("twice")],
        "another V-MAO model, expected one of each",
    );
    refused(&["score", "--models", &models, "--data", &data, "--out", &at("wrong")], "round of `vmao reference`");
}
