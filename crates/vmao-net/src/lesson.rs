//! What is to be learned, and the little of it that a file remembers.

use crate::checkpoint::Description;
use crate::cloud::{Example, check_cloud};
use crate::config::{ModelKind, NetworkConfig, TrainingConfig};
use crate::device::Device;
use crate::error::Error;
use crate::sealed::hexadecimal;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// All that decides a training's result.
#[derive(Debug, Clone, Copy)]
pub struct Lesson<'a> {
    /// With or without latent code.
    pub kind: ModelKind,
    /// The network.
    pub network: &'a NetworkConfig,
    /// How it is trained.
    pub training: &'a TrainingConfig,
    /// What it is trained and validated on.
    pub examples: &'a [Example],
    /// Start values, order of the examples, augmentation and noise.
    pub seed: u64,
    /// What computes.
    pub device: Device,
}

/// What a network was trained on, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// What trained it.
    pub device: Device,
    /// The training's seed.
    pub seed: u64,
    /// Number of examples, those for validation included.
    pub examples: usize,
    /// SHA-256 of the examples.
    pub examples_sha256: String,
    /// How it was trained.
    pub training: TrainingConfig,
}

impl Lesson<'_> {
    /// Refuses what cannot be learned: an invalid configuration, too few examples, examples that are not finite.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.network.validate()?;
        self.training.validate()?;
        if self.examples.len() < 2 {
            return Err(Error::TooFewExamples { found: self.examples.len(), needed: 2 });
        }
        for (index, example) in self.examples.iter().enumerate() {
            check_cloud(&example.points, &example.colors, self.network.fewest_points())
                .map_err(|error| Error::Example { index, problem: error.to_string() })?;
            if example.contacts.iter().flatten().any(|x| !x.is_finite()) {
                let problem = format!("contacts are {:?}, expected finite numbers", example.contacts);
                return Err(Error::Example { index, problem });
            }
        }
        Ok(())
    }

    pub(crate) fn description(&self) -> Description {
        Description::new(self.kind, self.network, &self.origin())
    }

    pub(crate) fn origin(&self) -> Origin {
        let mut hash = Sha256::new();
        for example in self.examples {
            let numbers = [&example.points[..], &example.colors, &example.contacts].map(<[[f32; 3]]>::as_flattened);
            for numbers in numbers {
                hash.update((numbers.len() as u64).to_le_bytes());
                numbers.iter().for_each(|x| hash.update(x.to_le_bytes()));
            }
        }
        let (device, seed, examples, training) = (self.device, self.seed, self.examples.len(), self.training.clone());
        Origin { device, seed, examples, examples_sha256: hexadecimal(hash), training }
    }
}
