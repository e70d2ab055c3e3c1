//! A trained network as bytes: weights in safetensors, everything else in JSON.

use crate::config::{ModelKind, NetworkConfig};
use crate::device::Device;
use crate::error::Error;
use crate::parameters::{Layout, Parameters, Spec, Start};
use crate::training::Elbo;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use serde::{Deserialize, Serialize};

/// What a network of a kind and configuration learned, and how well.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// With or without latent code.
    pub kind: ModelKind,
    /// The network.
    pub network: NetworkConfig,
    /// What trained it.
    pub device: Device,
    /// The epoch the weights are from, from one.
    pub epoch: usize,
    /// The validation terms of that epoch.
    pub validation: Option<Elbo>,
    pub(crate) parameters: Parameters,
}

/// What `config.json` beside the weights holds.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    format: u32,
    kind: ModelKind,
    network: NetworkConfig,
    /// Documents from before there was a choice have none.
    #[serde(default)]
    device: Device,
    epoch: usize,
    validation: Option<Elbo>,
}

/// Version of the checkpoint's names and meanings.
const FORMAT: u32 = 1;

impl Checkpoint {
    /// The weights as a safetensors file: float32, weights inputs × channels, vectors with one dimension.
    pub fn to_safetensors(&self) -> Result<Vec<u8>, Error> {
        let (layout, _) = self.kind.layers(&self.network);
        let bytes: Vec<Vec<u8>> =
            self.parameters.values.iter().map(|v| v.iter().flat_map(|x| x.to_le_bytes()).collect()).collect();
        let view = |(spec, bytes): (&Spec, &'_ Vec<u8>)| (spec.name.clone(), stored_shape(spec), bytes.len());
        let described: Vec<_> = layout.specs().iter().zip(&bytes).map(view).collect();
        let refuse =
            |error: safetensors::SafeTensorError, bytes: usize| Error::NotSafetensors { bytes, reason: error.to_string() };
        let mut views = Vec::with_capacity(bytes.len());
        for ((name, shape, length), bytes) in described.into_iter().zip(&bytes) {
            views.push((name, TensorView::new(Dtype::F32, shape, bytes).map_err(|e| refuse(e, length))?));
        }
        safetensors::serialize(views, None).map_err(|error| refuse(error, 0))
    }

    /// Kind, network and validation terms as JSON.
    pub fn config_json(&self) -> Result<String, Error> {
        let description = Description {
            format: FORMAT,
            kind: self.kind,
            network: self.network.clone(),
            device: self.device,
            epoch: self.epoch,
            validation: self.validation,
        };
        serde_json::to_string_pretty(&description).map_err(|error| Error::ConfigJson { reason: error.to_string() })
    }

    /// Reads both again. Refuses what is not exactly a network of the described kind with finite weights.
    pub fn from_safetensors(bytes: &[u8], config_json: &str) -> Result<Self, Error> {
        let description: Description =
            serde_json::from_str(config_json).map_err(|error| Error::ConfigJson { reason: error.to_string() })?;
        if description.format != FORMAT {
            let (found, expected) = (description.format.to_string(), FORMAT.to_string());
            return Err(Error::Config { field: "format".to_owned(), found, expected });
        }
        description.network.validate()?;
        let file = SafeTensors::deserialize(bytes)
            .map_err(|error| Error::NotSafetensors { bytes: bytes.len(), reason: error.to_string() })?;
        let (layout, _) = description.kind.layers(&description.network);
        let parameters = read(&layout, &file, description.kind)?;
        let Description { kind, network, device, epoch, validation, .. } = description;
        Ok(Self { kind, network, device, epoch, validation, parameters })
    }
}

fn read(layout: &Layout, file: &SafeTensors<'_>, kind: ModelKind) -> Result<Parameters, Error> {
    let mut names: Vec<&str> = file.names();
    names.sort_unstable();
    let mut values = Vec::with_capacity(layout.specs().len());
    for spec in layout.specs() {
        let Ok(view) = file.tensor(&spec.name) else {
            return Err(Error::MissingTensor { name: spec.name.clone(), available: names.join(", ") });
        };
        let expected = stored_shape(spec);
        if view.dtype() != Dtype::F32 || view.shape() != expected {
            return Err(Error::TensorShape {
                name: spec.name.clone(),
                found: format!("{:?} {:?}", view.dtype(), view.shape()),
                expected: format!("{:?} {expected:?}", Dtype::F32),
            });
        }
        let array: Vec<f32> = view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let is_variance = spec.name.ends_with("running_var");
        if let Some(element) = array.iter().position(|x| !x.is_finite() || (is_variance && *x < 0.0)) {
            let expected = if is_variance { "finite values of zero or more" } else { "finite values" };
            let (name, value) = (spec.name.clone(), array[element]);
            return Err(Error::TensorValue { name, value, element, expected: expected.to_owned() });
        }
        values.push(array);
    }
    if let Some(name) = names.iter().find(|name| layout.specs().iter().all(|spec| spec.name != **name)) {
        return Err(Error::UnknownTensor { name: (*name).to_owned(), kind: format!("{kind:?}") });
    }
    Ok(Parameters { values })
}

fn stored_shape(spec: &Spec) -> Vec<usize> {
    match spec.start {
        Start::Normal(_) => spec.shape.to_vec(),
        Start::Constant(_) | Start::Statistic(_) => vec![spec.shape[1]],
    }
}
