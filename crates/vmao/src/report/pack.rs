//! Long arrays as base64 of little-endian numbers, so that a report stays small enough to mail.

use base64::{Engine, engine::general_purpose::STANDARD};
use serde::{Serialize, Serializer};
use vmao_core::{
    geometry::{Pose, position_quaternion},
    observation::PointLabel,
    rollout::Rollout,
    shape::Shape,
};

fn little_endian(values: impl IntoIterator<Item = f32>) -> String {
    STANDARD.encode(values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

/// Position (m), then the quaternion w, x, y, z: seven numbers.
fn seven(pose: &Pose) -> [f32; 7] {
    let ([x, y, z], [w, i, j, k]) = position_quaternion(pose);
    [x, y, z, w, i, j, k].map(|value| value as f32)
}

fn poses<'a>(poses: impl IntoIterator<Item = &'a Pose>) -> String {
    little_endian(poses.into_iter().flat_map(seven))
}

/// f32, one after the other.
pub(super) fn floats<S: Serializer>(values: &[f32], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&little_endian(values.iter().copied()))
}

/// f32, three for each entry.
pub(super) fn triples<S: Serializer>(values: &[[f32; 3]], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&little_endian(values.iter().flatten().copied()))
}

/// One byte for each colour component, from [0, 1].
pub(super) fn colors<S: Serializer>(values: &[[f32; 3]], serializer: S) -> Result<S::Ok, S::Error> {
    let bytes: Vec<u8> = values.iter().flatten().map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    serializer.serialize_str(&STANDARD.encode(bytes))
}

/// One byte for each point: 0 table, 1 arm, 2 part.
pub(super) fn labels<S: Serializer>(values: &[PointLabel], serializer: S) -> Result<S::Ok, S::Error> {
    let bytes: Vec<u8> = values.iter().map(|label| kind(*label).0).collect();
    serializer.serialize_str(&STANDARD.encode(bytes))
}

/// A whole number as text: a browser's numbers end at 2⁵³.
pub(super) fn whole<S: Serializer>(value: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&value.to_string())
}

/// Byte, name and index of what a point or body belongs to.
fn kind(label: PointLabel) -> (u8, &'static str, u16) {
    match label {
        PointLabel::Table => (0, "table", 0),
        PointLabel::Arm(index) => (1, "arm", index),
        PointLabel::Part(index) => (2, "part", index),
    }
}

#[derive(Serialize)]
struct PackedRollout<'a> {
    bodies: Vec<PackedBody<'a>>,
    frame_seconds: f64,
    poses: String,
    goal: String,
    events: &'a [vmao_core::rollout::RolloutEvent],
    contacts: &'a [(f64, u16, [f64; 3], [f64; 3])],
    outcome: &'a str,
}

#[derive(Serialize)]
struct PackedBody<'a> {
    name: &'a str,
    kind: &'static str,
    index: u16,
    solids: Vec<PackedSolid<'a>>,
}

#[derive(Serialize)]
struct PackedSolid<'a> {
    shape: &'a Shape,
    pose: [f32; 7],
    color: [f32; 3],
}

/// A rollout whose poses are packed frame by frame, body by body. A frame that lacks a body ends the motion.
pub(super) fn rollout<S: Serializer>(rollout: &Rollout, serializer: S) -> Result<S::Ok, S::Error> {
    let bodies = rollout
        .bodies
        .iter()
        .map(|body| {
            let (_, kind, index) = kind(body.label);
            let solids = body.solids.iter();
            let solids = solids.map(|solid| PackedSolid {
                shape: &solid.shape,
                pose: seven(&solid.carrier_from_solid),
                color: solid.color,
            });
            PackedBody { name: &body.name, kind, index, solids: solids.collect() }
        })
        .collect();
    let whole_frames = rollout.frames.iter().take_while(|frame| frame.len() == rollout.bodies.len());
    PackedRollout {
        bodies,
        frame_seconds: rollout.frame_seconds,
        poses: poses(whole_frames.flatten()),
        goal: poses(&rollout.goal),
        events: &rollout.events,
        contacts: &rollout.contacts,
        outcome: &rollout.outcome,
    }
    .serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_packed_little_endian_and_bit_for_bit() {
        let bytes = STANDARD.decode(little_endian([1.0, -2.5, f32::NAN])).unwrap();
        assert_eq!(bytes[..8], [0, 0, 0x80, 0x3f, 0, 0, 0x20, 0xc0]);
        assert!(f32::from_le_bytes(bytes[8..].try_into().unwrap()).is_nan());
    }

    #[test]
    fn a_pose_is_packed_as_position_then_scalar_first_quaternion() {
        let pose = vmao_core::geometry::pose([1.0, 2.0, 3.0], [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(seven(&pose), [1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.0]);
    }
}
