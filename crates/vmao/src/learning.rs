//! Networks on disk and what they are trained on: one network for each part, `grasp-0` for the object's first and so on.

use crate::config::Config;
use crate::failure::{Failure, OrBadInput};
use crate::learned_contacts::{LearnedContacts, methods};
use crate::output::{log, write_whole};
use crate::results::Method;
use crate::scenes::grasps;
use anyhow::Context;
use serde::de::DeserializeOwned;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use vmao_core::record::{GraspRecord, TrialRecord};
use vmao_net::{Checkpoint, ContactNetwork, Example, ModelKind};

/// The weights of a network.
pub(crate) const WEIGHTS: &str = "model.safetensors";
/// What it is made of.
pub(crate) const CONFIG: &str = "config.json";
/// What a training goes on from; gone when it has come to its end.
pub(crate) const STATE: &str = "state.safetensors";

/// The most that is read of these files (bytes); a state holds four times the weights.
const MAX_WEIGHTS_BYTES: u64 = 256 << 20;
pub(crate) const MAX_STATE_BYTES: u64 = 4 * MAX_WEIGHTS_BYTES;
const MAX_CONFIG_BYTES: u64 = 1 << 20;
pub(crate) const MAX_LINES_BYTES: u64 = 256 << 20;

/// The files of a network, and the most that is read of them.
const FILES: [(&str, u64); 2] = [(WEIGHTS, MAX_WEIGHTS_BYTES), (CONFIG, MAX_CONFIG_BYTES)];

/// The successful grasps of `part`, in the order of the trials.
fn successes(records: &[TrialRecord], part: usize) -> impl Iterator<Item = (&TrialRecord, &GraspRecord)> {
    let successful = records.iter().filter(|record| record.outcome.is_success());
    let grasps = successful.flat_map(|record| record.grasps.iter().map(move |grasp| (record, grasp)));
    grasps.filter(move |(_, grasp)| usize::from(grasp.contact.part.0) == part)
}

/// The training examples of `part`: what was seen before the successful grasps of it, and where they touched.
pub fn examples(records: &[TrialRecord], part: usize) -> Vec<Example> {
    let example = |(_, grasp): (_, &GraspRecord)| Example {
        points: grasp.observation.points.clone(),
        colors: grasp.observation.colors.clone(),
        contacts: grasp.contact.fingers.map(|point| (grasp.world_from_part * point).coords.map(|x| x as f32).into()),
    };
    successes(records, part).map(example).collect()
}

/// The trial of each of [`examples`].
pub fn trials_of_examples(records: &[TrialRecord], part: usize) -> Vec<u64> {
    successes(records, part).map(|(record, _)| record.index).collect()
}

/// The directory of a grasp step's network among those of its kind.
pub(crate) fn grasp_directory(directory: &Path, grasp: usize) -> PathBuf {
    directory.join(format!("grasp-{grasp}"))
}

/// Writes one file of a network, whole or not at all.
pub(crate) fn save(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    Ok(write_whole(path, |file| file.write_all(bytes)).with_context(|| path.display().to_string())?)
}

/// The kind of a checkpoint directory's networks, and the networks, one for each of `grasps` steps; damaged files are refused.
pub fn load(directory: &Path, grasps: usize) -> Result<(ModelKind, Vec<ContactNetwork>), Failure> {
    let networks = (0..grasps).map(|grasp| load_one(&grasp_directory(directory, grasp))).collect::<Result<Vec<_>, _>>()?;
    let kind = networks.first().map_or(ModelKind::Top1, ContactNetwork::kind);
    if let Some(odd) = networks.iter().position(|network| network.kind() != kind) {
        let place = grasp_directory(directory, odd);
        let message = format!("{}: a {:?} network, expected {kind:?} as in grasp-0", place.display(), networks[odd].kind());
        return Err(Failure::bad_input(message));
    }
    Ok((kind, networks))
}

/// The networks of every kind that a run directory's `models` holds, for the methods that are configured.
pub fn load_methods(models: &Path, config: &Config) -> Result<Vec<(Method, LearnedContacts)>, Failure> {
    let mut found = Vec::new();
    for place in ModelKind::ALL.map(|kind| models.join(kind.name())) {
        if place.is_dir() {
            found.push(load(&place, grasps(config)?)?);
        }
    }
    Ok(methods(&config.evaluate, &found))
}

fn load_one(directory: &Path) -> Result<ContactNetwork, Failure> {
    let checkpoint = load_checkpoint(directory)?;
    if directory.join(STATE).exists() {
        let (place, epoch) = (directory.display(), checkpoint.epoch);
        log(&format!("{place}: training has not come to its end; these are the best weights so far, of epoch {epoch}"));
    }
    Ok(ContactNetwork::load(&checkpoint))
}

/// The checkpoint of one grasp step's network.
pub(crate) fn load_checkpoint(directory: &Path) -> Result<Checkpoint, Failure> {
    let place = directory.join(CONFIG);
    let config = String::from_utf8(read(&place, MAX_CONFIG_BYTES)?)
        .with_context(|| format!("{}: not UTF-8", place.display()))
        .or_bad_input()?;
    Checkpoint::from_safetensors(&read(&directory.join(WEIGHTS), MAX_WEIGHTS_BYTES)?, &config)
        .with_context(|| directory.display().to_string())
        .or_bad_input()
}

/// A file of a training of at most `most` bytes.
pub(crate) fn read(path: &Path, most: u64) -> Result<Vec<u8>, Failure> {
    let missing = || format!("{}: cannot be read, expected a file written by `vmao train`", path.display());
    let mut bytes = Vec::new();
    let file = fs::File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes));
    file.with_context(missing).or_bad_input()?;
    if bytes.len() as u64 > most {
        return Err(Failure::bad_input(format!("{}: longer than {most} bytes, the most that is read", path.display())));
    }
    Ok(bytes)
}

/// Refuses to go on with other networks than those that a run holds.
pub fn check_same(given: &Path, kept: &Path, grasps: usize) -> Result<(), Failure> {
    for grasp in 0..grasps {
        for (name, most) in FILES {
            let (given, kept) = (grasp_directory(given, grasp).join(name), grasp_directory(kept, grasp).join(name));
            if read(&given, most)? != read(&kept, most)? {
                let (given, kept) = (given.display(), kept.display());
                return Err(Failure::bad_input(format!("{given}: another network than {kept}, which the kept trials ran with")));
            }
        }
    }
    Ok(())
}

/// Copies a checkpoint directory, so that a run holds the models it speaks of.
pub fn copy(from: &Path, to: &Path, grasps: usize) -> Result<(), Failure> {
    for grasp in 0..grasps {
        let (source, target) = (grasp_directory(from, grasp), grasp_directory(to, grasp));
        fs::create_dir_all(&target).with_context(|| target.display().to_string())?;
        for (name, most) in FILES {
            save(&target.join(name), &read(&source.join(name), most)?)?;
        }
    }
    let curves = from.join("training.jsonl");
    if curves.is_file() {
        save(&to.join("training.jsonl"), &read(&curves, MAX_LINES_BYTES)?)?;
    }
    Ok(())
}

/// The lines of a JSON Lines file, none if there is no such file; a damaged line is refused with its number.
pub fn json_lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, Failure> {
    if path.is_file() { parse_lines(path, &read(path, MAX_LINES_BYTES)?) } else { Ok(Vec::new()) }
}

/// All lines that came to their end: a kill may have cut the last one.
pub(crate) fn whole_lines(content: &[u8]) -> &[u8] {
    &content[..content.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1)]
}

/// The lines of a JSON Lines file with this content; a damaged line is refused with its number.
pub(crate) fn parse_lines<T: DeserializeOwned>(path: &Path, content: &[u8]) -> Result<Vec<T>, Failure> {
    let text = str::from_utf8(content).with_context(|| format!("{}: not UTF-8", path.display())).or_bad_input()?;
    let parse = |(number, line): (usize, &str)| {
        serde_json::from_str(line).with_context(|| format!("{}: line {}", path.display(), number + 1)).or_bad_input()
    };
    text.lines().enumerate().map(parse).collect()
}
