//! Columns of slowly changing numbers as few bytes: fixed point, second differences, variable-length integers, zlib, base64.
//!
//! What rests or moves evenly has second differences of zero, and most arms rest most of the time.

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, bufread::ZlibEncoder, read::ZlibDecoder};
use std::io::{self, Read};

/// Most bytes that a packed text may unfold to: an hour of six arms is less.
const MAX_UNFOLDED: u64 = 256 << 20;
/// Steps beyond this are cut off: a part that fell off the world is 100 km away.
const FURTHEST: f64 = 1e9;

/// Any bytes as compressed text.
pub(crate) fn squeeze(bytes: &[u8]) -> io::Result<String> {
    let mut packed = Vec::new();
    ZlibEncoder::new(bytes, Compression::best()).read_to_end(&mut packed)?;
    Ok(STANDARD.encode(packed))
}

/// The bytes of a compressed text; says what is wrong with one that is damaged or unfolds without end.
pub(super) fn unfold(text: &str) -> Result<Vec<u8>, String> {
    let packed = STANDARD.decode(text).map_err(|error| format!("not base64: {error}"))?;
    let mut bytes = Vec::new();
    let read = ZlibDecoder::new(&packed[..]).take(MAX_UNFOLDED + 1).read_to_end(&mut bytes);
    read.map_err(|error| format!("not zlib: {error}"))?;
    if bytes.len() as u64 > MAX_UNFOLDED {
        return Err(format!("unfolds to more than {MAX_UNFOLDED} bytes"));
    }
    Ok(bytes)
}

/// The numbers in whole `step`s, as second differences; what is no number repeats the one before.
pub(super) fn push_column(bytes: &mut Vec<u8>, values: impl Iterator<Item = f64>, step: f64) {
    let (mut last, mut slope) = (0_i64, 0_i64);
    for value in values {
        let whole = (value / step).round();
        let now = if whole.is_nan() { last } else { whole.clamp(-FURTHEST, FURTHEST) as i64 };
        let bend = now - last - slope;
        (slope, last) = (now - last, now);
        push_integer(bytes, bend);
    }
}

/// Zigzag, then seven bits a byte, the lowest first.
fn push_integer(bytes: &mut Vec<u8>, value: i64) {
    let mut rest = ((value << 1) ^ (value >> 63)) as u64;
    while rest >= 0x80 {
        bytes.push(rest as u8 | 0x80);
        rest >>= 7;
    }
    bytes.push(rest as u8);
}

/// Reads what [`push_column`] wrote.
#[derive(Debug)]
pub(super) struct Columns<'b> {
    bytes: &'b [u8],
}

impl<'b> Columns<'b> {
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        Self { bytes }
    }

    /// The next column of `length` numbers.
    pub(super) fn column(&mut self, length: usize, step: f64) -> Result<Vec<f64>, String> {
        // Every number takes a byte at least: a length that lies is found out before it is made room for.
        if length > self.bytes.len() {
            return Err(format!("{} bytes left, expected a column of {length} numbers", self.bytes.len()));
        }
        let (mut last, mut slope) = (0_i64, 0_i64);
        let mut next = || {
            slope = slope.wrapping_add(self.integer()?);
            last = last.wrapping_add(slope);
            Ok(last as f64 * step)
        };
        (0..length).map(|_| next()).collect()
    }

    fn integer(&mut self) -> Result<i64, String> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let (&byte, rest) = self.bytes.split_first().ok_or("ends within a column")?;
            self.bytes = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok((value >> 1) as i64 ^ -((value & 1) as i64));
            }
        }
        Err("a number of more than 64 bits".to_owned())
    }

    /// Refuses bytes that nobody asked for.
    pub(super) fn end(&self) -> Result<(), String> {
        if self.bytes.is_empty() { Ok(()) } else { Err(format!("{} bytes after the last column", self.bytes.len())) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::random::Stream;

    fn through(values: &[f64], step: f64) -> Vec<f64> {
        let mut bytes = Vec::new();
        push_column(&mut bytes, values.iter().copied(), step);
        let unfolded = unfold(&squeeze(&bytes).unwrap()).unwrap();
        let mut columns = Columns::new(&unfolded);
        let back = columns.column(values.len(), step).unwrap();
        columns.end().unwrap();
        back
    }

    #[test]
    fn numbers_come_back_to_half_a_step() {
        let mut stream = Stream::new(4, &[]);
        let values: Vec<f64> = (0..500).map(|_| 3.0 * stream.normal()).collect();
        let back = through(&values, 1e-3);
        assert!(values.iter().zip(&back).all(|(a, b)| (a - b).abs() <= 0.5e-3 + 1e-12));
    }

    #[test]
    fn what_is_no_number_repeats_and_what_is_too_large_is_cut() {
        let values = [0.0, 1.0, f64::NAN, f64::INFINITY, -1e300, 2.0];
        assert_eq!(through(&values, 0.5), [0.0, 1.0, 1.0, 0.5e9, -0.5e9, 2.0]);
    }

    #[test]
    fn rest_takes_no_room_and_even_motion_hardly_any() {
        let size = |values: &dyn Fn(i32) -> f64| {
            let mut bytes = Vec::new();
            push_column(&mut bytes, (0..1000).map(values), 1e-4);
            squeeze(&bytes).unwrap().len()
        };
        assert!(size(&|_| 0.7) < 60 && size(&|k| 1e-3 * f64::from(k)) < 60);
    }

    #[test]
    fn damaged_text_is_refused_in_words() {
        assert!(unfold("!").unwrap_err().contains("base64"));
        assert!(unfold("AAAA").unwrap_err().contains("zlib"));
        assert!(Columns::new(&[0x80]).column(1, 1.0).unwrap_err().contains("ends"));
        assert!(Columns::new(&[0xff; 12]).column(1, 1.0).unwrap_err().contains("64 bits"));
        assert!(Columns::new(&[0; 3]).column(usize::MAX, 1.0).unwrap_err().contains("3 bytes left"));
        assert!(Columns::new(&[0; 3]).end().is_err());
    }
}
