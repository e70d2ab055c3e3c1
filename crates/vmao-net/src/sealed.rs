//! Named arrays and a description in one safetensors file, with a digest over all of it: no change to it goes unnoticed.
//!
//! The file's metadata has one entry, `vmao`: the digest in hexadecimal, a space, the description as JSON. The digest is the SHA-256
//! of the description's text and then, in the order of the names, of each array's name and little-endian bytes.

use crate::error::Error;
use crate::parameters::{Layout, Parameters, Spec, Start};
use safetensors::{Dtype, SafeTensorError, SafeTensors, tensor::TensorView};
use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use vmao_core::wording::excerpt;

/// Name of the metadata's entry.
const ENTRY: &str = "vmao";

/// Arrays on their way into a file.
#[derive(Debug, Default)]
pub(crate) struct Sealing {
    arrays: BTreeMap<String, (Vec<usize>, Vec<u8>)>,
}

impl Sealing {
    /// Adds the arrays of a layout, each under `prefix` and its own name; empty ones are left out.
    pub(crate) fn add(&mut self, prefix: &str, layout: &Layout, values: &[Vec<f32>]) {
        for (spec, values) in layout.specs().iter().zip(values).filter(|(_, values)| !values.is_empty()) {
            let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
            self.arrays.insert(format!("{prefix}{}", spec.name), (stored_shape(spec), bytes));
        }
    }

    /// The file.
    pub(crate) fn finish(&self, description: &impl Serialize) -> Result<Vec<u8>, Error> {
        let text = serde_json::to_string(description).map_err(|error| Error::ConfigJson { reason: error.to_string() })?;
        let digest = digest(&text, self.arrays.iter().map(|(name, (_, bytes))| (name.as_str(), bytes.as_slice())));
        let refuse = |error: SafeTensorError| Error::NotSafetensors { bytes: 0, reason: error.to_string() };
        let mut views = Vec::with_capacity(self.arrays.len());
        for (name, (shape, bytes)) in &self.arrays {
            views.push((name, TensorView::new(Dtype::F32, shape.clone(), bytes).map_err(refuse)?));
        }
        let metadata = std::iter::once((ENTRY.to_owned(), format!("{digest} {text}"))).collect();
        safetensors::serialize(views, Some(metadata)).map_err(refuse)
    }
}

/// A file that is being read; what it holds is trusted after [`Sealed::finish`] only.
#[derive(Debug)]
pub(crate) struct Sealed<'a> {
    file: SafeTensors<'a>,
    digest: String,
    text: String,
    /// Names of arrays that were not asked for yet.
    left: Vec<String>,
}

impl<'a> Sealed<'a> {
    /// Reads the file's header.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, Error> {
        let refuse = |reason: String| Error::NotSafetensors { bytes: bytes.len(), reason: excerpt(&reason) };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| refuse(error.to_string()))?;
        let file = SafeTensors::deserialize(bytes).map_err(|error| refuse(error.to_string()))?;
        let entry = header.metadata().as_ref().and_then(|entries| entries.get(ENTRY));
        let Some((digest, text)) = entry.and_then(|entry| entry.split_once(' ')) else {
            return Err(refuse(format!("no entry `{ENTRY}` of digest and description in its metadata")));
        };
        let mut left: Vec<String> = file.names().into_iter().map(str::to_owned).collect();
        left.sort_unstable();
        let (digest, text) = (digest.to_owned(), text.to_owned());
        Ok(Self { file, digest, text, left })
    }

    /// The description.
    pub(crate) fn description<D: DeserializeOwned>(&self) -> Result<D, Error> {
        serde_json::from_str(&self.text).map_err(|error| Error::ConfigJson { reason: excerpt(&error.to_string()) })
    }

    /// The arrays of a layout under `prefix`: all, or those that are trained.
    pub(crate) fn parameters(&mut self, prefix: &str, layout: &Layout, wanted: Wanted) -> Result<Parameters, Error> {
        let array = |spec: &Spec| match wanted {
            Wanted::Moments if !spec.is_trained() => Ok(Vec::new()),
            Wanted::Moments => self.array(&format!("{prefix}{}", spec.name), spec, prefix.contains("second")),
            Wanted::Weights => self.array(&format!("{prefix}{}", spec.name), spec, spec.name.ends_with("running_var")),
        };
        Ok(Parameters { values: layout.specs().iter().map(array).collect::<Result<_, _>>()? })
    }

    fn array(&mut self, name: &str, spec: &Spec, is_square: bool) -> Result<Vec<f32>, Error> {
        let Ok(view) = self.file.tensor(name) else {
            let available = vmao_core::wording::listed(self.left.iter().map(String::as_str));
            return Err(Error::MissingTensor { name: name.to_owned(), available });
        };
        let expected = stored_shape(spec);
        if view.dtype() != Dtype::F32 || view.shape() != expected {
            return Err(Error::TensorShape {
                name: name.to_owned(),
                found: excerpt(&format!("{:?} {:?}", view.dtype(), view.shape())),
                expected: format!("{:?} {expected:?}", Dtype::F32),
            });
        }
        let array: Vec<f32> = view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if let Some(element) = array.iter().position(|x| !x.is_finite() || (is_square && *x < 0.0)) {
            let expected = if is_square { "finite values of zero or more" } else { "finite values" };
            let (name, value) = (name.to_owned(), array[element]);
            return Err(Error::TensorValue { name, value, element, expected: expected.to_owned() });
        }
        self.left.retain(|left| left != name);
        Ok(array)
    }

    /// Refuses a file with arrays that nobody asked for, and one that is not as it was written.
    pub(crate) fn finish(self, of_what: &str) -> Result<(), Error> {
        if let Some(name) = self.left.first() {
            return Err(Error::UnknownTensor { name: excerpt(name), kind: of_what.to_owned() });
        }
        let mut views = self.file.tensors();
        views.sort_unstable_by(|(a, _), (b, _)| a.cmp(b));
        let found = digest(&self.text, views.iter().map(|(name, view)| (name.as_str(), view.data())));
        if found != self.digest {
            return Err(Error::Altered { found, expected: excerpt(&self.digest) });
        }
        Ok(())
    }
}

/// Which arrays of a layout a file holds.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Wanted {
    /// All of them.
    Weights,
    /// The optimiser's moments of those that are trained.
    Moments,
}

fn digest<'a>(text: &str, arrays: impl Iterator<Item = (&'a str, &'a [u8])>) -> String {
    let mut hash = Sha256::new();
    hash.update(text.as_bytes());
    for (name, bytes) in arrays {
        hash.update(name.as_bytes());
        hash.update(bytes);
    }
    hexadecimal(hash)
}

/// The hash in lower-case hexadecimal.
pub(crate) fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn stored_shape(spec: &Spec) -> Vec<usize> {
    match spec.start {
        Start::Normal(_) => spec.shape.to_vec(),
        Start::Constant(_) | Start::Statistic(_) => vec![spec.shape[1]],
    }
}
