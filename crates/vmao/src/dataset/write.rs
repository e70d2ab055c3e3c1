//! Records to Parquet.

use super::{
    columns::{DIGEST_KEY, SCHEMA_KEY, SCHEMA_VERSION, element, grasp_fields, label_code, order_name, pose_numbers, schema},
    digest::digest,
};
use arrow_array::{
    ArrayRef, Float32Array, Float64Array, Int32Array, ListArray, RecordBatch, StringArray, StructArray, UInt16Array, UInt64Array,
};
use arrow_buffer::{NullBuffer, OffsetBuffer};
use arrow_schema::{ArrowError, DataType};
use parquet::{
    arrow::arrow_writer::{ArrowWriter, ArrowWriterOptions},
    basic::Compression,
    errors::ParquetError,
    file::{metadata::KeyValue, properties::WriterProperties},
    schema::types::ColumnPath,
};
use std::{io::Write, sync::Arc};
use vmao_core::record::{GraspRecord, TrialRecord};

/// Writes the records of one round as one Parquet file with one row group.
pub(super) fn round(file: &mut (impl Write + Send), records: &[TrialRecord]) -> Result<(), ParquetError> {
    let metadata = [(SCHEMA_KEY, SCHEMA_VERSION.to_owned()), (DIGEST_KEY, digest(records))];
    let metadata = metadata.map(|(key, value)| KeyValue::new(key.to_owned(), value)).to_vec();
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(Some(metadata))
        // The file depends on the records only, not on the library's version string.
        .set_created_by("vmao".to_owned());
    for column in ["fingers", "world_from_part", "world_from_gripper", "points"] {
        // Measured coordinates do not repeat: a dictionary of them only costs.
        let path = ["grasps", "list", "element", column, "list", "element"].map(str::to_owned).to_vec();
        properties = properties.set_column_dictionary_enabled(ColumnPath::from(path), false);
    }
    // Without the Arrow copy of the schema there is one truth, the Parquet one.
    let options = ArrowWriterOptions::new().with_properties(properties.build()).with_skip_arrow_metadata(true);
    let mut writer = ArrowWriter::try_new_with_options(file, Arc::new(schema()), options)?;
    writer.write(&batch(records)?)?;
    writer.close().map(|_| ())
}

fn batch(records: &[TrialRecord]) -> Result<RecordBatch, ArrowError> {
    let grasps: Vec<&GraspRecord> = records.iter().flat_map(|record| &record.grasps).collect();
    let grasps_of = OffsetBuffer::try_from_lengths(records.iter().map(|record| record.grasps.len())).map_err(too_many)?;
    let grasps =
        ListArray::try_new(element(DataType::Struct(grasp_fields())), grasps_of, Arc::new(grasp_columns(&grasps)?), None)?;
    let columns: Vec<ArrayRef> = vec![
        Arc::new(UInt64Array::from_iter_values(records.iter().map(|record| record.index))),
        Arc::new(UInt64Array::from_iter_values(records.iter().map(|record| record.seed))),
        Arc::new(StringArray::from_iter_values(records.iter().map(|record| order_name(record.order)))),
        Arc::new(StringArray::from_iter_values(records.iter().map(|record| record.outcome.name()))),
        Arc::new(StringArray::from_iter_values(records.iter().map(|record| &record.detail))),
        Arc::new(UInt64Array::from_iter_values(records.iter().map(|record| record.steps))),
        doubles(records.iter().map(|record| record.final_errors.to_vec()))?,
        doubles(records.iter().map(|record| record.start.world_from_parts.iter().flat_map(pose_numbers).collect()))?,
        doubles(records.iter().map(|record| record.start.joint_positions.clone()))?,
        Arc::new(UInt16Array::from_iter_values(records.iter().map(|record| record.goal.root.0))),
        doubles(records.iter().map(|record| pose_numbers(&record.goal.world_from_root).to_vec()))?,
        doubles(records.iter().map(|record| record.goal.joint_positions.clone()))?,
        Arc::new(grasps),
    ];
    RecordBatch::try_new(Arc::new(schema()), columns)
}

fn grasp_columns(grasps: &[&GraspRecord]) -> Result<StructArray, ArrowError> {
    let fingers = |grasp: &&GraspRecord| grasp.contact.fingers.iter().flat_map(|finger| finger.coords.data.0[0]).collect();
    let grippers = grasps.iter().map(|grasp| grasp.world_from_gripper.iter().flat_map(pose_numbers).collect());
    let chosen: NullBuffer = grasps.iter().map(|grasp| grasp.world_from_gripper.is_some()).collect::<Vec<bool>>().into();
    let columns: Vec<ArrayRef> = vec![
        Arc::new(UInt16Array::from_iter_values(grasps.iter().map(|grasp| grasp.arm.0))),
        Arc::new(UInt16Array::from_iter_values(grasps.iter().map(|grasp| grasp.contact.part.0))),
        doubles(grasps.iter().map(fingers))?,
        doubles(grasps.iter().map(|grasp| pose_numbers(&grasp.world_from_part).to_vec()))?,
        nullable_doubles(grippers, Some(chosen))?,
        singles(grasps.iter().map(|grasp| grasp.observation.points.as_flattened()))?,
        singles(grasps.iter().map(|grasp| grasp.observation.colors.as_flattened()))?,
        labels(grasps)?,
    ];
    StructArray::try_new(grasp_fields(), columns, None)
}

fn doubles(rows: impl Iterator<Item = Vec<f64>>) -> Result<ArrayRef, ArrowError> {
    nullable_doubles(rows, None)
}

fn nullable_doubles(rows: impl Iterator<Item = Vec<f64>>, nulls: Option<NullBuffer>) -> Result<ArrayRef, ArrowError> {
    let rows: Vec<Vec<f64>> = rows.collect();
    let offsets = OffsetBuffer::try_from_lengths(rows.iter().map(Vec::len)).map_err(too_many)?;
    let values = Float64Array::from_iter_values(rows.into_iter().flatten());
    Ok(Arc::new(ListArray::try_new(element(DataType::Float64), offsets, Arc::new(values), nulls)?))
}

fn singles<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone) -> Result<ArrayRef, ArrowError> {
    let offsets = OffsetBuffer::try_from_lengths(rows.clone().map(<[f32]>::len)).map_err(too_many)?;
    let values = Float32Array::from_iter_values(rows.flatten().copied());
    Ok(Arc::new(ListArray::try_new(element(DataType::Float32), offsets, Arc::new(values), None)?))
}

fn labels(grasps: &[&GraspRecord]) -> Result<ArrayRef, ArrowError> {
    let rows = grasps.iter().map(|grasp| &grasp.observation.labels);
    let offsets = OffsetBuffer::try_from_lengths(rows.clone().map(Vec::len)).map_err(too_many)?;
    let values = Int32Array::from_iter_values(rows.flatten().map(|&label| label_code(label)));
    Ok(Arc::new(ListArray::try_new(element(DataType::Int32), offsets, Arc::new(values), None)?))
}

fn too_many(error: impl std::fmt::Display) -> ArrowError {
    ArrowError::InvalidArgumentError(format!("too many values for one round: {error}"))
}
