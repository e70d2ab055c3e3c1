//! Training through the real program: kills, other runs, damaged files, losses that are no numbers, early ends, logs.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod explorations;
mod trainings;

use explorations::{answer, check_failure, signal, words};
use std::{fs, path::Path, process::Stdio, thread, time::Duration};
use trainings::{data, left, train};
use vmao::{learning::load, training_log::EpochLine};
use vmao_core::random::Stream;

/// Kills a training so many times at random moments, then lets it finish: it leaves what an undisturbed one leaves.
fn kill_and_resume(kills: u64, epochs: u32, longest: Duration) {
    let directory = tempfile::tempdir().unwrap();
    let (whole, killed) = (directory.path().join("whole"), directory.path().join("killed"));
    data(&directory.path().join("data"), 21);
    let expected = answer(&train(&whole, "vmao", epochs, &[]).output().unwrap());
    let mut stream = Stream::new(2027, &[kills]);
    let begin = || {
        let more: &[&str] = if killed.join("run.json").exists() { &["--resume"] } else { &[] };
        train(&killed, "vmao", epochs, more)
    };
    let mut hits = 0;
    while hits < kills {
        let mut child = begin().stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        thread::sleep(longest.mul_f64(stream.unit()));
        child.kill().unwrap();
        let hit = !child.wait().unwrap().success();
        hits += u64::from(hit);
        let weights = (0..2).map(|grasp| killed.join(format!("grasp-{grasp}/model.safetensors")));
        if weights.clone().all(|path| path.exists()) {
            assert_eq!(load(&killed, 2).unwrap().1.len(), 2, "what is there is whole");
        }
        if !hit && hits < kills {
            // Finished early: take a network away, so that there is something to kill.
            fs::remove_dir_all(killed.join(format!("grasp-{}", stream.index(2)))).unwrap();
        }
    }
    let mut resumed = answer(&begin().output().unwrap());
    assert_ne!(resumed["checkpoint"], expected["checkpoint"]);
    resumed["checkpoint"] = expected["checkpoint"].clone();
    assert_eq!(resumed, expected);
    let (whole, killed) = (left(&whole), left(&killed));
    assert_eq!(killed.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    for (name, bytes) in &whole {
        assert!(killed[name] == *bytes, "{name} differs");
    }
}

#[test]
fn a_training_killed_ten_times_ends_with_the_same_bytes_as_an_undisturbed_one() {
    kill_and_resume(10, 8, Duration::from_millis(1000));
}

#[test]
#[ignore = "takes minutes; CONTRIBUTING.md says how to run it"]
fn a_training_killed_sixty_times_ends_with_the_same_bytes_as_an_undisturbed_one() {
    kill_and_resume(60, 60, Duration::from_millis(2500));
}

fn lines(directory: &Path) -> Vec<EpochLine> {
    let text = fs::read_to_string(directory.join("training.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_finished_training_has_its_files_and_is_not_done_again_nor_overwritten() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("top1");
    data(&directory.path().join("data"), 9);
    let first = answer(&train(&out, "top1", 3, &[]).output().unwrap());
    let files = left(&out);
    let expected = ["config.json", "events.out.tfevents.0.vmao", "model.safetensors"];
    let named = ["grasp-0", "grasp-1"].iter().flat_map(|grasp| expected.map(|name| format!("{grasp}/{name}")));
    let named: Vec<String> =
        std::iter::once("config.toml".to_owned()).chain(named).chain(["training.jsonl".to_owned()]).collect();
    assert_eq!(files.keys().collect::<Vec<_>>(), named.iter().collect::<Vec<_>>());
    let lines = lines(&out);
    let order: Vec<(usize, usize)> = lines.iter().map(|line| (line.grasp, line.epoch)).collect();
    assert_eq!(order, [(0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)]);
    assert!(
        lines.iter().all(|line| line.gradient_norm > 0.0 && line.validation_reconstruction.is_some() && line.train_kl == 0.0)
    );
    assert_eq!(first["epochs"], 3);
    let best = first["validation"]["grasp-1"]["epoch"].as_u64().unwrap() as usize;
    let kept = lines.iter().find(|line| (line.grasp, line.epoch) == (1, best)).unwrap();
    assert_eq!(
        first["validation"]["grasp-1"]["reconstruction"].as_f64().unwrap() as f32,
        kept.validation_reconstruction.unwrap()
    );

    check_failure(&train(&out, "top1", 3, &[]).output().unwrap(), 2, &["top1: holds a training", "--resume goes on with it"]);
    assert_eq!(answer(&train(&out, "top1", 3, &["--resume"]).output().unwrap()), first);
    assert_eq!(left(&out), files);
}

#[test]
fn there_must_be_something_to_resume_and_it_must_be_the_same_training() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("net");
    data(&directory.path().join("data"), 9);
    let resume = |model: &str, more: &[&str]| train(&out, model, 2, &[&["--resume"], more].concat()).output().unwrap();
    check_failure(&resume("vmao", &[]), 2, &["net: nothing to resume: no `run.json`"]);
    assert!(!out.exists(), "a refusal leaves nothing behind");
    answer(&train(&out, "vmao", 2, &[]).output().unwrap());
    let files = left(&out);
    check_failure(&resume("vmao", &["--seed", "7"]), 2, &["a run with seed 0, expected 7"]);
    let other = resume("vmao", &["--set", "train.learning_rate=0.5", "--set", "network.head=8"]);
    check_failure(&other, 2, &["network.head is 32 there, 8 here, train.learning_rate is 0.01 there, 0.5 here"]);
    check_failure(&resume("top1", &[]), 2, &["grasp-0: the finished network has kind = \"vmao\", expected \"top1\""]);
    fs::remove_dir_all(directory.path().join("data")).unwrap();
    data(&directory.path().join("data"), 12);
    check_failure(&resume("vmao", &[]), 2, &["grasp-0: the finished network has origin.examples = 6, expected 8"]);
    assert_eq!(left(&out), files, "nothing was written");
}

/// Stops a long training of its first network with a signal; what it says.
fn stopped(out: &Path) -> String {
    let more = ["--set", "train.patience=0", "--set", "train.learning_rate=0.001"];
    let mut child = train(out, "vmao", 4000, &more).spawn().unwrap();
    while !out.join("grasp-0/model.safetensors").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the training ended before it could be stopped");
        thread::sleep(Duration::from_millis(5));
    }
    signal(&child, "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(130), 0));
    words(&output)
}

#[test]
fn ctrl_c_says_how_to_go_on_and_damaged_files_are_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("net");
    data(&directory.path().join("data"), 9);
    let said = stopped(&out);
    assert!(said.contains("stopped: the data set, 0 finished networks and ") && said.contains(" goes on"), "{said}");
    let go_on: Vec<&str> = said.split('`').nth(1).unwrap().split(' ').skip(1).collect();
    let resume = || explorations::vmao(&go_on).output().unwrap();
    let (state, log) = (out.join("grasp-0/state.safetensors"), out.join("training.jsonl"));
    let files = left(&out);
    let whole = fs::read(&state).unwrap();

    for damaged in [&whole[..whole.len() / 2], &[]] {
        fs::write(&state, damaged).unwrap();
        check_failure(
            &resume(),
            2,
            &["grasp-0/state.safetensors; without this file, --resume trains", "not a readable safetensors file"],
        );
    }
    let mut flipped = whole.clone();
    flipped[whole.len() - 9] ^= 4;
    fs::write(&state, &flipped).unwrap();
    check_failure(&resume(), 2, &["grasp-0/state.safetensors", "the file was changed after it was written"]);
    fs::write(&state, &whole).unwrap();
    fs::write(&log, "").unwrap();
    check_failure(&resume(), 2, &["training.jsonl: 0 lines of epoch 1 of grasp 0, expected one of each epoch from 1 to "]);
    fs::write(&log, "{\"grasp\":0}\n").unwrap();
    check_failure(&resume(), 2, &["training.jsonl: line 1: missing field `epoch`"]);
    // What a kill in the middle of a line leaves is no damage.
    fs::write(&log, [&files["training.jsonl"][..], b"{\"grasp\":0,\"ep"].concat()).unwrap();
    let mut child = explorations::vmao(&go_on).spawn().unwrap();
    let before = lines_before(&files["training.jsonl"]);
    while lines_before(&fs::read(&log).unwrap()) <= before {
        assert!(child.try_wait().unwrap().is_none(), "it goes on");
        thread::sleep(Duration::from_millis(5));
    }
    let second = explorations::vmao(&go_on).output().unwrap();
    check_failure(&second, 1, &["net: another process is training here, expected to be alone"]);
    signal(&child, "TERM");
    check_failure(&child.wait_with_output().unwrap(), 143, &["stopped: "]);
    let order: Vec<usize> = lines(&out).iter().map(|line| line.epoch).collect();
    assert!(order.iter().copied().eq(1..=order.len()), "{order:?}");
}

fn lines_before(text: &[u8]) -> usize {
    text.iter().filter(|&&byte| byte == b'\n').count()
}

#[test]
fn a_loss_that_is_no_number_names_step_batch_and_trials_and_overwrites_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("net");
    data(&directory.path().join("data"), 18);
    let output = train(&out, "vmao", 5, &["--set", "train.learning_rate=1e30"]).output().unwrap();
    check_failure(&output, 1, &["grasp 1 of V-MAO, 12 successful examples, here those of trials ", " became ", " at step "]);
    check_failure(&output, 1, &["(epoch 1, batch ", ", examples ", "a lower learning rate may help"]);
    let said = words(&output);
    let trials: Vec<u64> =
        said.split("of trials ").nth(1).unwrap().split(':').next().unwrap().split(", ").map(|n| n.parse().unwrap()).collect();
    assert!(
        !trials.is_empty() && trials.iter().all(|trial| trial % 3 != 1 && *trial < 18),
        "failed trials are not trained on: {said}"
    );
    assert!(!out.join("grasp-0/model.safetensors").exists() && !out.join("grasp-0/state.safetensors").exists());
    assert_eq!(fs::read(out.join("training.jsonl")).unwrap(), b"");
}

#[test]
fn a_training_in_vain_ends_early_and_says_so() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("net");
    data(&directory.path().join("data"), 9);
    let more = ["--set", "train.patience=2", "--set", "train.learning_rate=0.03"];
    let output = train(&out, "top1", 60, &more).output().unwrap();
    let answer = answer(&output);
    let said = words(&output);
    assert!(
        said.contains("Top-1, grasp 1: stopped early, after ") && said.contains(" of 60 epochs: no better validation loss for 2"),
        "{said}"
    );
    assert!(answer["epochs"].as_u64().unwrap() < 60);
    let events = fs::read(out.join("grasp-0/events.out.tfevents.0.vmao")).unwrap();
    let (mut at, mut frames) = (0, 0);
    while at < events.len() {
        at += 16 + u64::from_le_bytes(events[at..at + 8].try_into().unwrap()) as usize;
        frames += 1;
    }
    assert_eq!(frames, 1 + lines(&out).iter().filter(|line| line.grasp == 0).count(), "a version and one message an epoch");
    // The warm-up of a tenth of 60 epochs does not count.
    assert_eq!(answer["validation"]["grasp-0"]["epoch"].as_u64().unwrap().max(6) as usize + 2, frames - 1);
}
