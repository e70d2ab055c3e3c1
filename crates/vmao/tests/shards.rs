//! Shards of one exploration, some of which never start, and their merge: byte for byte the data set of a single run.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod explorations;

use explorations::{answer, check_failure, explore, rounds, vmao};
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

fn merge(from: &Path, out: &Path) -> Output {
    let mut command: Command = vmao(&["dataset", "merge", "--json", "--out"]);
    command.arg(out).arg(from).output().unwrap()
}

#[test]
fn shards_of_which_one_never_starts_merge_into_the_single_run() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let whole = answer(&explore(&at("whole"), 14, 5, &[]).output().unwrap());
    assert!(whole["successes"].as_u64().unwrap() < 14, "some trials fail, so that the label set matters");

    // Two of three shards at a time, one counted from zero and one from one; the third never comes.
    let shard = |share: &str| explore(&at("shared"), 14, 5, &["--shard", share, "--workers", "1"]);
    let mut running = [shard("0/3").spawn().unwrap(), shard("2/3").spawn().unwrap()];
    let refused = loop {
        // As long as the first one runs, its place is taken.
        if at("shared/shard-0-of-3/run.json").exists() {
            break shard("3/3").output().unwrap();
        }
        assert!(running[0].try_wait().unwrap().is_none(), "the shard ended before it began");
    };
    assert!(matches!(refused.status.code(), Some(1 | 2)), "locked, or finished meanwhile");
    for child in running {
        assert_eq!(answer(&child.wait_with_output().unwrap()), whole, "every shard knows the whole");
    }
    assert_eq!(answer(&merge(&at("shared"), &at("merged"))), whole);
    assert_eq!(rounds(&at("merged")), rounds(&at("whole")));
    let exploration = |name: &str| fs::read_to_string(at(name).join("exploration.json")).unwrap();
    assert_eq!(exploration("merged"), exploration("whole"));
    assert_eq!(exploration("shared/shard-0-of-3"), exploration("whole"));
    // Once more into the same place changes nothing.
    assert_eq!(answer(&merge(&at("shared"), &at("merged"))), whole);

    // The shard that comes late finds all its trials run by others, and runs none.
    assert_eq!(answer(&shard("1/3").output().unwrap()), whole);
    assert!(rounds(&at("shared/shard-1-of-3")).is_empty());
}

#[test]
fn a_merge_says_whose_trials_are_missing_damaged_or_different() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let shard = |share: &str, more: &[&str]| {
        explore(&at("shared"), 4, 2, &[&["--shard", share, "--workers", "1"], more].concat()).output().unwrap()
    };
    // One alone runs everything: its own part of a round in one file, the other's trials in one each.
    let whole = answer(&shard("0/2", &[]));
    assert_eq!(answer(&shard("1/2", &[])), whole);
    let own = at("shared/shard-0-of-2");
    assert_eq!(rounds(&own).len(), 4);

    let last = own.join("trials-00000003-00000003.parquet");
    let bytes = fs::read(&last).unwrap();
    fs::remove_file(&last).unwrap();
    check_failure(
        &merge(&at("shared"), &at("merged")),
        2,
        &["missing: trials 3 to 3 of shard 1/2; `vmao explore --shard I/N --resume`"],
    );
    fs::write(&last, &bytes[..bytes.len() / 2]).unwrap();
    let torn = ["trials-00000003-00000003.parquet: not a Parquet file", "`vmao explore --shard 0/2 --resume` repairs it"];
    check_failure(&merge(&at("shared"), &at("merged")), 2, &torn);
    let repaired = shard("0/2", &["--resume"]);
    assert!(explorations::words(&repaired).contains("repair: trials 3 to 3 run again"), "{}", explorations::words(&repaired));
    assert_eq!(answer(&repaired), whole);
    assert_eq!(fs::read(&last).unwrap(), bytes);
    assert_eq!(answer(&merge(&at("shared"), &at("merged"))), whole);

    // A shard of another run in the same place.
    check_failure(
        &explore(&at("shared"), 4, 2, &["--shard", "1/2", "--resume", "--seed", "9"]).output().unwrap(),
        2,
        &["a run with seed 0, expected 9"],
    );
    let other = at("shared/shard-1-of-2/run.json");
    let text = fs::read_to_string(&other).unwrap().replace("\"seed\": 0", "\"seed\": 8");
    fs::write(&other, text).unwrap();
    check_failure(&merge(&at("shared"), &at("again")), 2, &["shard-1-of-2/run.json", "a run with seed 8, expected 0"]);
    check_failure(&merge(&at("nowhere"), &at("again")), 2, &["nowhere"]);
    for share in ["5/4", "0/0", "1", "-1/3", "1/5000", "a/b"] {
        check_failure(&explore(&at("none"), 4, 2, &[&format!("--shard={share}")]).output().unwrap(), 2, &["expected i/n"]);
    }
}
