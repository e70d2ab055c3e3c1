//! The columns of a file, and how the values of a record are spelled in them.

use arrow_schema::{DataType, Field, FieldRef, Fields, Schema};
use std::sync::Arc;
use vmao_core::{
    geometry::{Pose, position_quaternion},
    observation::PointLabel,
    order::GraspOrder,
    outcome::{FailureStage, TrialOutcome},
};

/// Version of the columns, in the file's metadata under [`SCHEMA_KEY`].
pub(super) const SCHEMA_VERSION: &str = "1";
/// Metadata key of the version of the columns.
pub(super) const SCHEMA_KEY: &str = "vmao.schema";
/// Metadata key of the digest of the file's records.
pub(super) const DIGEST_KEY: &str = "vmao.digest";

/// The element of a list column; Parquet's own name for it.
pub(super) fn element(item: DataType) -> FieldRef {
    Arc::new(Field::new("element", item, false))
}

fn list(item: DataType) -> DataType {
    DataType::List(element(item))
}

/// The columns inside `grasps`.
pub(super) fn grasp_fields() -> Fields {
    Fields::from(vec![
        Field::new("arm", DataType::UInt16, false),
        Field::new("part", DataType::UInt16, false),
        Field::new("fingers", list(DataType::Float64), false),
        Field::new("world_from_part", list(DataType::Float64), false),
        Field::new("world_from_gripper", list(DataType::Float64), true),
        Field::new("points", list(DataType::Float32), false),
        Field::new("colors", list(DataType::Float32), false),
        Field::new("labels", list(DataType::Int32), false),
    ])
}

/// The columns of a file, one row for each trial.
pub(super) fn schema() -> Schema {
    Schema::new(vec![
        Field::new("index", DataType::UInt64, false),
        Field::new("seed", DataType::UInt64, false),
        Field::new("order", DataType::Utf8, false),
        Field::new("outcome", DataType::Utf8, false),
        Field::new("detail", DataType::Utf8, false),
        Field::new("steps", DataType::UInt64, false),
        Field::new("final_errors", list(DataType::Float64), false),
        Field::new("start_parts", list(DataType::Float64), false),
        Field::new("start_joints", list(DataType::Float64), false),
        Field::new("goal_root", DataType::UInt16, false),
        Field::new("goal_root_pose", list(DataType::Float64), false),
        Field::new("goal_joints", list(DataType::Float64), false),
        Field::new("grasps", list(DataType::Struct(grasp_fields())), false),
    ])
}

/// x, y, z, qw, qx, qy, qz.
pub(super) fn pose_numbers(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [qw, qx, qy, qz]) = position_quaternion(pose);
    [x, y, z, qw, qx, qy, qz]
}

/// A part's index, −1 for the table, −2 − a for arm a.
pub(super) fn label_code(label: PointLabel) -> i32 {
    match label {
        PointLabel::Part(part) => i32::from(part),
        PointLabel::Table => -1,
        PointLabel::Arm(arm) => -2 - i32::from(arm),
    }
}

/// The label with this code.
pub(super) fn code_label(code: i32) -> Option<PointLabel> {
    match code {
        -1 => Some(PointLabel::Table),
        0.. => u16::try_from(code).ok().map(PointLabel::Part),
        _ => u16::try_from(-2 - i64::from(code)).ok().map(PointLabel::Arm),
    }
}

/// The grasp order's name.
pub(super) fn order_name(order: GraspOrder) -> &'static str {
    order.name()
}

/// The grasp order with this name, or the names there are.
pub(super) fn named_order(name: &str) -> Result<GraspOrder, String> {
    let orders = [GraspOrder::Parallel, GraspOrder::SequentialParallel, GraspOrder::Sequential];
    orders.into_iter().find(|&order| order_name(order) == name).ok_or_else(|| unknown("order", name, &orders.map(order_name)))
}

/// The outcome with this name, or the names there are.
pub(super) fn named_outcome(name: &str) -> Result<TrialOutcome, String> {
    let failed = FailureStage::ALL.map(TrialOutcome::Failed);
    let mut outcomes = std::iter::once(TrialOutcome::Success).chain(failed);
    let names: Vec<&str> = outcomes.clone().map(TrialOutcome::name).collect();
    outcomes.find(|&outcome| outcome.name() == name).ok_or_else(|| unknown("outcome", name, &names))
}

fn unknown(kind: &str, name: &str, names: &[&str]) -> String {
    crate::wording::unknown("a trial", kind, name, names.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_has_one_code() {
        for label in
            [PointLabel::Table, PointLabel::Arm(0), PointLabel::Arm(u16::MAX), PointLabel::Part(0), PointLabel::Part(u16::MAX)]
        {
            assert_eq!(code_label(label_code(label)), Some(label));
        }
        for code in [65_536, i32::MAX, -65_538, i32::MIN] {
            assert_eq!(code_label(code), None, "{code}");
        }
    }

    #[test]
    fn names_read_back_and_others_are_answered_with_what_exists() {
        for stage in FailureStage::ALL {
            let outcome = TrialOutcome::Failed(stage);
            assert_eq!(named_outcome(outcome.name()), Ok(outcome));
        }
        assert_eq!(named_order("sequential"), Ok(GraspOrder::Sequential));
        assert_eq!(
            named_order("up").unwrap_err(),
            "a trial has no order `up`; orders are: parallel, sequential-parallel, sequential"
        );
    }
}
