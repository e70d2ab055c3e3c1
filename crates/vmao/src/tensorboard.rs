//! Scalars as TensorBoard reads them: `Event` messages in TFRecord frames.
//!
//! Fields as in TensorBoard's `event.proto` and `summary.proto`: the wall time (1, double), the step (2), the version of the file's layout
//! (3) or a summary (5) of values (1), each a tag (1) and a float (2). A frame is the length, its checksum, the message, its checksum.
//! The wall time of an epoch is its number in seconds, so that equal trainings leave equal files.

/// A protobuf field whose content follows its length.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    let mut bytes = vec![number << 3 | 2];
    varint(content.len() as u64, &mut bytes);
    bytes.extend_from_slice(content);
    bytes
}

fn varint(mut value: u64, bytes: &mut Vec<u8>) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn event(step: u64, content: &[u8]) -> Vec<u8> {
    let mut bytes = vec![1 << 3 | 1];
    bytes.extend((step as f64).to_le_bytes());
    bytes.push(2 << 3);
    varint(step, &mut bytes);
    bytes.extend_from_slice(content);
    frame(&bytes)
}

/// What an event file begins with.
pub fn header() -> Vec<u8> {
    event(0, &field(3, b"brain.Event:2"))
}

/// The values of `step`, each with its tag.
pub fn scalars(step: u64, values: &[(&str, f32)]) -> Vec<u8> {
    let value = |&(tag, value): &(&str, f32)| {
        let mut content = field(1, tag.as_bytes());
        content.push(2 << 3 | 5);
        content.extend(value.to_le_bytes());
        field(1, &content)
    };
    event(step, &field(5, &values.iter().flat_map(value).collect::<Vec<u8>>()))
}

fn frame(content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    let mut bytes = length.to_vec();
    bytes.extend(masked(crc32c(&length)).to_le_bytes());
    bytes.extend_from_slice(content);
    bytes.extend(masked(crc32c(content)).to_le_bytes());
    bytes
}

/// TFRecord's mask: a checksum of data that holds checksums would say little.
fn masked(checksum: u32) -> u32 {
    checksum.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// CRC-32C (Castagnoli; RFC 3720, section 12.1), bit by bit, least significant first: some hundred bytes an epoch need no table.
fn crc32c(bytes: &[u8]) -> u32 {
    let polynomial = 0x82f6_3b78;
    let bit = |crc: u32| crc >> 1 ^ if crc & 1 == 1 { polynomial } else { 0 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| bit(crc)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_published_one() {
        // RFC 3720, appendix B.4, and the check value of the catalogue of CRCs.
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c(&[0xff; 32]), 0x62a8_ab43);
        assert_eq!(crc32c(&(0..32).collect::<Vec<u8>>()), 0x46dd_794e);
        assert_eq!(crc32c(&(0..32).rev().collect::<Vec<u8>>()), 0x113f_db5c);
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn numbers_of_any_size_are_varints() {
        let of = |value| {
            let mut bytes = Vec::new();
            varint(value, &mut bytes);
            bytes
        };
        assert_eq!(of(0), [0]);
        assert_eq!(of(127), [127]);
        assert_eq!(of(300), [0xac, 0x02]);
        assert_eq!(of(u64::MAX), [[0xff; 9].as_slice(), &[1]].concat());
    }

    #[test]
    fn a_step_has_the_bytes_of_its_message() {
        let bytes = scalars(3, &[("kl", 1.5)]);
        let message = [
            &[0x09][..],
            &3.0_f64.to_le_bytes(),
            &[0x10, 3],
            &[0x2a, 11, 0x0a, 9, 0x0a, 2, b'k', b'l', 0x15],
            &1.5_f32.to_le_bytes(),
        ]
        .concat();
        assert_eq!(bytes[..8], (message.len() as u64).to_le_bytes());
        assert_eq!(bytes[12..bytes.len() - 4], message);
        assert_eq!(bytes[8..12], masked(crc32c(&bytes[..8])).to_le_bytes());
        assert_eq!(bytes[bytes.len() - 4..], masked(crc32c(&message)).to_le_bytes());
        assert!(header().ends_with(&[b"brain.Event:2", &header()[header().len() - 4..]].concat()));
    }
}
