//! The canonical bytes of records and their SHA-256: an explicit little-endian layout, independent of the file format.
//!
//! Numbers are little-endian, lists and strings are preceded by their length as u64, poses are x y z qw qx qy qz.
//! A failed trial counts without its observations, as it is stored.

use super::columns::{label_code, order_name, pose_numbers};
use crate::provenance::hex;
use sha2::{Digest, Sha256};
use vmao_core::{geometry::Pose, record::TrialRecord};

/// Names the layout; a change of the layout changes every digest.
const LAYOUT: &[u8] = b"vmao records 1\n";

/// The digest of a data set: SHA-256 over the canonical bytes of its records, in index order.
pub fn digest<'a>(records: impl IntoIterator<Item = &'a TrialRecord>) -> String {
    let mut records: Vec<&TrialRecord> = records.into_iter().collect();
    records.sort_by_key(|record| record.index);
    let mut digester = Digester::new(records.len());
    for record in records {
        digester.add(record);
    }
    digester.finish()
}

/// The digest of records that are not all in memory at once.
#[derive(Debug)]
pub struct Digester(Canonical);

impl Digester {
    /// Of `count` records.
    pub fn new(count: usize) -> Self {
        let mut bytes = Canonical(Sha256::new_with_prefix(LAYOUT));
        bytes.count(count);
        Self(bytes)
    }

    /// The next record, in index order.
    pub fn add(&mut self, record: &TrialRecord) {
        self.0.record(record);
    }

    /// The digest of all that was added.
    pub fn finish(self) -> String {
        hex(&self.0.0.finalize())
    }
}

#[derive(Debug)]
struct Canonical(Sha256);

impl Canonical {
    fn count(&mut self, count: usize) {
        self.0.update((count as u64).to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.count(text.len());
        self.0.update(text.as_bytes());
    }

    fn numbers(&mut self, numbers: &[f64]) {
        self.count(numbers.len());
        for number in numbers {
            self.0.update(number.to_le_bytes());
        }
    }

    fn singles(&mut self, numbers: &[f32]) {
        self.count(numbers.len());
        for number in numbers {
            self.0.update(number.to_le_bytes());
        }
    }

    fn poses(&mut self, poses: &[Pose]) {
        self.count(poses.len());
        for pose in poses {
            self.numbers(&pose_numbers(pose));
        }
    }

    fn record(&mut self, record: &TrialRecord) {
        let TrialRecord { index, seed, order, start, goal, grasps, outcome, detail, steps, final_errors } = record;
        for number in [index, seed, steps] {
            self.0.update(number.to_le_bytes());
        }
        self.text(order_name(*order));
        self.text(outcome.name());
        self.text(detail);
        self.numbers(final_errors);
        self.poses(&start.world_from_parts);
        self.numbers(&start.joint_positions);
        self.0.update(goal.root.0.to_le_bytes());
        self.poses(&[goal.world_from_root]);
        self.numbers(&goal.joint_positions);
        self.count(grasps.len());
        for grasp in grasps {
            self.0.update(grasp.arm.0.to_le_bytes());
            self.0.update(grasp.contact.part.0.to_le_bytes());
            for finger in &grasp.contact.fingers {
                self.numbers(finger.coords.as_slice());
            }
            self.poses(&[grasp.world_from_part]);
            self.poses(grasp.world_from_gripper.as_slice());
            let seen = &grasp.observation;
            let length = if outcome.is_success() { seen.len() } else { 0 };
            self.singles(seen.points[..length].as_flattened());
            self.singles(seen.colors[..length].as_flattened());
            self.count(length);
            for label in &seen.labels[..length] {
                self.0.update(label_code(*label).to_le_bytes());
            }
        }
    }
}
