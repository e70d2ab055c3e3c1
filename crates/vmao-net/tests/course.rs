//! A training that is put away and taken up again ends as if nothing had happened; one that learns nothing more ends early.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod bar_world;

use bar_world::{examples, scenes};
use std::ops::ControlFlow;
use vmao_core::random::Stream;
use vmao_net::{
    AugmentationConfig, Device, EpochReport, Error, Example, Lesson, ModelKind, NetworkConfig, Training, TrainingConfig, train,
};

struct World {
    network: NetworkConfig,
    training: TrainingConfig,
    examples: Vec<Example>,
    seed: u64,
}

impl World {
    fn quick(epochs: usize) -> Self {
        let network = NetworkConfig { points: 300, ..NetworkConfig::small() };
        let training = TrainingConfig { epochs, batch_size: 4, validation_fraction: 0.25, ..TrainingConfig::small() };
        Self { network, training, examples: examples(&scenes(3, 13)), seed: 6 }
    }

    fn lesson(&self, kind: ModelKind) -> Lesson<'_> {
        Lesson {
            kind,
            network: &self.network,
            training: &self.training,
            examples: &self.examples,
            seed: self.seed,
            device: Device::Cpu,
        }
    }

    fn begun(&self) -> Training {
        Training::new(&self.lesson(ModelKind::Vmao)).unwrap()
    }
}

fn to_its_end(training: &mut Training) -> Vec<EpochReport> {
    let mut reports = Vec::new();
    while !training.is_over() {
        reports.push(training.epoch().unwrap());
    }
    reports
}

#[test]
fn from_the_state_of_any_epoch_it_ends_with_the_same_weights_to_the_last_bit() {
    for kind in ModelKind::ALL {
        let world = World::quick(4);
        let mut undisturbed = Training::new(&world.lesson(kind)).unwrap();
        let (mut states, mut reports) = (Vec::new(), Vec::new());
        while !undisturbed.is_over() {
            reports.push(undisturbed.epoch().unwrap());
            states.push(undisturbed.state().unwrap());
        }
        let last = undisturbed.best().unwrap().to_safetensors().unwrap();
        for (done, state) in states.iter().enumerate() {
            let mut resumed = Training::new(&world.lesson(kind)).unwrap();
            resumed.restore(state).unwrap();
            assert_eq!(resumed.epochs_done(), done + 1);
            assert_eq!(to_its_end(&mut resumed), reports[done + 1..]);
            assert_eq!(resumed.state().unwrap(), states[3]);
            assert_eq!(resumed.best().unwrap().to_safetensors().unwrap(), last);
        }
        let at_once =
            train(kind, &world.network, &world.training, &world.examples, 6, Device::Cpu, &mut |_| ControlFlow::Continue(()));
        assert_eq!(at_once.unwrap().to_safetensors().unwrap(), last);
    }
}

#[test]
fn a_state_of_something_else_is_refused_and_named() {
    let world = World::quick(3);
    let mut training = world.begun();
    assert_eq!(training.state(), Err(Error::NothingToSave));
    training.epoch().unwrap();
    let state = training.state().unwrap();
    let refused = |change: &dyn Fn(&mut World)| {
        let mut other = World::quick(3);
        change(&mut other);
        other.begun().restore(&state).unwrap_err().to_string()
    };
    assert_eq!(refused(&|w| w.seed = 7), "the training state has origin.seed = 6, expected 7 as this training says");
    assert!(refused(&|w| w.training.epochs = 9).contains("has origin.training.epochs = 3, expected 9"));
    assert!(refused(&|w| w.network.head = 16).contains("has network.head = 32, expected 16"));
    assert!(refused(&|w| drop(w.examples.pop())).contains("has origin.examples = 13, expected 12"));
    assert!(refused(&|w| w.examples[5].colors[7][1] += 1e-6).contains("has origin.examples_sha256 = "));
    let top1 = Training::new(&world.lesson(ModelKind::Top1)).unwrap().restore(&state).unwrap_err().to_string();
    assert!(top1.contains("has kind = \"vmao\", expected \"top1\""), "{top1}");
    let checkpoint = training.best().unwrap();
    checkpoint.check_of(&world.lesson(ModelKind::Vmao)).unwrap();
    let other = World { seed: 8, ..World::quick(3) };
    let refused = checkpoint.check_of(&other.lesson(ModelKind::Vmao)).unwrap_err().to_string();
    assert_eq!(refused, "the finished network has origin.seed = 6, expected 8 as this training says");
}

#[test]
fn no_damage_to_a_state_goes_unnoticed() {
    let world = World::quick(3);
    let mut training = world.begun();
    training.epoch().unwrap();
    let state = training.state().unwrap();
    let mut stream = Stream::new(3, &[]);
    let untouched = training.best();
    for _ in 0..200 {
        let mut damaged = state.clone();
        damaged[stream.index(state.len())] ^= 1 << stream.index(8);
        assert!(training.restore(&damaged).is_err());
    }
    for cut in [0, 7, 100, state.len() / 2, state.len() - 1] {
        assert!(matches!(training.restore(&state[..cut]), Err(Error::NotSafetensors { .. })));
    }
    assert_eq!(training.best(), untouched, "a refusal changes nothing");
    assert!(training.restore(&training.best().unwrap().to_safetensors().unwrap()).is_err(), "a checkpoint is no state");
}

#[test]
fn it_ends_early_with_the_best_weights_and_as_a_longer_one_begins() {
    // Nothing to learn: the grips of these scenes are anywhere, so the validation loss is noise after the first epochs.
    let mut world = World::quick(40);
    let mut stream = Stream::new(1, &[]);
    for example in &mut world.examples {
        example.contacts = [0, 1].map(|_| example.points[stream.index(example.points.len())]);
    }
    world.training.augmentation = AugmentationConfig { rotation: 0.0, jitter: 0.0, color_gain: 0.0 };
    world.training.patience = 3;
    let mut training = world.begun();
    let reports = to_its_end(&mut training);
    let (last, best) = (reports[reports.len() - 1], training.best().unwrap());
    assert!(last.epoch < 40, "{last:?}");
    // The warm-up of β is a tenth of 40 epochs, and does not count.
    assert_eq!(last.epoch, best.epoch.max(4) + 3);
    assert_eq!(best.epoch, last.best_epoch);
    let loss = |report: &EpochReport| report.validation.map(|elbo| elbo.reconstruction + world.network.beta * elbo.kl).unwrap();
    let least = reports.iter().map(loss).fold(f32::INFINITY, f32::min);
    assert_eq!(loss(&reports[best.epoch - 1]), least);
    world.training.patience = 0;
    let mut patient = world.begun();
    for report in &reports {
        assert_eq!(patient.epoch().unwrap(), *report);
    }
    assert!(!patient.is_over());
    world.training.patience = 1;
    world.training.validation_fraction = 0.0;
    world.training.epochs = 8;
    let mut blind = world.begun();
    assert_eq!(to_its_end(&mut blind).len(), 8, "without validation there is nothing to wait for");
    assert_eq!(blind.best().unwrap().epoch, 8);
}

#[test]
fn a_training_that_diverges_names_the_examples_and_leaves_the_best_weights() {
    let mut world = World::quick(50);
    world.training.learning_rate = 1e30;
    let mut training = world.begun();
    let error = training.epoch().unwrap_err();
    let Error::Diverged { epoch, examples, .. } = &error else { unreachable!("{error}") };
    assert_eq!(*epoch, 1);
    assert!((1..=4).contains(&examples.len()) && examples.is_sorted() && examples.iter().all(|&i| i < 13), "{examples:?}");
    let text = error.to_string();
    assert!(text.contains(" at step ") && text.contains("(epoch 1, batch ") && text.contains(", examples "), "{text}");
    assert_eq!((training.epochs_done(), training.best()), (0, None));
}
