//! The data set on disk: bit-exact, independent of how it was cut into files, and never trusted when it is read.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use nalgebra::Point3;
use std::{fs, path::Path};
use vmao::dataset::{DatasetWriter, RoundFile, digest, load, read_round, round_files, stored};
use vmao_core::{
    contact::{ArmId, Contact, PartId},
    geometry::{Pose, pose},
    object::{ObjectGoal, ObjectState},
    observation::{Observation, PointLabel},
    order::GraspOrder,
    outcome::{FailureStage, TrialOutcome},
    random::Stream,
    record::{GraspRecord, TrialRecord},
};

fn random_pose(stream: &mut Stream) -> Pose {
    let mut draw = || stream.normal();
    pose([draw(), draw(), draw()], [draw(), draw(), draw(), draw()])
}

fn record(index: u64) -> TrialRecord {
    let stream = &mut Stream::new(11, &[index]);
    let (parts, joints, points) = (3, 2, 5 + index as usize % 4);
    let outcome = match index % 3 {
        0 => TrialOutcome::Failed(FailureStage::ALL[index as usize % 7]),
        _ => TrialOutcome::Success,
    };
    let grasp = |stream: &mut Stream, arm: u16| GraspRecord {
        arm: ArmId(arm),
        contact: Contact {
            part: PartId(2 - arm),
            fingers: [0, 1].map(|_| Point3::new(stream.normal(), stream.normal(), stream.normal())),
        },
        observation: Observation {
            points: (0..points).map(|_| [0; 3].map(|_| stream.normal() as f32)).collect(),
            colors: (0..points).map(|_| [0; 3].map(|_| stream.unit() as f32)).collect(),
            labels: (0..points).map(|i| [PointLabel::Table, PointLabel::Arm(1), PointLabel::Part(2)][i % 3]).collect(),
        },
        world_from_part: random_pose(stream),
        world_from_gripper: (arm == 0).then(|| random_pose(stream)),
    };
    TrialRecord {
        index,
        seed: 4,
        order: [GraspOrder::Sequential, GraspOrder::Parallel][index as usize % 2],
        start: ObjectState {
            world_from_parts: (0..parts).map(|_| random_pose(stream)).collect(),
            joint_positions: (0..joints).map(|_| stream.normal()).collect(),
        },
        goal: ObjectGoal {
            root: PartId(1),
            world_from_root: random_pose(stream),
            joint_positions: (0..joints).map(|_| stream.normal()).collect(),
        },
        // An early failure has no grasp at all.
        grasps: (0..(index % 4).min(2) as u16).map(|arm| grasp(stream, arm)).collect(),
        outcome,
        detail: if outcome.is_success() { String::new() } else { format!("pad 1 touched “nothing” in {index}") },
        steps: index * 1000,
        final_errors: [0.001, f64::INFINITY, -0.0, 0.002],
    }
}

fn records(count: u64) -> Vec<TrialRecord> {
    (0..count).map(record).collect()
}

fn write(directory: &Path, records: &[TrialRecord], round: usize) {
    let writer = DatasetWriter::open(directory).unwrap();
    for round in records.chunks(round) {
        writer.write_round(round).unwrap();
    }
}

#[test]
fn records_come_back_bit_for_bit_whatever_the_rounds() {
    let records = records(13);
    let expected: Vec<TrialRecord> = records.iter().cloned().map(stored).collect();
    for round in [1, 5, 13] {
        let directory = tempfile::tempdir().unwrap();
        write(directory.path(), &records, round);
        let loaded = load(directory.path()).unwrap();
        assert_eq!(loaded, expected);
        // Equality lets -0.0 be 0.0; the digest does not.
        assert_eq!(digest(&loaded), digest(&records));
    }
    // Failed trials were stored without what was seen, successes with it.
    assert!(
        expected
            .iter()
            .all(|record| record.grasps.iter().all(|grasp| record.outcome.is_success() != grasp.observation.is_empty()))
    );
}

#[test]
fn the_same_round_gives_the_same_file() {
    let bytes = || {
        let directory = tempfile::tempdir().unwrap();
        write(directory.path(), &records(6), 6);
        fs::read(directory.path().join("trials-00000000-00000005.parquet")).unwrap()
    };
    assert_eq!(bytes(), bytes());
}

#[test]
fn the_digest_sees_every_field_and_not_the_order_of_listing() {
    let base = records(6);
    let reversed: Vec<TrialRecord> = base.iter().rev().cloned().collect();
    assert_eq!(digest(&reversed), digest(&base));
    let changes: [fn(&mut TrialRecord); 16] = [
        |r| r.index += 100,
        |r| r.seed += 1,
        |r| r.order = GraspOrder::SequentialParallel,
        |r| r.start.world_from_parts[2].translation.x += 1e-12,
        |r| r.start.joint_positions[1] += 1e-12,
        |r| r.goal.root = PartId(0),
        |r| r.goal.world_from_root.rotation = r.start.world_from_parts[0].rotation,
        |r| r.goal.joint_positions[0] = -r.goal.joint_positions[0],
        |r| r.grasps[1].arm = ArmId(7),
        |r| r.grasps[0].contact.fingers.swap(0, 1),
        |r| r.grasps[1].world_from_gripper = Some(Pose::identity()),
        |r| r.grasps[0].observation.points[3][2] += 1.0,
        |r| r.grasps[0].observation.colors[0][0] /= 2.0,
        |r| r.grasps[0].observation.labels[0] = PointLabel::Arm(0),
        |r| r.detail.push('.'),
        |r| r.final_errors[2] = 0.0,
    ];
    let mut digests = vec![digest(&base)];
    for change in changes {
        let mut changed = base.clone();
        change(&mut changed[2]);
        digests.push(digest(&changed));
    }
    digests.push(digest(&base[..5]));
    let mut distinct = digests.clone();
    distinct.sort();
    distinct.dedup();
    assert_eq!(distinct.len(), digests.len());
}

#[test]
fn two_writers_refuse_each_other_and_leave_readers_alone() {
    let directory = tempfile::tempdir().unwrap();
    let first = DatasetWriter::open(directory.path()).unwrap();
    first.write_round(&records(2)).unwrap();
    let error = DatasetWriter::open(directory.path()).unwrap_err().to_string();
    assert!(error.ends_with("another process is writing this data set, expected to be alone"), "{error}");
    assert_eq!(load(directory.path()).unwrap().len(), 2);
    drop(first);
    DatasetWriter::open(directory.path()).unwrap();
}

#[test]
fn a_killed_writer_leaves_finished_rounds_only() {
    let directory = tempfile::tempdir().unwrap();
    write(directory.path(), &records(4), 2);
    let torn = directory.path().join(".trials-00000004-00000005.parquet.partial");
    fs::write(&torn, b"PAR1 torn").unwrap();
    assert_eq!(load(directory.path()).unwrap().len(), 4);
    let writer = DatasetWriter::open(directory.path()).unwrap();
    assert!(!torn.exists());
    let ranges: Vec<(u64, u64)> = writer.found_files().unwrap().iter().map(|file| (file.first, file.last)).collect();
    assert_eq!(ranges, [(0, 1), (2, 3)]);
    // The resumed run goes on where the finished rounds end, and the set is that of a run never killed.
    writer.write_round(&records(6)[4..]).unwrap();
    assert_eq!(digest(&load(directory.path()).unwrap()), digest(&records(6)));
}

#[track_caller]
fn check_refused(result: Result<impl std::fmt::Debug, vmao::dataset::DatasetError>, message: &str) {
    let error = result.unwrap_err().to_string();
    assert!(error.contains(message), "{error}");
}

#[test]
fn gaps_overlaps_and_stray_names_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    write(directory.path(), &records(6), 2);
    let [first, middle] = ["trials-00000000-00000001.parquet", "trials-00000002-00000003.parquet"];
    fs::rename(path(middle), path("aside")).unwrap();
    check_refused(round_files(directory.path()), "trials 2 to 3 are missing");
    fs::rename(path("aside"), path("trials-00000001-00000003.parquet")).unwrap();
    check_refused(round_files(directory.path()), "overlap, expected each trial once");
    fs::rename(path("trials-00000001-00000003.parquet"), path("trials-2-3.parquet")).unwrap();
    check_refused(
        round_files(directory.path()),
        "file `trials-2-3.parquet`, expected names like trials-00000000-00000015.parquet",
    );
    fs::remove_file(path("trials-2-3.parquet")).unwrap();
    // A file under another's name.
    fs::copy(path(first), path(middle)).unwrap();
    check_refused(load(directory.path()), "row 0, column index: 0, expected 2");
    fs::remove_file(path(middle)).unwrap();
    fs::rename(path(first), path("trials-00000000-00000003.parquet")).unwrap();
    check_refused(load(directory.path()), "2 rows, expected trials 0 to 3");
    check_refused(load(&path("nowhere")), "nowhere: ");
}

#[test]
fn rounds_that_are_none_are_refused_before_anything_is_written() {
    let directory = tempfile::tempdir().unwrap();
    let writer = DatasetWriter::open(directory.path()).unwrap();
    check_refused(writer.write_round(&[]), "a round of no trials");
    check_refused(writer.write_round(&[record(1), record(3)]), "expected consecutive trials of seed 4");
    type Change = fn(&mut TrialRecord);
    let invalid: [(Change, &str); 9] = [
        (|r| r.start.world_from_parts.clear(), "row 0, column start_parts: 0 part poses, expected 1 to 65535"),
        (|r| r.start.joint_positions[0] = f64::NAN, "column start_joints: NaN, expected a finite number"),
        (|r| r.goal.joint_positions.truncate(1), "column goal_joints: 1 positions, expected 2 as at the start"),
        (|r| r.goal.root = PartId(3), "column goal_root: part 3, expected one of 3 parts"),
        (|r| r.goal.world_from_root.translation.z = f64::INFINITY, "column goal_root_pose: inf, expected a finite number"),
        (|r| r.final_errors[0] = f64::NAN, "column final_errors: NaN, expected a size"),
        (|r| r.grasps[0].observation.colors[1][1] = 1.5, "column grasps.colors: 1.5, expected 0 to 1"),
        (|r| r.grasps[0].observation.labels.truncate(2), "column grasps.labels: 2 labels, expected one for each of 6 points"),
        (|r| r.grasps[0].observation.points[0][0] = f32::NAN, "column grasps.points: NaN, expected finite coordinates"),
    ];
    for (change, message) in invalid {
        let mut changed = record(1);
        change(&mut changed);
        check_refused(writer.write_round(&[changed]), message);
    }
    assert_eq!(round_files(directory.path()).unwrap(), []);
    writer.write_round(&[record(1)]).unwrap();
    check_refused(writer.write_round(&[record(1)]), "is there already");
}

#[test]
fn no_damage_is_read_as_data_or_gets_out_as_a_panic() {
    let directory = tempfile::tempdir().unwrap();
    write(directory.path(), &records(3), 3);
    let file = round_files(directory.path()).unwrap().remove(0);
    let (bytes, expected) = (fs::read(&file.path).unwrap(), read_round(&file).unwrap());
    let damaged = RoundFile { path: directory.path().join("damaged"), ..file };
    let check = |bytes: &[u8]| {
        fs::write(&damaged.path, bytes).unwrap();
        match read_round(&damaged) {
            // Bytes that carry no data, such as statistics, may differ.
            Ok(records) => assert_eq!(records, expected),
            Err(error) => assert!(error.to_string().contains("damaged: "), "{error}"),
        }
    };
    for end in (0..bytes.len()).step_by(97) {
        check(&bytes[..end]);
    }
    let mut stream = Stream::new(3, &[]);
    for offset in (0..bytes.len()).step_by(5) {
        let mut changed = bytes.clone();
        changed[offset] ^= 1 << stream.index(8);
        check(&changed);
    }
}
