//! From a data set to checkpoints: one network for each part, `grasp-0` for the object's first and so on.

use crate::config::Config;
use crate::failure::{Failure, OrBadInput};
use crate::learned_contacts::{LearnedContacts, methods};
use crate::output::{progress_bar, write_whole};
use crate::results::Method;
use crate::scenes::grasps;
use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use vmao_core::record::TrialRecord;
use vmao_net::{Checkpoint, ContactNetwork, Device, EpochReport, Example, ModelKind, train};

/// Largest checkpoint file that is read (bytes).
const MAX_CHECKPOINT_BYTES: u64 = 256 << 20;

/// The files of a network.
const CHECKPOINT_FILES: [&str; 2] = ["model.safetensors", "config.json"];

/// One line of `training.jsonl`. Losses in nats; none where there was nothing to measure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochLine {
    /// Which grasp step's network.
    pub grasp: usize,
    /// From one.
    pub epoch: usize,
    /// Cross-entropy on the training examples.
    pub train_reconstruction: f32,
    /// KL divergence on the training examples; zero for Top-1.
    pub train_kl: f32,
    /// Cross-entropy on the validation examples.
    pub validation_reconstruction: Option<f32>,
    /// KL divergence on the validation examples.
    pub validation_kl: Option<f32>,
    /// Weight of the divergence.
    pub beta: f32,
    /// Adam's step size.
    pub learning_rate: f32,
}

/// The training examples of `part`: what was seen before the successful grasps of it, and where they touched.
pub fn examples(records: &[TrialRecord], part: usize) -> Vec<Example> {
    let successes = records.iter().filter(|record| record.outcome.is_success());
    successes
        .flat_map(|record| record.grasps.iter().filter(|grasp| usize::from(grasp.contact.part.0) == part))
        .map(|grasp| Example {
            points: grasp.observation.points.clone(),
            colors: grasp.observation.colors.clone(),
            contacts: grasp.contact.fingers.map(|point| (grasp.world_from_part * point).coords.map(|x| x as f32).into()),
        })
        .collect()
}

/// Trains the networks of all grasp steps of `kind` on `device` into `directory`: `grasp-0/`, `grasp-1/`, … and `training.jsonl`.
pub fn train_all(
    config: &Config,
    kind: ModelKind,
    records: &[TrialRecord],
    seed: u64,
    device: Device,
    directory: &Path,
) -> Result<Vec<EpochLine>, Failure> {
    let grasps = grasps(config)?;
    let mut lines = Vec::new();
    let bar = progress_bar(&format!("train {}", kind.title()), (grasps * config.train.epochs) as u64);
    for grasp in 0..grasps {
        let examples = examples(records, grasp);
        let mut on_epoch = |report: &EpochReport| {
            let line = epoch_line(grasp, report);
            let validation = line.validation_reconstruction.unwrap_or(line.train_reconstruction);
            bar.set_prefix(format!("grasp {}, cross-entropy {validation:.2}, KL {:.2}", grasp + 1, line.train_kl));
            bar.inc(1);
            lines.push(line);
            ControlFlow::Continue(())
        };
        let seed = vmao_core::random::Stream::new(seed, &[TRAINING, grasp as u64]).bits();
        let checkpoint = train(kind, &config.network, &config.train, &examples, u64::from(seed), device, &mut on_epoch)
            .with_context(|| format!("grasp {} of {}, {} successful examples", grasp + 1, kind.title(), examples.len()))?;
        save(&checkpoint, &grasp_directory(directory, grasp))?;
    }
    bar.finish();
    let path = directory.join("training.jsonl");
    write_whole(&path, |file| lines.iter().try_for_each(|line| writeln!(file, "{}", serde_json::to_string(line)?)))
        .with_context(|| path.display().to_string())?;
    Ok(lines)
}

/// Names the stream that training seeds are drawn from.
const TRAINING: u64 = 1 << 33;

fn epoch_line(grasp: usize, report: &EpochReport) -> EpochLine {
    EpochLine {
        grasp,
        epoch: report.epoch,
        train_reconstruction: report.training.reconstruction,
        train_kl: report.training.kl,
        validation_reconstruction: report.validation.map(|elbo| elbo.reconstruction),
        validation_kl: report.validation.map(|elbo| elbo.kl),
        beta: report.beta,
        learning_rate: report.learning_rate,
    }
}

fn grasp_directory(directory: &Path, grasp: usize) -> PathBuf {
    directory.join(format!("grasp-{grasp}"))
}

fn save(checkpoint: &Checkpoint, directory: &Path) -> Result<(), Failure> {
    fs::create_dir_all(directory).with_context(|| directory.display().to_string())?;
    let files = [("model.safetensors", checkpoint.to_safetensors()?), ("config.json", checkpoint.config_json()?.into_bytes())];
    for (name, bytes) in files {
        let path = directory.join(name);
        write_whole(&path, |file| file.write_all(&bytes)).with_context(|| path.display().to_string())?;
    }
    Ok(())
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
    let config = String::from_utf8(read(&directory.join("config.json"))?)
        .with_context(|| format!("{}: not UTF-8", directory.join("config.json").display()))
        .or_bad_input()?;
    let checkpoint = Checkpoint::from_safetensors(&read(&directory.join("model.safetensors"))?, &config)
        .with_context(|| directory.display().to_string())
        .or_bad_input()?;
    Ok(ContactNetwork::load(&checkpoint))
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let missing = || format!("{}: cannot be read, expected a checkpoint written by `vmao train`", path.display());
    let length = fs::metadata(path).with_context(missing).or_bad_input()?.len();
    if length > MAX_CHECKPOINT_BYTES {
        return Err(Failure::bad_input(format!("{}: {length} bytes, expected at most {MAX_CHECKPOINT_BYTES}", path.display())));
    }
    fs::read(path).with_context(missing).or_bad_input()
}

/// Refuses to go on with other networks than those that a run holds.
pub fn check_same(given: &Path, kept: &Path, grasps: usize) -> Result<(), Failure> {
    for grasp in 0..grasps {
        for name in CHECKPOINT_FILES {
            let (given, kept) = (grasp_directory(given, grasp).join(name), grasp_directory(kept, grasp).join(name));
            if read(&given)? != read(&kept)? {
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
        for name in CHECKPOINT_FILES {
            let bytes = read(&source.join(name))?;
            let path = target.join(name);
            write_whole(&path, |file| file.write_all(&bytes)).with_context(|| path.display().to_string())?;
        }
    }
    let curves = from.join("training.jsonl");
    if curves.is_file() {
        let bytes = read(&curves)?;
        let path = to.join("training.jsonl");
        write_whole(&path, |file| file.write_all(&bytes)).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

/// The losses beside a checkpoint; none if there is no `training.jsonl`.
pub fn curves(directory: &Path) -> Result<Vec<EpochLine>, Failure> {
    json_lines(&directory.join("training.jsonl"))
}

/// The lines of a JSON Lines file, none if there is no such file; a damaged line is refused with its number.
pub fn json_lines<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Vec<T>, Failure> {
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let text = String::from_utf8(read(path)?).with_context(|| format!("{}: not UTF-8", path.display())).or_bad_input()?;
    let parse = |(number, line): (usize, &str)| {
        serde_json::from_str(line).with_context(|| format!("{}: line {}", path.display(), number + 1)).or_bad_input()
    };
    text.lines().enumerate().map(parse).collect()
}
