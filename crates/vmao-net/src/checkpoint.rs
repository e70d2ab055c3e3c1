//! A trained network as bytes: weights and how they came about in safetensors, the network's configuration also in JSON.

use crate::config::{ModelKind, NetworkConfig};
use crate::error::Error;
use crate::lesson::{Lesson, Origin};
use crate::parameters::Parameters;
use crate::sealed::{Sealed, Sealing, Wanted};
use crate::training::Elbo;
use serde::{Deserialize, Serialize};
use vmao_core::wording::excerpt;

/// What a network of a kind and configuration learned, and how well.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// With or without latent code.
    pub kind: ModelKind,
    /// The network.
    pub network: NetworkConfig,
    /// What it was trained on, and how.
    pub origin: Origin,
    /// The epoch the weights are from, from one.
    pub epoch: usize,
    /// The validation terms of that epoch.
    pub validation: Option<Elbo>,
    pub(crate) parameters: Parameters,
}

/// What `config.json` beside the weights holds: it is the same for all epochs of a training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Description {
    format: u32,
    kind: ModelKind,
    network: NetworkConfig,
    origin: Origin,
}

/// The description inside `model.safetensors`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Inside {
    config: Description,
    epoch: usize,
    validation: Option<Elbo>,
}

/// Version of the names and meanings of checkpoints and training states.
const FORMAT: u32 = 2;

impl Description {
    pub(crate) fn new(kind: ModelKind, network: &NetworkConfig, origin: &Origin) -> Self {
        Self { format: FORMAT, kind, network: network.clone(), origin: origin.clone() }
    }

    pub(crate) fn checkpoint(&self, epoch: usize, validation: Option<Elbo>, parameters: Parameters) -> Checkpoint {
        let Self { kind, network, origin, .. } = self.clone();
        Checkpoint { kind, network, origin, epoch, validation, parameters }
    }

    pub(crate) fn to_json(&self) -> Result<String, Error> {
        serde_json::to_string_pretty(self).map_err(|error| Error::ConfigJson { reason: error.to_string() })
    }

    /// Refuses what no network can be built from.
    fn validate(&self) -> Result<(), Error> {
        if self.format != FORMAT {
            let (found, expected) = (self.format.to_string(), FORMAT.to_string());
            return Err(Error::Config { field: "format".to_owned(), found, expected });
        }
        self.network.validate()
    }

    /// Refuses another description, naming the first value that differs; the words say where this one and the other are from.
    pub(crate) fn check_same(&self, what: &'static str, expected: &Self, whose: &'static str) -> Result<(), Error> {
        if self == expected {
            return Ok(());
        }
        // Through the text, in which single precision has no more digits than it needs.
        let parse = |text: &str| serde_json::from_str(text).map_err(|error| Error::ConfigJson { reason: error.to_string() });
        let (found, expected) = (parse(&self.to_json()?)?, parse(&expected.to_json()?)?);
        let (field, found, expected) = difference("", &found, &expected).unwrap_or_default();
        Err(Error::Differs { what, field: excerpt(&field), found: excerpt(&found), expected: excerpt(&expected), whose })
    }
}

/// Where two documents first differ, and what stands there in each.
fn difference(path: &str, a: &serde_json::Value, b: &serde_json::Value) -> Option<(String, String, String)> {
    use serde_json::Value::Object;
    if let (Object(a), Object(b)) = (a, b)
        && a.keys().eq(b.keys())
    {
        let dot = if path.is_empty() { "" } else { "." };
        return a.iter().find_map(|(key, a)| difference(&format!("{path}{dot}{key}"), a, &b[key]));
    }
    (a != b).then(|| (path.to_owned(), a.to_string(), b.to_string()))
}

impl Checkpoint {
    fn description(&self) -> Description {
        Description::new(self.kind, &self.network, &self.origin)
    }

    /// The weights as a safetensors file: float32, weights inputs × channels, vectors with one dimension.
    pub fn to_safetensors(&self) -> Result<Vec<u8>, Error> {
        let (layout, _) = self.kind.layers(&self.network);
        let mut sealing = Sealing::default();
        sealing.add("", &layout, &self.parameters.values);
        sealing.finish(&Inside { config: self.description(), epoch: self.epoch, validation: self.validation })
    }

    /// Kind, network and training as JSON.
    pub fn config_json(&self) -> Result<String, Error> {
        self.description().to_json()
    }

    /// Reads both again. Refuses what is not exactly a network of the described kind with finite weights, as it was written.
    pub fn from_safetensors(bytes: &[u8], config_json: &str) -> Result<Self, Error> {
        let outside: Description =
            serde_json::from_str(config_json).map_err(|error| Error::ConfigJson { reason: excerpt(&error.to_string()) })?;
        outside.validate()?;
        let mut file = Sealed::open(bytes)?;
        let (layout, _) = outside.kind.layers(&outside.network);
        let parameters = file.parameters("", &layout, Wanted::Weights)?;
        let Inside { config, epoch, validation } = file.description()?;
        outside.check_same("config.json", &config, "the file beside it")?;
        file.finish(&format!("{:?} network of this configuration", outside.kind))?;
        Ok(outside.checkpoint(epoch, validation, parameters))
    }

    /// Refuses a checkpoint that another lesson left, naming the first value that differs.
    pub fn check_of(&self, lesson: &Lesson<'_>) -> Result<(), Error> {
        self.description().check_same("the finished network", &lesson.description(), "this training")
    }
}
