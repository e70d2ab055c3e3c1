//! Long arrays as base64 of little-endian numbers, so that a report stays small enough to mail.

use base64::{Engine, engine::general_purpose::STANDARD};
use serde::Serializer;
use vmao_core::observation::PointLabel;

fn little_endian(values: impl IntoIterator<Item = f32>) -> String {
    STANDARD.encode(values.into_iter().flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
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
    let bytes: Vec<u8> = values.iter().map(|label| kind(*label)).collect();
    serializer.serialize_str(&STANDARD.encode(bytes))
}

/// A whole number as text: a browser's numbers end at 2⁵³.
pub(super) fn whole<S: Serializer>(value: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&value.to_string())
}

fn kind(label: PointLabel) -> u8 {
    match label {
        PointLabel::Table => 0,
        PointLabel::Arm(_) => 1,
        PointLabel::Part(_) => 2,
    }
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
}
