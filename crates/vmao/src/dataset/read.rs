//! Parquet to records. The file may be damaged or made by anyone: every length and value is checked before it is used.

use super::{
    DatasetError, RoundFile,
    check::{self, Invalid},
    columns::{DIGEST_KEY, SCHEMA_KEY, SCHEMA_VERSION, code_label, named_order, named_outcome, schema},
    digest::digest,
};
use crate::failure::contained;
use arrow_array::{
    Array, ArrayRef, ArrowPrimitiveType, RecordBatch, StructArray,
    cast::AsArray,
    types::{Float32Type, Float64Type, Int32Type, UInt16Type, UInt64Type},
};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use std::fs::File;
use vmao_core::{
    contact::{ArmId, Contact, PartId},
    geometry::Pose,
    object::{ObjectGoal, ObjectState},
    observation::Observation,
    record::{GraspRecord, TrialRecord},
};

/// The most that one file may hold when unpacked (bytes): a small file can claim to be anything.
const MAX_UNPACKED: i64 = 8 << 30;
/// The most trials that one file may hold.
const MAX_TRIALS: u64 = 1 << 20;
/// Rows decoded at a time.
const BATCH: usize = 64;

/// The records of one file, in trial order, checked against its name and its digest.
pub fn read_round(file: &RoundFile) -> Result<Vec<TrialRecord>, DatasetError> {
    // NOTE: the Parquet decoder trusts page headers and panics on some that are damaged.
    contained(|| decode(file)).unwrap_or_else(|| {
        let message = "not a Parquet file that can be decoded".to_owned();
        Err(DatasetError::Damaged { file: file.path.clone(), message })
    })
}

fn decode(round: &RoundFile) -> Result<Vec<TrialRecord>, DatasetError> {
    let file = &round.path;
    let damaged = |message: String| DatasetError::Damaged { file: file.clone(), message };
    let open = File::open(file).map_err(|source| DatasetError::Io { path: file.clone(), source })?;
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let builder = ParquetRecordBatchReaderBuilder::try_new_with_options(open, options)
        .map_err(|error| damaged(format!("not a Parquet file: {error}")))?;

    let metadata = builder.metadata().file_metadata();
    let lookup = |key: &str| {
        let pairs = metadata.key_value_metadata().map_or(&[][..], Vec::as_slice);
        pairs.iter().find(|pair| pair.key == key).and_then(|pair| pair.value.clone())
    };
    let version = lookup(SCHEMA_KEY);
    if version.as_deref() != Some(SCHEMA_VERSION) {
        let found = version.unwrap_or_else(|| "none".to_owned());
        return Err(damaged(format!("{SCHEMA_KEY} is {}, expected {SCHEMA_VERSION}", found.escape_debug())));
    }
    let written_digest = lookup(DIGEST_KEY);
    check_columns(builder.schema()).map_err(damaged)?;
    let unpacked = builder.metadata().row_groups().iter().map(|group| group.total_byte_size()).fold(0, i64::saturating_add);
    if !(0..=MAX_UNPACKED).contains(&unpacked) {
        return Err(damaged(format!("{unpacked} bytes unpacked, expected at most {MAX_UNPACKED}")));
    }
    let expected = round.last.checked_sub(round.first).and_then(|gap| gap.checked_add(1)).filter(|&count| count <= MAX_TRIALS);
    if u64::try_from(metadata.num_rows()).ok() != expected || expected.is_none() {
        let (first, last) = (round.first, round.last);
        return Err(damaged(format!("{} rows, expected trials {first} to {last} (at most {MAX_TRIALS})", metadata.num_rows())));
    }

    let mut records: Vec<TrialRecord> = Vec::new();
    for batch in builder.with_batch_size(BATCH).build().map_err(|error| damaged(error.to_string()))? {
        let batch = batch.map_err(|error| damaged(error.to_string()))?;
        for row in 0..batch.num_rows() {
            let number = records.len();
            let index = round.first.saturating_add(number as u64);
            records.push(record(&batch, row, index).map_err(|invalid| invalid.at(file, number))?);
        }
    }
    let expected = expected.unwrap_or_default();
    if records.len() as u64 != expected {
        return Err(damaged(format!("{} rows could be read, expected {expected}", records.len())));
    }
    if let Some(other) = records.iter().find(|record| record.seed != records[0].seed) {
        return Err(damaged(format!("trial {} has seed {}, expected one seed in a run", other.index, other.seed)));
    }
    let found = digest(&records);
    match written_digest {
        Some(written) if written == found => Ok(records),
        written => {
            let written = written.unwrap_or_else(|| "none".to_owned());
            Err(damaged(format!("records have digest {found}, expected {} as written", written.escape_debug())))
        }
    }
}

fn check_columns(found: &arrow_schema::Schema) -> Result<(), String> {
    let expected = schema();
    for field in expected.fields() {
        match found.field_with_name(field.name()) {
            Err(_) => {
                let names: Vec<&str> = found.fields().iter().map(|field| field.name().as_str()).collect();
                return Err(crate::wording::unknown("the file", "column", field.name(), names));
            }
            Ok(there) if there.data_type() != field.data_type() || there.is_nullable() != field.is_nullable() => {
                return Err(format!("column {} is {}, expected {}", field.name(), there.data_type(), field.data_type()));
            }
            Ok(_) => {}
        }
    }
    Ok(())
}

/// One row of the trials' columns, or of the columns inside `grasps`.
struct Row<'a> {
    columns: Columns<'a>,
    row: usize,
}

enum Columns<'a> {
    Trials(&'a RecordBatch),
    Grasps(&'a StructArray),
}

impl<'a> Row<'a> {
    fn column(&self, column: &'static str) -> Result<&'a ArrayRef, Invalid> {
        let found = match self.columns {
            Columns::Trials(batch) => batch.column_by_name(column),
            Columns::Grasps(grasps) => grasps.column_by_name(column.trim_start_matches("grasps.")),
        };
        found.ok_or_else(|| wrong_type(column))
    }

    fn number<T: ArrowPrimitiveType>(&self, column: &'static str) -> Result<T::Native, Invalid> {
        let array = self.column(column)?.as_primitive_opt::<T>().ok_or_else(|| wrong_type(column))?;
        Ok(array.value(self.row))
    }

    fn text(&self, column: &'static str) -> Result<&'a str, Invalid> {
        let array = self.column(column)?.as_string_opt::<i32>().ok_or_else(|| wrong_type(column))?;
        Ok(array.value(self.row))
    }

    fn list<T: ArrowPrimitiveType>(&self, column: &'static str) -> Result<Vec<T::Native>, Invalid> {
        let array = self.column(column)?.as_list_opt::<i32>().ok_or_else(|| wrong_type(column))?.value(self.row);
        Ok(array.as_primitive_opt::<T>().ok_or_else(|| wrong_type(column))?.values().to_vec())
    }

    fn groups<T: ArrowPrimitiveType, const N: usize>(&self, column: &'static str) -> Result<Vec<[T::Native; N]>, Invalid> {
        let numbers = self.list::<T>(column)?;
        match numbers.as_chunks::<N>() {
            (groups, []) => Ok(groups.to_vec()),
            _ => Err(Invalid { column, message: format!("{} numbers, expected a multiple of {N}", numbers.len()) }),
        }
    }

    fn array<const N: usize>(&self, column: &'static str) -> Result<[f64; N], Invalid> {
        let count = |numbers: Vec<f64>| Invalid { column, message: format!("{} numbers, expected {N}", numbers.len()) };
        self.list::<Float64Type>(column)?.try_into().map_err(count)
    }
}

fn wrong_type(column: &'static str) -> Invalid {
    Invalid { column, message: "another type than the file declares".to_owned() }
}

/// The pose of x, y, z, qw, qx, qy, qz, bit for bit; whether it is a unit quaternion is checked later.
fn pose([x, y, z, qw, qx, qy, qz]: [f64; 7]) -> Pose {
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(qw, qx, qy, qz));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

fn record(batch: &RecordBatch, row: usize, expected_index: u64) -> Result<TrialRecord, Invalid> {
    let trial = Row { columns: Columns::Trials(batch), row };
    let poses = |column| Ok::<_, Invalid>(trial.groups::<Float64Type, 7>(column)?.into_iter().map(pose).collect());
    let index = trial.number::<UInt64Type>("index")?;
    if index != expected_index {
        return Err(Invalid { column: "index", message: format!("{index}, expected {expected_index}") });
    }
    let list = trial.column("grasps")?.as_list_opt::<i32>().ok_or_else(|| wrong_type("grasps"))?.value(row);
    let grasps = list.as_struct_opt().ok_or_else(|| wrong_type("grasps"))?;
    let record = TrialRecord {
        index,
        seed: trial.number::<UInt64Type>("seed")?,
        order: named_order(trial.text("order")?).map_err(|message| Invalid { column: "order", message })?,
        start: ObjectState {
            world_from_parts: poses("start_parts")?,
            joint_positions: trial.list::<Float64Type>("start_joints")?,
        },
        goal: ObjectGoal {
            root: PartId(trial.number::<UInt16Type>("goal_root")?),
            world_from_root: pose(trial.array("goal_root_pose")?),
            joint_positions: trial.list::<Float64Type>("goal_joints")?,
        },
        grasps: (0..grasps.len()).map(|grasp| grasp_record(grasps, grasp)).collect::<Result<_, _>>()?,
        outcome: named_outcome(trial.text("outcome")?).map_err(|message| Invalid { column: "outcome", message })?,
        detail: trial.text("detail")?.to_owned(),
        steps: trial.number::<UInt64Type>("steps")?,
        final_errors: trial.array("final_errors")?,
    };
    check::record(&record).map(|()| record)
}

fn grasp_record(grasps: &StructArray, row: usize) -> Result<GraspRecord, Invalid> {
    let grasp = Row { columns: Columns::Grasps(grasps), row };
    let [x1, y1, z1, x2, y2, z2] = grasp.array("grasps.fingers")?;
    let gripper = if grasp.column("grasps.world_from_gripper")?.is_valid(row) {
        Some(pose(grasp.array("grasps.world_from_gripper")?))
    } else {
        None
    };
    let label = |code: i32| {
        let message = || format!("code {code}, expected a part's index, -1 for the table or -2 - a for arm a");
        code_label(code).ok_or_else(|| Invalid { column: "grasps.labels", message: message() })
    };
    let labels = grasp.list::<Int32Type>("grasps.labels")?.into_iter().map(label).collect::<Result<_, _>>()?;
    Ok(GraspRecord {
        arm: ArmId(grasp.number::<UInt16Type>("grasps.arm")?),
        contact: Contact {
            part: PartId(grasp.number::<UInt16Type>("grasps.part")?),
            fingers: [Point3::new(x1, y1, z1), Point3::new(x2, y2, z2)],
        },
        observation: Observation {
            points: grasp.groups::<Float32Type, 3>("grasps.points")?,
            colors: grasp.groups::<Float32Type, 3>("grasps.colors")?,
            labels,
        },
        world_from_part: pose(grasp.array("grasps.world_from_part")?),
        world_from_gripper: gripper,
    })
}
