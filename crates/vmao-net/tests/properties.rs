//! What holds for any weights: permutation, translation, thread count, seeds, refusals.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bar_world;

use bar_world::{examples, scenes};
use std::ops::ControlFlow;
use vmao_core::contact::ContactMap;
use vmao_core::random::Stream;
use vmao_net::{Checkpoint, ContactNetwork, Device, Error, Example, ModelKind, NetworkConfig, TrainingConfig, train};

fn quick() -> (NetworkConfig, TrainingConfig) {
    let mut network = NetworkConfig::small();
    network.points = 400;
    let mut training = TrainingConfig::small();
    (training.epochs, training.batch_size, training.validation_fraction) = (2, 5, 0.2);
    (network, training)
}

fn trained(kind: ModelKind, seed: u64) -> Checkpoint {
    let (network, training) = quick();
    train(kind, &network, &training, &examples(&scenes(3, 20)), seed, Device::Cpu, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

fn gap(a: &ContactMap, b: &ContactMap) -> f32 {
    let channel = |f: usize| a.fingers[f].iter().zip(&b.fingers[f]).fold(0.0_f32, |m, (x, y)| m.max((x - y).abs()));
    channel(0).max(channel(1))
}

#[test]
fn weights_and_maps_are_bit_equal_for_any_number_of_threads() {
    let one = in_pool(1, || trained(ModelKind::Vmao, 4));
    let two = in_pool(2, || trained(ModelKind::Vmao, 4));
    let five = in_pool(5, || trained(ModelKind::Vmao, 4));
    let bytes = one.to_safetensors().unwrap();
    assert_eq!(bytes, two.to_safetensors().unwrap());
    assert_eq!(bytes, five.to_safetensors().unwrap());
    assert_ne!(bytes, trained(ModelKind::Vmao, 5).to_safetensors().unwrap(), "another seed gives other weights");
    let scene = &scenes(8, 1)[0].example;
    let network = ContactNetwork::load(&one);
    let map = || network.map(&scene.points, &scene.colors, &[0.3, -1.0, 0.5]).unwrap();
    assert_eq!(in_pool(1, map), in_pool(3, map));
}

#[test]
fn a_map_follows_its_points_when_they_are_listed_anew_and_sums_to_one() {
    let network = ContactNetwork::load(&trained(ModelKind::Vmao, 1));
    let scene = &scenes(8, 1)[0].example;
    let latent = [0.5, 1.0, -0.7];
    let map = network.map(&scene.points, &scene.colors, &latent).unwrap();
    for finger in &map.fingers {
        assert_eq!(finger.len(), scene.points.len());
        assert!((finger.iter().map(|&p| f64::from(p)).sum::<f64>() - 1.0).abs() < 1e-5);
        let uniform = 1.0 / finger.len() as f32;
        assert!(finger.iter().any(|p| (p - uniform).abs() > 0.2 * uniform), "a flat map would follow anything");
    }
    let order = Stream::new(1, &[]).permutation(scene.points.len());
    let list = |v: &[[f32; 3]]| order.iter().map(|&i| v[i]).collect::<Vec<_>>();
    let listed = network.map(&list(&scene.points), &list(&scene.colors), &latent).unwrap();
    let back = ContactMap { fingers: map.fingers.clone().map(|f| order.iter().map(|&i| f[i]).collect()) };
    assert!(gap(&listed, &back) < 1e-6, "{}", gap(&listed, &back));
}

#[test]
fn a_map_does_not_change_when_the_scene_is_moved_or_turned_on_the_table_but_does_when_it_is_lifted() {
    let network = ContactNetwork::load(&trained(ModelKind::Vmao, 1));
    let scene = &scenes(8, 1)[0].example;
    let moved = |turn: f32, by: [f32; 3]| {
        let (sin, cos) = turn.sin_cos();
        let place = |p: &[f32; 3]| [cos * p[0] - sin * p[1] + by[0], sin * p[0] + cos * p[1] + by[1], p[2] + by[2]];
        let points: Vec<[f32; 3]> = scene.points.iter().map(place).collect();
        network.map(&points, &scene.colors, &[0.0; 3]).unwrap()
    };
    let there = moved(0.0, [0.0; 3]);
    let largest = there.fingers.iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
    let along = gap(&there, &moved(0.0, [0.3125, -0.125, 0.0]));
    let turned = gap(&there, &moved(2.5, [0.0; 3]));
    let up = gap(&there, &moved(0.0, [0.0, 0.0, 0.1]));
    // Rounding moves points over the edges of neighbourhoods, so equal within a few percent of the largest value, not to the last bit.
    assert!(along < 0.1 * largest && turned < 0.1 * largest && up > 0.3 * largest, "{along} {turned} {up} of {largest}");
}

#[test]
fn clouds_of_any_size_are_read_and_too_small_ones_refused() {
    let network = ContactNetwork::load(&trained(ModelKind::Top1, 1));
    assert_eq!((network.latent_size(), network.kind()), (0, ModelKind::Top1));
    let scene = &scenes(8, 1)[0].example;
    for count in [network.fewest_points(), 333, 1020] {
        let map = network.map(&scene.points[..count], &scene.colors[..count], &[]).unwrap();
        assert_eq!(map.fingers[1].len(), count);
    }
    let few = network.map(&scene.points[..100], &scene.colors[..100], &[]).unwrap_err();
    assert_eq!(few.to_string(), "cloud: found 100 points, expected at least 192");
    let latent = network.map(&scene.points, &scene.colors, &[1.0]).unwrap_err();
    assert_eq!(latent.to_string(), "latent code: found [1.0], expected 0 finite numbers");
    let mut points = scene.points.clone();
    points[7][1] = f32::NAN;
    assert!(network.map(&points, &scene.colors, &[]).unwrap_err().to_string().starts_with("point 7: found ["));
    let equal = network.map(&vec![[0.1, 0.2, 0.05]; 200], &vec![[0.5; 3]; 200], &[]).unwrap();
    assert!(equal.fingers[0].iter().all(|p| (p - 0.005).abs() < 1e-4), "equal points are equally likely");
}

#[test]
fn training_refuses_what_it_cannot_learn_from() {
    let (network, training) = quick();
    let good = examples(&scenes(3, 6));
    let run = |network: &NetworkConfig, training: &TrainingConfig, examples: &[Example]| {
        train(ModelKind::Vmao, network, training, examples, 0, Device::Cpu, &mut |_| ControlFlow::Continue(())).unwrap_err()
    };
    assert_eq!(run(&network, &training, &good[..1]), Error::TooFewExamples { found: 1, needed: 2 });
    let mut bad = good.clone();
    bad[3].contacts[1][2] = f32::INFINITY;
    assert!(run(&network, &training, &bad).to_string().starts_with("training example 3: contacts are "));
    bad = good.clone();
    bad[2].colors.pop();
    assert_eq!(
        run(&network, &training, &bad).to_string(),
        "training example 2: cloud: found 1019 colours for 1020 points, expected one for each"
    );
    let wrong = TrainingConfig { batch_size: 0, ..training.clone() };
    assert_eq!(run(&network, &wrong, &good).to_string(), "batch_size is 0; it must be 1 to 4096");
}

#[test]
fn a_loss_that_is_no_number_names_step_and_batch() {
    let (network, mut training) = quick();
    training.learning_rate = 1e30;
    let run =
        train(
            ModelKind::Vmao,
            &network,
            &training,
            &examples(&scenes(3, 20)),
            0,
            Device::Cpu,
            &mut |_| ControlFlow::Continue(()),
        );
    let error = run.unwrap_err();
    assert!(
        matches!(error, Error::Diverged { step: 1.., epoch: 1, batch: Some(2..), ref examples, .. } if examples.len() == 5),
        "{error}"
    );
}

#[test]
fn a_training_can_be_ended_early_and_reports_every_epoch() {
    let (network, mut training) = quick();
    training.epochs = 50;
    let mut epochs = Vec::new();
    let checkpoint = train(ModelKind::Top1, &network, &training, &examples(&scenes(3, 10)), 0, Device::Cpu, &mut |report| {
        epochs.push(report.epoch);
        assert!(report.epochs == 50 && report.training.kl == 0.0 && report.validation.is_some());
        if report.epoch == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(epochs, vec![1, 2, 3]);
    assert!((1..=3).contains(&checkpoint.unwrap().epoch));
}
