//! Recorded trials run again: equal bit for bit, from the run and from the record alone; and any tampering is named.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod explorations;
mod page;

use explorations::{answer, check_failure, explore, vmao};
use serde_json::Value;
use std::{fs, path::Path, process::Output};
use vmao::{
    config::Config,
    dataset::{self, DatasetWriter},
    evaluation::TrialLine,
    learning::json_lines,
    replay::{difference, run_again},
};
use vmao_core::{outcome::TrialOutcome, random::Stream};
use vmao_sim::Recording;

fn verify(run: &Path, more: &[&str]) -> Output {
    vmao(&[&["verify", "--json", run.to_str().unwrap()], more].concat()).output().unwrap()
}

#[test]
fn an_exploration_runs_again_bit_for_bit_and_tampering_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let (out, forged) = (directory.path().join("data"), directory.path().join("forged"));
    let explored = answer(&explore(&out, 9, 3, &[]).output().unwrap());
    assert!(explored["successes"].as_u64().unwrap() < 9, "failures must run again as well");
    let verified = answer(&verify(&out, &["--trials", "100"]));
    assert_eq!((&verified["checked"], &verified["equal"]), (&9.into(), &9.into()));

    // Each record alone, without those before it.
    let config = Config::load(Some(&out.join("config.toml")), &[]).unwrap();
    let records = dataset::load(&out).unwrap();
    for record in &records {
        let again = run_again(&config, record, Recording::Off).unwrap().record;
        assert_eq!(difference(record, &again), None, "trial {}", record.index);
    }

    // A forger who keeps the digests right is found out by physics alone.
    type Forgery = fn(&mut vmao_core::record::TrialRecord);
    let success = records.iter().position(|record| record.outcome.is_success()).unwrap();
    let failure = records.iter().position(|record| !record.outcome.is_success()).unwrap();
    let forgeries: [(usize, &str, Forgery); 4] = [
        (success, "final_errors", |record| record.final_errors[0] *= 1.0 + f64::EPSILON),
        (success, "grasps[0].fingers", |record| record.grasps[0].contact.fingers[1].x += 1e-16),
        (failure, "outcome", |record| record.outcome = TrialOutcome::Failed(vmao_core::outcome::FailureStage::Timeout)),
        (success, "steps", |record| record.steps += 1),
    ];
    for (index, column, forge) in forgeries {
        let mut forged_records = records.clone();
        forge(&mut forged_records[index]);
        let writer = DatasetWriter::open(&forged).unwrap();
        for round in forged_records.chunks(3) {
            writer.write_round(round).unwrap();
        }
        for name in ["config.toml", "run.json"] {
            fs::copy(out.join(name), forged.join(name)).unwrap();
        }
        let output = verify(&forged, &["--trials", "9"]);
        check_failure(&output, 1, &[&format!("trial {index}: {column} was ")]);
        let counts: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(counts["checked"], 9);
        assert!(counts["equal"].as_u64().unwrap() < 9);
        let show = vmao(&["dataset", "show", forged.to_str().unwrap(), &index.to_string()]).output().unwrap();
        check_failure(&show, 1, &[&format!("trial {index} run again is another: {column} was ")]);
        drop(writer);
        fs::remove_dir_all(&forged).unwrap();
    }
}

#[test]
fn a_trial_is_shown_and_a_data_set_described() {
    let directory = tempfile::tempdir().unwrap();
    let (out, place) = (directory.path().join("data"), directory.path().join("shown"));
    let explored = answer(&explore(&out, 8, 4, &["--set", "explore.orders=[\"sequential\",\"parallel\"]"]).output().unwrap());
    let data = out.to_str().unwrap();
    let shown = answer(&vmao(&["dataset", "show", data, "3", "--json", "--out", place.to_str().unwrap()]).output().unwrap());
    assert_eq!(shown["equal"], true);
    let text = page::carried(&fs::read_to_string(place.join("report.html")).unwrap()).to_string();
    assert!(text.contains("Trial 3 of ") && text.contains("equal bit for bit"));
    check_failure(&vmao(&["dataset", "show", data, "8"]).output().unwrap(), 2, &["no trial 8; trials are 0 to 7"]);
    check_failure(&verify(directory.path(), &[]), 2, &["config.toml"]);

    let stats = answer(&vmao(&["dataset", "stats", data, "--json"]).output().unwrap());
    let records = dataset::load(&out).unwrap();
    let count =
        |keep: &dyn Fn(&vmao_core::record::TrialRecord) -> bool| records.iter().filter(|record| keep(record)).count() as u64;
    assert_eq!(
        (&stats["trials"], &stats["successes"], &stats["digest"]),
        (&8.into(), &explored["successes"], &explored["digest"])
    );
    let failed: u64 = stats["failures"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(failed, count(&|record| !record.outcome.is_success()));
    assert_eq!(stats["orders"]["parallel"]["trials"], 4);
    for key in ["coverage", "near_duplicates"] {
        assert_eq!(stats["acceptance"][key], explored[key], "counted from the records alone");
    }
    assert!(explored["coverage"].as_object().unwrap().values().any(|share| share.as_f64().unwrap() > 0.0));
    let parts = stats["parts"].as_array().unwrap();
    assert_eq!(parts.iter().map(|part| part["name"].as_str().unwrap()).collect::<Vec<_>>(), ["lever-a", "lever-b"]);
    for part in parts {
        assert_eq!(part["accepted"], explored["successes"]);
        let width = &part["width"];
        assert!(width["min"].as_f64().unwrap() > 0.0 && width["min"].as_f64() <= width["max"].as_f64());
    }
    let steps: Vec<u64> = records.iter().filter(|record| record.outcome.is_success()).map(|record| record.steps).collect();
    assert_eq!(stats["steps"]["max"].as_f64().unwrap() as u64, *steps.iter().max().unwrap());
    let table = String::from_utf8(vmao(&["dataset", "stats", data]).output().unwrap().stdout).unwrap();
    assert!(table.starts_with("8 trials, ") && table.contains("lever-b") && table.contains("part 1 width (mm)"), "{table}");
}

#[test]
fn an_evaluation_runs_again_bit_for_bit_and_a_changed_line_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    answer(&explore(&directory.path().join("data"), 4, 4, &["--set", "explore.radius=0.008"]).output().unwrap());
    let train = ["train", "--data", &at("data"), "--model", "vmao", "--set", "train.epochs=1", "--out", &at("models/vmao")];
    assert!(vmao(&train).output().unwrap().status.success());
    let evaluate = ["evaluate", "--checkpoint", &at("models"), "--trials", "2", "--json", "--out", &at("table")];
    answer(&vmao(&evaluate).output().unwrap());
    let table = directory.path().join("table");
    let verified = answer(&verify(&table, &["--trials", "3", "--seed", "5"]));
    assert_eq!((&verified["checked"], &verified["equal"]), (&3.into(), &3.into()));

    let path = table.join("trials.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    let lines: Vec<TrialLine> = json_lines(&path).unwrap();
    let steps = lines[1].steps;
    let forged = text.replacen(&format!("\"steps\":{steps}"), &format!("\"steps\":{}", steps + 1), 1);
    fs::write(&path, forged).unwrap();
    check_failure(
        &verify(&table, &["--trials", "9"]),
        1,
        &["trials.jsonl: vmao ", &format!("steps was {}, is {steps} now", steps + 1)],
    );

    // Whatever happens to a line, it is read as a line or refused with its number.
    let mut stream = Stream::new(1, &[]);
    let mut refused = 0;
    for _ in 0..400 {
        let mut bytes = text.clone().into_bytes();
        let place = stream.index(bytes.len());
        bytes[place] ^= 1 << stream.index(8);
        fs::write(&path, &bytes).unwrap();
        match json_lines::<TrialLine>(&path) {
            Ok(_) => {}
            Err(error) => {
                refused += 1;
                let error = error.to_string();
                assert!(error.contains("trials.jsonl: line ") || error.contains("not UTF-8"), "{error}");
            }
        }
    }
    assert!(refused > 100, "{refused} of 400 flips were noticed");
    fs::write(&path, "{}\n").unwrap();
    check_failure(&verify(&table, &[]), 2, &["trials.jsonl: line 1: missing field"]);
}
