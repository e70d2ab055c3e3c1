//! The readers of checkpoints and training states, to their end: what the fuzzer runs, and the replay of its corpus.
//!
//! A reader either refuses with a message or gives something sound; both are checked, nothing is returned.

use crate::checkpoint::Checkpoint;
use crate::cloud::Example;
use crate::config::{AbstractionConfig, ModelKind, NetworkConfig, TrainingConfig, UpConvConfig};
use crate::course::Training;
use crate::device::Device;
use crate::error::Error;
use crate::lesson::Lesson;

/// A longer message would be the file, not what is wrong with it.
const LONGEST_MESSAGE: usize = 4000;

/// A checkpoint: two bytes for the length of its configuration, low byte first, the configuration, the weights.
pub fn checkpoint(bytes: &[u8]) {
    let Some((length, rest)) = bytes.split_first_chunk::<2>() else { return };
    let (config, weights) = rest.split_at(rest.len().min(u16::from_le_bytes(*length).into()));
    let Ok(config) = std::str::from_utf8(config) else { return };
    match Checkpoint::from_safetensors(weights, config) {
        Ok(found) => {
            assert!(found.parameters.values.iter().flatten().all(|x| x.is_finite()), "a weight that is no number");
            let written = found.to_safetensors().and_then(|bytes| Checkpoint::from_safetensors(&bytes, &found.config_json()?));
            assert!(written.is_ok_and(|written| written == found), "a checkpoint that changes when it is written");
        }
        Err(error) => check_message(&error),
    }
}

/// The state of a training of two small clouds.
pub fn state(bytes: &[u8]) {
    with_training(ModelKind::Vmao, |training| match training.restore(bytes) {
        Ok(()) => assert!(training.state().is_ok_and(|bytes| training.restore(&bytes).is_ok()), "a state that cannot be kept"),
        Err(error) => check_message(&error),
    });
}

/// Files that the two readers take, by reader and name.
pub fn sound() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let mut files = Vec::new();
    for kind in ModelKind::ALL {
        with_training(kind, |training| {
            let learned = training.epoch().and_then(|_| {
                let config = training.config_json()?.into_bytes();
                let length = (config.len() as u16).to_le_bytes().to_vec();
                let weights = training.best().map_or(Err(Error::NothingToSave), |best| best.to_safetensors())?;
                Ok(([length, config, weights].concat(), training.state()?))
            });
            if let Ok((checkpoint, state)) = learned {
                files.push(("checkpoint", kind.name(), checkpoint));
                files.extend((kind == ModelKind::Vmao).then_some(("state", kind.name(), state)));
            }
        });
    }
    files
}

fn check_message(error: &Error) {
    let length = error.to_string().len();
    assert!(length < LONGEST_MESSAGE, "a message of {length} bytes");
}

/// The smallest training that has all that a training has.
fn with_training(kind: ModelKind, work: impl FnOnce(&mut Training)) {
    let point = |i: u8| [f32::from(i) * 0.01, f32::from(i % 3) * 0.02, 0.02];
    let points: Vec<[f32; 3]> = (0..6).map(point).collect();
    let example = Example { colors: vec![[0.5; 3]; points.len()], contacts: [points[0], points[3]], points };
    let network = NetworkConfig {
        abstraction: vec![AbstractionConfig { num_centroids: 2, radius: 0.05, num_neighbours: 2, channels: vec![2] }],
        up_conv: vec![UpConvConfig { num_neighbours: 1, channels: vec![2], refine: vec![2] }],
        head: 2,
        latent_size: 1,
        ..NetworkConfig::small()
    };
    let training = TrainingConfig { epochs: 2, validation_fraction: 0.0, ..TrainingConfig::small() };
    let (examples, device) = (&[example.clone(), example], Device::Cpu);
    let lesson = Lesson { kind, network: &network, training: &training, examples, seed: 0, device };
    let made = Training::new(&lesson);
    assert!(made.is_ok(), "{made:?}");
    if let Ok(mut training) = made {
        work(&mut training);
    }
}
