//! Does it learn a distribution? A bar that may be gripped at two places: V-MAO must find both, Top-1 can name only one.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bar_world;

use bar_world::{examples, scenes, score};
use std::ops::ControlFlow;
use vmao_net::{Checkpoint, ContactNetwork, Device, EpochReport, ModelKind, NetworkConfig, TrainingConfig, train};

/// Fewer points and scenes than the demo's, to be done in seconds.
fn learned(kind: ModelKind, epochs: usize) -> (Checkpoint, Vec<EpochReport>) {
    let mut network = NetworkConfig::small();
    network.points = 700;
    let training = TrainingConfig { epochs, ..TrainingConfig::small() };
    let mut reports = Vec::new();
    let checkpoint = train(kind, &network, &training, &examples(&scenes(1, 150)), 0, Device::Cpu, &mut |report| {
        reports.push(*report);
        ControlFlow::Continue(())
    });
    (checkpoint.unwrap(), reports)
}

#[test]
fn vmao_finds_both_places_with_both_fingers_opposite_and_its_latent_code_does_not_collapse() {
    let (checkpoint, reports) = learned(ModelKind::Vmao, 40);
    let last = reports[reports.len() - 1];
    let score = score(&ContactNetwork::load(&checkpoint), &scenes(2, 30), 12);
    println!("{score:.3?} {last:.3?} {:?}", checkpoint.validation);
    assert!(last.training.kl > std::f32::consts::LN_2, "one bit at least: which of the two places; {last:?}");
    assert!(last.validation.unwrap().reconstruction < reports[0].validation.unwrap().reconstruction - 1.0, "{last:?}");
    assert!(score.both > 0.9 && (0.25..0.75).contains(&score.positive), "both places are found: {score:?}");
    assert!(score.across > 0.8, "on either side of the bar: {score:?}");
    assert!(score.same_mode > 0.8, "the fingers agree on the place: {score:?}");
    assert!(score.hits > 0.75 && score.mean_error < 0.006, "and touch where they may: {score:?}");
}

#[test]
fn top1_has_one_answer_for_a_scene_however_often_it_is_asked() {
    let (checkpoint, reports) = learned(ModelKind::Top1, 25);
    let network = ContactNetwork::load(&checkpoint);
    let score = score(&network, &scenes(2, 30), 3);
    println!("{score:.3?}");
    assert_eq!(score.both, 0.0, "{score:?}");
    assert!(reports.iter().all(|r| r.training.kl == 0.0));
    assert!(score.mean_error < 0.012, "what it names is a right place: {score:?}");
    // Half the mass on either place: about ln 2 worse than a network that is told which.
    let left = scenes(2, 30).into_iter().map(|scene| {
        let map = network.map(&scene.example.points, &scene.example.colors, &[]).unwrap();
        let left = |i: usize| scene.in_bar(scene.example.points[i])[0] < 0.0;
        (0..scene.example.points.len()).filter(|&i| left(i)).map(|i| f64::from(map.fingers[0][i])).sum::<f64>() / 30.0
    });
    let left: f64 = left.sum();
    assert!((0.3..0.7).contains(&left), "its map holds both places: {left}");
}
