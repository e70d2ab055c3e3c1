//! Single training steps outside of a training, for benchmarks and for comparisons with other implementations.

use crate::batch::{Batch, Prepared};
use crate::checkpoint::{Checkpoint, Description};
use crate::cloud::{Example, FEATURES};
use crate::config::{ModelKind, NetworkConfig, TrainingConfig};
use crate::device::Device;
use crate::error::Error;
use crate::kernels::cross_entropy::FINGERS;
use crate::lesson::Lesson;
use crate::network::{ContactNetwork, EncodedScene};
use crate::training::{Elbo, Stopped, Trainer};
use rayon::prelude::*;
use safetensors::{Dtype, SafeTensorError, tensor::TensorView};
use vmao_core::random::Stream;

/// A network at its start and one batch of clouds, not augmented, to step on as often as wanted.
#[derive(Debug)]
pub struct Rehearsal {
    description: Description,
    trainer: Trainer,
    examples: Vec<Example>,
    prepared: Vec<Prepared>,
    batch: Batch,
    noise: Vec<f32>,
}

impl Rehearsal {
    /// One batch of all `examples`; the network starts, and the latent noise is drawn, from `seed`. Steps are computed on `device`.
    pub fn new(
        kind: ModelKind,
        network: &NetworkConfig,
        examples: Vec<Example>,
        seed: u64,
        device: Device,
    ) -> Result<Self, Error> {
        let training = TrainingConfig::small();
        let lesson = Lesson { kind, network, training: &training, examples: &examples, seed, device };
        lesson.check()?;
        let description = lesson.description();
        let trainer = Trainer::new(kind, network, &training, seed, device);
        let (prepared, batch) = ready(&examples, network);
        let mut stream = Stream::new(seed, &[LABEL_NOISE]);
        let noise = (0..examples.len() * trainer.cvae.latent_size()).map(|_| stream.normal() as f32).collect();
        Ok(Self { description, trainer, examples, prepared, batch, noise })
    }

    /// Orders the clouds and finds all neighbours again.
    pub fn search(&mut self) {
        (self.prepared, self.batch) = ready(&self.examples, &self.trainer.network);
    }

    /// Forward, backward, one step of Adam; returns the terms before it. Fails where a number is not finite.
    pub fn step(&mut self, learning_rate: f32) -> Result<Elbo, Error> {
        let beta = self.trainer.network.beta;
        let step = self.trainer.step(&self.batch, self.noise.clone(), beta, learning_rate);
        let examples = (0..self.examples.len()).collect();
        step.map(|(terms, _)| terms).map_err(|stopped| match stopped {
            Stopped::NotFinite(what, value) => Error::Diverged { what, value, step: 0, epoch: 1, batch: Some(1), examples },
            Stopped::Device(error) => error,
        })
    }

    /// Example `index` through the scene encoder, its neighbours as they were found before.
    pub fn encode(&self, network: &ContactNetwork, index: usize) -> EncodedScene {
        network.encode_prepared(&self.prepared[index])
    }

    /// The batch as another implementation needs it to take the same step, a safetensors file.
    ///
    /// `points` (world, as listed), `order` (farthest-point order of each cloud), and in that order `features`, `posterior_features`, `map_means`, `targets`, `noise`; for level i `down.i.sources`, `down.i.offsets` and `up.i.…`
    /// (rows of the whole batch, offsets in the layer's unit, all neighbours of a centre one after the other); `weight.NAME` of every
    /// trained array. Clouds lie one after the other and have the same size if the examples do.
    pub fn to_safetensors(&self) -> Result<Vec<u8>, Error> {
        let mut arrays: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
        let mut add = |name: String, columns: usize, values: &[f32]| {
            let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
            arrays.push((name, Dtype::F32, vec![values.len() / columns, columns], bytes));
        };
        let batch = &self.batch;
        let points: Vec<f32> = self.examples.iter().flat_map(|e| e.points.iter().flatten().copied()).collect();
        add("points".to_owned(), 3, &points);
        add("features".to_owned(), FEATURES, &batch.features);
        add("posterior_features".to_owned(), FEATURES + FINGERS, &batch.posterior_features);
        add("map_means".to_owned(), 3 * FINGERS, &batch.map_means);
        add("targets".to_owned(), FINGERS, &batch.targets);
        add("noise".to_owned(), self.trainer.cvae.latent_size().max(1), &self.noise);
        for (values, spec) in self.trainer.parameters.values.iter().zip(self.trainer.layout.specs()) {
            if spec.is_trained() {
                add(format!("weight.{}", spec.name), spec.shape[1], values);
            }
        }
        for (flow, layers) in [("down", &batch.down), ("up", &batch.up)] {
            for (i, edges) in layers.iter().enumerate() {
                add(format!("{flow}.{i}.offsets"), 3, &edges.offsets);
            }
        }
        let mut add = |name: String, values: &[u32]| {
            let bytes = values.iter().flat_map(|&x| (x as i32).to_le_bytes()).collect();
            arrays.push((name, Dtype::I32, vec![values.len()], bytes));
        };
        add("order".to_owned(), &self.prepared.iter().flat_map(|p| p.pyramid.order.iter().copied()).collect::<Vec<u32>>());
        for (flow, layers) in [("down", &batch.down), ("up", &batch.up)] {
            for (i, edges) in layers.iter().enumerate() {
                add(format!("{flow}.{i}.sources"), &edges.picks.sources);
            }
        }
        let refuse = |error: SafeTensorError| Error::NotSafetensors { bytes: 0, reason: error.to_string() };
        let views = arrays.iter().map(|(name, dtype, shape, bytes)| Ok((name, TensorView::new(*dtype, shape.clone(), bytes)?)));
        let views = views.collect::<Result<Vec<_>, _>>().map_err(refuse)?;
        safetensors::serialize(views, None).map_err(refuse)
    }

    /// The network as it is now.
    pub fn checkpoint(&self) -> Checkpoint {
        self.description.checkpoint(0, None, self.trainer.parameters.clone())
    }
}

/// Stream label of the latent noise.
const LABEL_NOISE: u64 = 6;

fn ready(examples: &[Example], network: &NetworkConfig) -> (Vec<Prepared>, Batch) {
    let prepare = |(i, example)| Prepared::new(example, network, &mut Stream::new(0, &[i as u64]));
    let prepared: Vec<Prepared> = examples.par_iter().enumerate().map(prepare).collect();
    let members: Vec<_> = prepared.iter().map(|p| (p, p.cloud.clone())).collect();
    let batch = Batch::new(&members, network);
    (prepared, batch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::SafeTensors;

    fn example(index: u64) -> Example {
        let mut s = Stream::new(3, &[index]);
        let points: Vec<[f32; 3]> = (0..230).map(|_| std::array::from_fn(|_| s.range(0.0, 0.1) as f32)).collect();
        let colors = vec![[0.5, 0.25, 0.75]; points.len()];
        let contacts = [points[3], points[90]];
        Example { points, colors, contacts }
    }

    #[test]
    fn a_search_finds_the_same_batch_and_steps_go_downhill() {
        let network = NetworkConfig::small();
        let mut rehearsal = Rehearsal::new(ModelKind::Vmao, &network, vec![example(0), example(1)], 5, Device::Cpu).unwrap();
        let before = rehearsal.to_safetensors().unwrap();
        rehearsal.search();
        assert_eq!(before, rehearsal.to_safetensors().unwrap());
        let first = rehearsal.step(1e-3).unwrap();
        let later = (0..5).map(|_| rehearsal.step(1e-3).unwrap()).last().unwrap();
        assert!(later.reconstruction < first.reconstruction, "{first:?} {later:?}");
        assert_ne!(before, rehearsal.to_safetensors().unwrap(), "the weights moved");
    }

    #[test]
    fn the_batch_names_every_neighbour_by_its_row() {
        let network = NetworkConfig::small();
        let rehearsal = Rehearsal::new(ModelKind::Vmao, &network, vec![example(0), example(1)], 5, Device::Cpu).unwrap();
        let bytes = rehearsal.to_safetensors().unwrap();
        let file = SafeTensors::deserialize(&bytes).unwrap();
        assert_eq!(file.tensor("features").unwrap().shape(), [460, 9]);
        let sources = file.tensor("down.0.sources").unwrap();
        let rows: Vec<i32> = sources.data().as_chunks::<4>().0.iter().map(|b| i32::from_le_bytes(*b)).collect();
        assert_eq!(rows.len(), 2 * 192 * 16);
        let (first, second) = rows.split_at(192 * 16);
        assert!(first.iter().all(|r| (0..230).contains(r)) && second.iter().all(|r| (230..460).contains(r)));
    }
}
