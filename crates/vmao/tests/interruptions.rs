//! Kills, full disks, torn files and Ctrl-C through the real program: nothing that was finished is lost, nothing is run amiss.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod explorations;

use explorations::{answer, check_failure, explore, rounds, signal, vmao, words};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};
use vmao_core::random::Stream;

/// Kills an exploration of `trials` so many times at random moments, then lets it finish.
fn kill_and_resume(kills: u64, trials: u64, longest: Duration) {
    let directory = tempfile::tempdir().unwrap();
    let (whole, killed) = (directory.path().join("whole"), directory.path().join("killed"));
    let expected = answer(&explore(&whole, trials, 2, &[]).output().unwrap());
    let mut stream = Stream::new(2026, &[kills]);
    let begin = |killed: &Path| {
        // A kill before anything was written leaves nothing to resume.
        let more: &[&str] = if killed.join("run.json").exists() { &["--resume"] } else { &[] };
        explore(killed, trials, 2, more)
    };
    let (mut hits, mut finished) = (0, rounds(&whole).into_iter().take(0).collect());
    while hits < kills {
        let mut child = begin(&killed).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        thread::sleep(longest.mul_f64(stream.unit()));
        child.kill().unwrap();
        hits += u64::from(!child.wait().unwrap().success());
        let now = if killed.exists() { rounds(&killed) } else { finished };
        let whole = rounds(&whole);
        for (name, bytes) in &now {
            assert_eq!(bytes, &whole[name], "{name} is there, so it is whole");
        }
        if now.len() == whole.len() && hits < kills {
            // Finished early: take the last rounds away, so that the others still have something to kill.
            for name in now.keys().skip(now.len() / 2) {
                fs::remove_file(killed.join(name)).unwrap();
            }
        }
        finished = now;
    }
    assert_eq!(answer(&begin(&killed).output().unwrap()), expected);
    assert_eq!(rounds(&killed), rounds(&whole));
}

#[test]
fn an_exploration_killed_ten_times_ends_as_if_nothing_had_happened() {
    kill_and_resume(10, 10, Duration::from_millis(1500));
}

#[test]
#[ignore = "takes ten minutes; CONTRIBUTING.md says how to run it"]
fn an_exploration_killed_two_hundred_times_ends_as_if_nothing_had_happened() {
    kill_and_resume(200, 60, Duration::from_millis(4000));
}

/// Waits until `path` is there, as long as the program runs.
#[track_caller]
fn wait_for(path: &Path, child: &mut Child) {
    while !path.exists() {
        assert!(child.try_wait().unwrap().is_none(), "the program ended before {} was there", path.display());
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn two_processes_on_one_directory_refuse_each_other_and_a_killed_one_leaves_no_lock() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("data");
    let mut first = explore(&out, 4000, 2, &[]).spawn().unwrap();
    wait_for(&out.join("run.json"), &mut first);
    let before = fs::read(out.join("run.json")).unwrap();
    for more in [&["--resume"][..], &[]] {
        let second = explore(&out, 4000, 2, more).output().unwrap();
        check_failure(&second, 1, &["data: another process is writing this data set, expected to be alone"]);
    }
    assert_eq!(fs::read(out.join("run.json")).unwrap(), before, "the one that was refused has written nothing");
    first.kill().unwrap();
    first.wait().unwrap();
    let mut third = explore(&out, 4000, 2, &["--resume"]).spawn().unwrap();
    let done = rounds(&out).len() as u64;
    wait_for(&out.join(format!("trials-{:08}-{:08}.parquet", 2 * done, 2 * done + 1)), &mut third);
    third.kill().unwrap();
    third.wait().unwrap();
}

#[test]
fn there_must_be_something_to_resume_and_it_must_be_the_same_run() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("data");
    let resume = |more: &[&str]| explore(&out, 2, 2, &[&["--resume"], more].concat()).output().unwrap();
    check_failure(&resume(&[]), 2, &["data: nothing to resume: no `run.json`", "leave out --resume to begin one"]);
    assert!(!out.exists(), "a refusal leaves nothing behind");
    answer(&explore(&out, 2, 2, &[]).output().unwrap());
    check_failure(&resume(&["--seed", "7"]), 2, &["run.json", "a run with seed 0, expected 7"]);
    check_failure(&resume(&["--set", "goal.tilt_deg=3"]), 2, &["run.json", "a run with another configuration"]);
    check_failure(&explore(&out, 2, 2, &[]).output().unwrap(), 2, &["holds a data set", "--resume goes on with it"]);
    fs::rename(out.join("trials-00000000-00000001.parquet"), out.join("trials-00000001-00000002.parquet")).unwrap();
    check_failure(&resume(&[]), 2, &["trials-00000001-00000002.parquet: expected a round of this run"]);
}

#[test]
fn torn_flipped_and_lost_files_are_named_and_made_again() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("data");
    let expected = answer(&explore(&out, 4, 1, &[]).output().unwrap());
    let whole = rounds(&out);
    let path = |index: usize| out.join(format!("trials-{index:08}-{index:08}.parquet"));
    let bytes = fs::read(path(1)).unwrap();
    let mut flipped = bytes.clone();
    // The first column with its page's head. A flip in a page's statistics goes unnoticed, as no record depends on it.
    flipped[4..][..64].iter_mut().for_each(|byte| *byte ^= 0x10);
    let halves = [Vec::new(), bytes[..4].to_vec(), bytes[..bytes.len() / 2].to_vec(), bytes[..bytes.len() - 1].to_vec(), flipped];
    for damaged in halves {
        // The second of four, so that others follow that were drawn from its successes; and the last is lost altogether.
        fs::write(path(1), &damaged).unwrap();
        fs::remove_file(path(3)).unwrap();
        check_failure(
            &vmao(&["dataset", "stats", out.to_str().unwrap()]).output().unwrap(),
            2,
            &["trials-00000001-00000001.parquet: "],
        );
        let resumed = explore(&out, 4, 1, &["--resume"]).output().unwrap();
        let said = words(&resumed);
        assert!(
            said.contains("trials-00000001-00000001.parquet: ") && said.contains("repair: trials 1 to 1 run again"),
            "{said}"
        );
        assert_eq!(answer(&resumed), expected);
        assert_eq!(rounds(&out), whole);
        assert_eq!(fs::read(out.join(".trials-00000001-00000001.parquet.damaged")).unwrap(), damaged, "kept for a look");
    }
}

/// Runs out of room part-way: exit 1 naming the file, and what was finished is readable and can be gone on with.
fn check_full(full: &mut Command, out: &Path, cause: &str, make_room: impl FnOnce(&Path) -> PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let whole = directory.path().join("whole");
    let expected = answer(&explore(&whole, 12, 2, &["--set", "cameras.points=1024"]).output().unwrap());
    let output = full.output().unwrap();
    check_failure(&output, 1, &[".parquet: ", cause]);
    let (kept, whole) = (rounds(out), rounds(&whole));
    assert!(!kept.is_empty() && kept.len() < whole.len(), "{} of {} rounds", kept.len(), whole.len());
    assert!(kept.iter().all(|(name, bytes)| bytes == &whole[name]));
    assert!(vmao(&["dataset", "stats", out.to_str().unwrap()]).output().unwrap().status.success());
    let out = make_room(out);
    assert_eq!(answer(&explore(&out, 12, 2, &["--set", "cameras.points=1024", "--resume"]).output().unwrap()), expected);
    assert_eq!(rounds(&out), whole);
}

#[test]
#[ignore = "mounts a small file system: needs root"]
fn a_full_disk_ends_the_run_and_loses_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let mount = directory.path().to_str().unwrap();
    assert!(Command::new("mount").args(["-t", "tmpfs", "-o", "size=160k", "tmpfs", mount]).status().unwrap().success());
    let out = directory.path().join("data");
    let room = |out: &Path| {
        assert!(Command::new("mount").args(["-o", "remount,size=16m", mount]).status().unwrap().success());
        out.to_owned()
    };
    let mut full = explore(&out, 12, 2, &["--set", "cameras.points=1024"]);
    let result =
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| check_full(&mut full, &out, "No space left on device", room)));
    assert!(Command::new("umount").arg(mount).status().unwrap().success());
    result.unwrap();
}

#[test]
fn ctrl_c_says_what_is_kept_and_how_to_go_on() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("data");
    let mut child = explore(&out, 4000, 2, &[]).spawn().unwrap();
    wait_for(&out.join("trials-00000002-00000003.parquet"), &mut child);
    signal(&child, "INT");
    let stopped = child.wait_with_output().unwrap();
    check_failure(&stopped, 130, &["stopped: ", "are kept in", "--resume --out"]);
    assert!(stopped.stdout.is_empty(), "no answer was given");
    assert!(fs::read_dir(&out).unwrap().all(|entry| !entry.unwrap().file_name().to_str().unwrap().ends_with(".partial")));
    // The command it names works as it stands, and a scheduler's signal is heeded as well.
    let said = words(&stopped);
    let go_on = said.split('`').nth(1).unwrap().split(' ').skip(1).map(str::to_owned).collect::<Vec<_>>();
    let before = rounds(&out).len() as u64;
    let mut child = vmao(&go_on.iter().map(String::as_str).collect::<Vec<_>>()).spawn().unwrap();
    wait_for(&out.join(format!("trials-{:08}-{:08}.parquet", 2 * before, 2 * before + 1)), &mut child);
    signal(&child, "TERM");
    check_failure(&child.wait_with_output().unwrap(), 143, &["stopped: "]);
}

#[test]
fn ctrl_c_stops_demo_train_and_evaluate_too() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let (data, models, table) = (text(&at("data")), text(&at("models/top1")), text(&at("table")));
    answer(&explore(&at("data"), 4, 4, &["--set", "explore.radius=0.008"]).output().unwrap());
    let train = ["train", "--data", &data, "--model", "top1", "--out", &models, "--set"];
    let interrupt = |arguments: &[&str], begun: &Path, said: &[&str]| {
        let mut child = vmao(arguments).spawn().unwrap();
        wait_for(begun, &mut child);
        thread::sleep(Duration::from_millis(300));
        signal(&child, "INT");
        check_failure(&child.wait_with_output().unwrap(), 130, said);
    };
    let long = [&train[..], &["train.epochs=1000000"]].concat();
    interrupt(
        &long,
        &at("models/top1/grasp-0/model.safetensors"),
        &["stopped: the data set, 0 finished networks", "--resume --out"],
    );
    fs::remove_dir_all(&models).unwrap();
    assert!(vmao(&[&train[..], &["train.epochs=1"]].concat()).output().unwrap().status.success());
    let evaluate = ["evaluate", "--checkpoint", &models, "--trials", "100000", "--out", &table];
    interrupt(&evaluate, &at("table/models/top1/grasp-1/config.json"), &["stopped: finished trials are kept", "--resume"]);
    let demo = text(&at("demo"));
    let begun = at("demo/data/trials-00000000-00000015.parquet");
    interrupt(
        &["demo", "--out", &demo],
        &begun,
        &["stopped: ", "successes are kept in", "vmao explore --config", "--resume --out"],
    );
}
