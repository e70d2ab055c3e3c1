//! Checkpoints and training states from anywhere: the fuzzer's corpus replayed, and thousands of sound files changed at random.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use serde_json::{Value, json};
use std::{fs, path::Path, path::PathBuf};
use vmao_core::random::Stream;
use vmao_net::{Checkpoint, readers};

type Reader = fn(&[u8]);

fn reader(name: &str) -> Reader {
    if name == "state" { readers::state } else { readers::checkpoint }
}

fn corpus(reader: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(reader)
}

#[test]
fn corpus_is_read_whole_and_cut() {
    for name in ["checkpoint", "state"] {
        let mut files: Vec<_> = fs::read_dir(corpus(name)).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        assert!(!files.is_empty());
        for file in files {
            let bytes = fs::read(file).unwrap();
            (0..=8).for_each(|eighth| reader(name)(&bytes[..bytes.len() * eighth / 8]));
        }
    }
}

#[test]
#[ignore = "writes the fuzzer's corpus"]
fn mint() {
    for (reader, name, bytes) in readers::sound() {
        fs::create_dir_all(corpus(reader)).unwrap();
        fs::write(corpus(reader).join(name), bytes).unwrap();
    }
}

/// Numbers that lengths, offsets and shapes do not expect.
const NUMBERS: [&str; 8] = ["-1", "0", "4096", "4294967296", "18446744073709551615", "1e309", "NaN", "99999999999999999999999"];

/// The bytes with one to three changes: flipped, cut out, doubled, or a number of the header replaced by another one.
fn changed(bytes: &[u8], stream: &mut Stream) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=stream.index(3) {
        let (a, b) = (stream.index(bytes.len()), stream.index(bytes.len()));
        let (low, high) = (a.min(b), a.max(b).min(a.min(b) + 40));
        match stream.index(4) {
            0 => bytes[a] ^= 1 << stream.index(8),
            1 => drop(bytes.drain(low..high)),
            2 => {
                let part = bytes[low..high].to_vec();
                bytes.splice(b..b, part);
            }
            _ => {
                let Some(start) = (a..bytes.len()).find(|&i| bytes[i].is_ascii_digit()) else { continue };
                let end = (start..bytes.len()).find(|&i| !bytes[i].is_ascii_digit()).unwrap_or(bytes.len());
                let number = NUMBERS[stream.index(NUMBERS.len())];
                bytes.splice(start..end, number.bytes());
            }
        }
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}

/// A sound checkpoint's configuration and weights, the weights with another header.
fn with_header(change: impl FnOnce(&mut Value)) -> (String, Vec<u8>) {
    let (_, _, file) = readers::sound().remove(0);
    let (config, weights) = file[2..].split_at(u16::from_le_bytes([file[0], file[1]]).into());
    let (header, arrays) = weights[8..].split_at(u64::from_le_bytes(weights[..8].try_into().unwrap()) as usize);
    let mut header: Value = serde_json::from_slice(header).unwrap();
    change(&mut header);
    let header = header.to_string();
    let weights = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), arrays].concat();
    (String::from_utf8(config.to_vec()).unwrap(), weights)
}

#[test]
fn what_is_said_of_hostile_text_is_short_and_safe_for_a_terminal() {
    let bell = "\u{7}".repeat(10_000);
    let (config, weights) = with_header(|_| ());
    Checkpoint::from_safetensors(&weights, &config).unwrap();
    let escaped = format!("\"{}\":1,", "\\u0007".repeat(10_000));
    let mut refused = vec![
        (config.replacen('{', &format!("{{{escaped}"), 1), weights.clone()),
        (config.replacen("\"channels\": [", &format!("\"channels\": [{}", "0,".repeat(30_000)), 1), weights),
    ];
    refused.extend([
        with_header(|header| header["__metadata__"]["vmao"] = format!("{bell} {{}}").into()),
        with_header(|header| {
            let text = header["__metadata__"]["vmao"].as_str().unwrap().to_owned();
            header["__metadata__"]["vmao"] = format!("{bell} {}", text.split_once(' ').unwrap().1).into();
        }),
        with_header(|header| {
            let (name, array) = header.as_object().unwrap().iter().find(|(name, _)| name.ends_with("head.weight")).unwrap();
            let (name, mut array) = (name.clone(), array.clone());
            array["shape"] = [vec![1; 20_000], vec![4]].concat().into();
            header[&name] = array;
        }),
        with_header(|header| header[&bell] = json!({"dtype": "F32", "shape": [0], "data_offsets": [0, 0]})),
        with_header(|header| header["decoder.head.weight"]["dtype"] = bell.as_str().into()),
    ]);
    for (i, (config, weights)) in refused.into_iter().enumerate() {
        let error = Checkpoint::from_safetensors(&weights, &config).unwrap_err().to_string();
        assert!(
            error.len() < 4000 && !error.contains(char::is_control),
            "{i}: {} bytes: {:.100}",
            error.len(),
            error.escape_debug()
        );
    }
}

fn batter(seed: u64, times: usize) {
    let files = readers::sound();
    assert_eq!(files.len(), 3);
    let mut stream = Stream::new(seed, &[]);
    for (name, _, bytes) in &files {
        for _ in 0..times {
            reader(name)(&changed(bytes, &mut stream));
        }
    }
}

#[test]
fn changed_files_are_refused_or_sound() {
    batter(1, 2000);
}

#[test]
#[ignore = "minutes"]
fn many_changed_files_are_refused_or_sound() {
    batter(2, 400_000);
}
