//! What every record must be, whether it is about to be written or was just read: finite, complete, of matching lengths.

use super::DatasetError;
use std::path::Path;
use vmao_core::{contact::PartId, geometry::Pose, object_graph::MAX_PARTS, record::TrialRecord};

/// How far the norm of a stored quaternion may be from one.
const UNIT_TOLERANCE: f64 = 1e-6;

/// A value that no trial can have.
#[derive(Debug)]
pub(super) struct Invalid {
    pub(super) column: &'static str,
    pub(super) message: String,
}

impl Invalid {
    pub(super) fn at(self, file: &Path, row: usize) -> DatasetError {
        DatasetError::Value { file: file.to_owned(), row, column: self.column, message: self.message }
    }
}

fn invalid(column: &'static str, message: String) -> Result<(), Invalid> {
    Err(Invalid { column, message })
}

/// Refuses a record that could not have come from a trial.
pub(super) fn record(record: &TrialRecord) -> Result<(), Invalid> {
    let parts = record.start.world_from_parts.len();
    if parts == 0 || parts > MAX_PARTS {
        return invalid("start_parts", format!("{parts} part poses, expected 1 to {MAX_PARTS}"));
    }
    poses("start_parts", &record.start.world_from_parts)?;
    finite("start_joints", &record.start.joint_positions)?;
    let (start, goal) = (record.start.joint_positions.len(), record.goal.joint_positions.len());
    if start != goal {
        return invalid("goal_joints", format!("{goal} positions, expected {start} as at the start"));
    }
    part("goal_root", record.goal.root, parts)?;
    poses("goal_root_pose", &[record.goal.world_from_root])?;
    finite("goal_joints", &record.goal.joint_positions)?;
    for error in record.final_errors {
        // A part that fell off the world is infinitely far away; not a number is a bug.
        if error.is_nan() || error < 0.0 {
            return invalid("final_errors", format!("{error}, expected a size"));
        }
    }
    for grasp in &record.grasps {
        part("grasps.part", grasp.contact.part, parts)?;
        for finger in &grasp.contact.fingers {
            finite("grasps.fingers", finger.coords.as_slice())?;
        }
        poses("grasps.world_from_part", &[grasp.world_from_part])?;
        poses("grasps.world_from_gripper", grasp.world_from_gripper.as_slice())?;
        let seen = &grasp.observation;
        if seen.colors.len() != seen.points.len() {
            return invalid(
                "grasps.colors",
                format!("{} colours, expected one for each of {} points", seen.colors.len(), seen.len()),
            );
        }
        if seen.labels.len() != seen.points.len() {
            return invalid(
                "grasps.labels",
                format!("{} labels, expected one for each of {} points", seen.labels.len(), seen.len()),
            );
        }
        if let Some(value) = seen.points.as_flattened().iter().find(|value| !value.is_finite()) {
            return invalid("grasps.points", format!("{value}, expected finite coordinates"));
        }
        if let Some(value) = seen.colors.as_flattened().iter().find(|value| !(0.0..=1.0).contains(*value)) {
            return invalid("grasps.colors", format!("{value}, expected 0 to 1"));
        }
    }
    Ok(())
}

fn part(column: &'static str, part: PartId, count: usize) -> Result<(), Invalid> {
    if usize::from(part.0) < count { Ok(()) } else { invalid(column, format!("part {}, expected one of {count} parts", part.0)) }
}

fn finite(column: &'static str, values: &[f64]) -> Result<(), Invalid> {
    match values.iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) => invalid(column, format!("{value}, expected a finite number")),
    }
}

fn poses(column: &'static str, poses: &[Pose]) -> Result<(), Invalid> {
    for pose in poses {
        finite(column, pose.translation.vector.as_slice())?;
        let norm = pose.rotation.quaternion().norm();
        if (norm - 1.0).abs().partial_cmp(&UNIT_TOLERANCE) != Some(std::cmp::Ordering::Less) {
            return invalid(column, format!("a quaternion of norm {norm}, expected a unit quaternion"));
        }
    }
    Ok(())
}
