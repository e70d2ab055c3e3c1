//! The whole objective: gradients by finite differences, prediction against training, and one batch learned by heart.

use crate::batch::{Batch, Prepared};
use crate::cloud::Example;
use crate::config::{AbstractionConfig, LatentPlacement, ModelKind, NetworkConfig, TrainingConfig, UpConvConfig};
use crate::device::Device;
use crate::kernels::cross_entropy::cross_entropy;
use crate::kernels::finite_difference::{check, dot, normal};
use crate::network::ContactNetwork;
use crate::training::Trainer;
use vmao_core::random::Stream;

/// Small, and no two sizes equal.
fn tiny() -> NetworkConfig {
    let down = |num_centroids, radius, num_neighbours, channels: &[usize]| AbstractionConfig {
        num_centroids,
        radius,
        num_neighbours,
        channels: channels.to_vec(),
    };
    let up = |num_neighbours, channels: &[usize], refine: &[usize]| UpConvConfig {
        num_neighbours,
        channels: channels.to_vec(),
        refine: refine.to_vec(),
    };
    NetworkConfig {
        points: 61,
        abstraction: vec![down(23, 0.05, 7, &[8, 9]), down(5, 0.1, 6, &[10, 11])],
        up_conv: vec![up(2, &[12], &[13]), up(3, &[14], &[15])],
        head: 16,
        latent_size: 3,
        latent_placement: LatentPlacement::EveryLevel,
        beta: 0.1,
        free_bits: 0.0,
        warm_up: 0.0,
        ..NetworkConfig::small()
    }
}

fn example(seed: u64) -> Example {
    let mut s = Stream::new(seed, &[]);
    let points: Vec<[f32; 3]> = (0..61).map(|_| [0.2, 0.1, 0.05].map(|size| (size * s.unit()) as f32)).collect();
    let colors = (0..61).map(|_| [s.unit() as f32, s.unit() as f32, s.unit() as f32]).collect();
    let contacts = [points[s.index(61)], points[s.index(61)]];
    Example { points, colors, contacts }
}

fn batch(config: &NetworkConfig, count: u64) -> (Vec<Prepared>, Batch) {
    let prepared: Vec<Prepared> = (0..count).map(|i| Prepared::new(&example(i), config, &mut Stream::new(0, &[i]))).collect();
    let members: Vec<_> = prepared.iter().map(|p| (p, p.cloud.clone())).collect();
    let batch = Batch::new(&members, config);
    (prepared, batch)
}

#[test]
fn gradients_of_the_whole_objective_match_finite_differences() {
    let config = tiny();
    let (_, batch) = batch(&config, 3);
    let noise = normal(5, 9);
    for kind in [ModelKind::Vmao, ModelKind::Top1] {
        let mut trainer = Trainer::new(kind, &config, &TrainingConfig::small(), 11, Device::Cpu);
        let noise = if kind == ModelKind::Vmao { noise.clone() } else { Vec::new() };
        // Maps that start flat hide errors: make the last weights large.
        for (values, spec) in trainer.parameters.values.iter_mut().zip(trainer.layout.specs()) {
            if spec.name.contains("logits") || spec.name.starts_with("posterior.") && !spec.name.contains("abstraction") {
                values.iter_mut().for_each(|v| *v *= 10.0);
            }
        }
        let gradients = trainer.objective(&batch, noise.clone(), config.beta).unwrap().gradients;
        let specs = trainer.layout.specs().to_vec();
        let mut checked = 0;
        for (i, spec) in specs.iter().enumerate() {
            let Some(gradient) = &gradients[i] else {
                assert!(!spec.is_trained(), "{} has no gradient", spec.name);
                continue;
            };
            if spec.name == "decoder.logits.bias" {
                assert!(gradient.iter().all(|g| g.abs() < 1e-6), "the softmax over points does not see a common shift");
                continue;
            }
            let start = trainer.parameters.values[i].clone();
            // Steps that change the loss by 1e-3 down to 1e-5, some tens of roundings of it.
            let length = dot(gradient, gradient).sqrt();
            let steps = [1e-3, 2e-4, 4e-5, 1e-5].map(|change| change / length.max(1e-3));
            check(&spec.name, &start, gradient, &steps, 0.05, |values| {
                trainer.parameters.values[i] = values.to_vec();
                let terms = trainer.objective(&batch, noise.clone(), config.beta).unwrap().terms;
                trainer.parameters.values[i] = start.clone();
                f64::from(terms.reconstruction) + f64::from(config.beta) * f64::from(terms.kl)
            });
            checked += 1;
        }
        assert!(checked >= 20, "{checked} arrays");
    }
}

#[test]
fn prediction_equals_training_when_the_statistics_are_the_batchs() {
    let config = tiny();
    let (prepared, batch) = batch(&config, 1);
    let mut trainer = Trainer::new(ModelKind::Vmao, &config, &TrainingConfig::small(), 2, Device::Cpu);
    // The first step takes the batch's moments whole; with a step size of zero the weights stay.
    let noise = vec![0.0; 3];
    let (trained, _) = trainer.step(&batch, noise, config.beta, 0.0).unwrap();
    let network = ContactNetwork::fold(&trainer.cvae, &config, &trainer.parameters);
    let scene = network.encode_prepared(&prepared[0]);
    let (mean, log_variance) = network.posterior(&scene, &prepared[0].maps).unwrap();
    let logits = network.logits(&scene, &mean);
    let reconstruction = cross_entropy(&logits, &prepared[0].maps, &[0, 61]).0;
    let kl: f32 = mean.iter().zip(&log_variance).map(|(m, v)| 0.5 * (m * m + v.exp() - 1.0 - v)).sum();
    assert!((reconstruction - trained.reconstruction).abs() < 1e-4, "{reconstruction} {}", trained.reconstruction);
    assert!((kl - trained.kl).abs() < 1e-4 * kl.max(1.0), "{kl} {}", trained.kl);
}

#[test]
fn one_batch_is_learned_by_heart() {
    let config = NetworkConfig { beta: 1e-3, ..tiny() };
    let (prepared, batch) = batch(&config, 4);
    let entropy: f32 = prepared.iter().map(|p| p.maps.iter().filter(|&&m| m > 0.0).map(|m| -m * m.ln()).sum::<f32>() / 8.0).sum();
    let mut trainer = Trainer::new(ModelKind::Vmao, &config, &TrainingConfig::small(), 2, Device::Cpu);
    let mut last = 0.0;
    let mut first = 0.0;
    for step in 0..300 {
        let noise = normal(step, 12);
        last = trainer.step(&batch, noise, config.beta, 5e-3).unwrap().0.reconstruction - entropy;
        if step == 0 {
            first = last;
        }
    }
    assert!(first > 1.0, "nothing to learn: {first}");
    assert!(last < 0.05, "{last} nats above the labels' entropy, from {first}");
}
