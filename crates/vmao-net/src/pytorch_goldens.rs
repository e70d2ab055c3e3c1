//! The whole objective against an independent PyTorch implementation, which `goldens/mint.py` runs in float64.

use crate::batch::{Batch, Prepared};
use crate::cloud::{Example, FEATURES, features};
use crate::config::{ModelKind, NetworkConfig};
use crate::kernels::cross_entropy::FINGERS;
use crate::objective::{Objective, objective};
use crate::operations::{Fused, Operations};
use safetensors::SafeTensors;
use vmao_core::random::Stream;

/// Largest difference of any number of an array from PyTorch's, relative to the array's largest.
const TOLERANCE: f32 = 1e-4;

struct Golden<'a>(SafeTensors<'a>);

impl Golden<'_> {
    fn floats(&self, name: &str) -> Vec<f32> {
        let tensor = self.0.tensor(name).unwrap_or_else(|error| panic!("{name}: {error}"));
        tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
    }

    fn points(&self, name: &str) -> Vec<[f32; 3]> {
        self.floats(name).as_chunks::<3>().0.to_vec()
    }

    fn indices(&self, name: &str) -> Vec<u32> {
        let tensor = self.0.tensor(name).unwrap_or_else(|error| panic!("{name}: {error}"));
        tensor.data().as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
    }

    fn assert_close(&self, name: &str, found: &[f32]) {
        let expected = self.floats(name);
        assert_eq!(found.len(), expected.len(), "{name}");
        let largest = expected.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst <= TOLERANCE * largest, "{name}: off by {worst}, largest {largest}");
    }
}

/// Reads a golden file, runs the objective on its inputs and weights, and compares inputs as read, values and all gradients.
pub(crate) fn compare<O: Operations>(bytes: &[u8]) {
    let (_, header) = SafeTensors::read_metadata(bytes).unwrap();
    let notes = header.metadata().as_ref().unwrap();
    let config: NetworkConfig = serde_json::from_str(&notes["network"]).unwrap();
    let kind: ModelKind = serde_json::from_value(notes["kind"].clone().into()).unwrap();
    let golden = Golden(SafeTensors::deserialize(bytes).unwrap());

    let prepared = [0, 1].map(|b| {
        let of = |what: &str| format!("cloud.{b}.{what}");
        let contacts = golden.points(&of("contacts"));
        let example = Example {
            points: golden.points(&of("points")),
            colors: golden.points(&of("colors")),
            contacts: [contacts[0], contacts[1]],
        };
        let prepared = Prepared::new(&example, &config, &mut Stream::new(0, &[]));
        assert_eq!(prepared.pyramid.order, golden.indices(&of("order")), "farthest-point order of cloud {b}");
        let cloud = &prepared.cloud;
        golden.assert_close(&of("features"), &features(&cloud.points, &cloud.colors, &cloud.outward, &config));
        golden.assert_close(&of("maps"), &prepared.maps);
        prepared
    });
    let members: Vec<_> = prepared.iter().map(|p| (p, p.cloud.clone())).collect();
    let batch = Batch::new(&members, &config);
    assert_eq!(batch.features.len() / FEATURES, batch.targets.len() / FINGERS);

    let (layout, cvae) = kind.layers(&config);
    let mut parameters = layout.start(0);
    let specs = layout.specs();
    for (values, spec) in parameters.values.iter_mut().zip(specs).filter(|(_, spec)| spec.is_trained()) {
        let minted = golden.floats(&format!("weight.{}", spec.name));
        assert_eq!(minted.len(), values.len(), "{}", spec.name);
        *values = minted;
    }
    let noise = if kind == ModelKind::Vmao { golden.floats("noise") } else { Vec::new() };
    let found = objective::<O>((&layout, &cvae), &parameters, &batch, noise, config.beta, &Default::default());
    let Objective { terms, gradients, .. } = found;
    golden.assert_close("reconstruction", &[terms.reconstruction]);
    golden.assert_close("kl", &[terms.kl]);
    let mut checked = 0;
    for (gradient, spec) in gradients.iter().zip(specs).filter(|(_, spec)| spec.is_trained()) {
        let gradient = gradient.as_ref().unwrap_or_else(|| panic!("{} has no gradient", spec.name));
        // The softmax over points does not see a shift common to them: this gradient is zero up to rounding on both sides.
        if spec.name == "decoder.logits.bias" {
            assert!(gradient.iter().all(|g| g.abs() < 1e-6));
            continue;
        }
        golden.assert_close(&format!("gradient.{}", spec.name), gradient);
        checked += 1;
    }
    let minted = golden.0.names().iter().filter(|name| name.starts_with("gradient.")).count();
    assert_eq!(checked + 1, minted, "every array that PyTorch has a gradient of");
}

pub(crate) const EVERY_LEVEL: &[u8] = include_bytes!("../goldens/every_level.safetensors");
pub(crate) const BOTTLENECK: &[u8] = include_bytes!("../goldens/bottleneck.safetensors");
pub(crate) const TOP1: &[u8] = include_bytes!("../goldens/top1.safetensors");

#[test]
fn vmao_with_its_code_at_every_level_agrees_with_pytorch() {
    compare::<Fused>(EVERY_LEVEL);
}

#[test]
fn vmao_with_its_code_at_the_bottleneck_agrees_with_pytorch() {
    compare::<Fused>(BOTTLENECK);
}

#[test]
fn top1_agrees_with_pytorch() {
    compare::<Fused>(TOP1);
}
