//! What docs/dataset.md and docs/training.md show is run as it stands there, and the real TensorBoard reads the logs.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod explorations;
mod trainings;

use explorations::{answer, explore};
use std::path::{Path, PathBuf};
use std::process::Command;
use vmao::{dataset, training_log::curves};

/// What opens checkpoints and logs.
const PACKAGES: [&str; 13] = [
    "tensorboard==2.21.0",
    "safetensors==0.8.0",
    "numpy==2.4.6",
    "absl-py==2.5.1",
    "grpcio==1.85.1",
    "markdown==3.11.3",
    "markupsafe==3.0.4",
    "packaging==26.3",
    "pillow==13.0.0",
    "protobuf==7.36.2",
    "tensorboard-data-server==0.7.2",
    "typing_extensions==4.16.0",
    "werkzeug==3.1.9",
];

/// The lines of Python in a document.
fn lines_of(text: &str) -> &str {
    text.split_once("```python\n").unwrap().1.split_once("```").unwrap().0
}

#[track_caller]
fn run(program: &Path, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output().unwrap();
    assert!(output.status.success(), "{program:?} {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A Python of its own in `directory` with these packages, pinned by their versions with all they need.
fn python(directory: &Path, packages: &[&str]) -> PathBuf {
    let python = directory.join("venv/bin/python");
    run(Path::new("python3"), &["-m", "venv", directory.join("venv").to_str().unwrap()]);
    run(&python, &[&["-m", "pip", "install", "--quiet"], packages].concat());
    python
}

#[test]
#[ignore = "downloads pyarrow into an environment of its own"]
fn the_lines_of_python_read_the_records() {
    let lines = lines_of(include_str!("../../../docs/dataset.md"));
    assert_eq!(lines.lines().count(), 5, "five lines, as promised");

    let directory = tempfile::tempdir().unwrap();
    let data = directory.path().join("data");
    answer(&explore(&data, 6, 3, &[]).output().unwrap());
    let python = python(directory.path(), &["pyarrow==26.0.1", "numpy==2.4.6"]);
    let lines = lines.replace("DIR", data.to_str().unwrap());
    let script =
        format!("{lines}\nprint(trials.num_rows, successes.num_rows, *cloud.shape, on_part.sum(), repr(float(cloud[7, 2])))");
    let found = run(&python, &["-c", &script]);

    let records = dataset::load(&data).unwrap();
    let successes: Vec<_> = records.iter().filter(|record| record.outcome.is_success()).collect();
    let grasp = &successes[0].grasps[0];
    let seen = &grasp.observation;
    let part = vmao_core::observation::PointLabel::Part(grasp.contact.part.0);
    let on_part = seen.labels.iter().filter(|&&label| label == part).count();
    let height = f64::from(seen.points[7][2]);
    assert_eq!(found.trim(), format!("{} {} {} 3 {on_part} {height:?}", records.len(), successes.len(), seen.len()));
}

#[test]
#[ignore = "downloads safetensors and tensorboard into an environment of its own"]
fn python_opens_a_checkpoint_and_tensorboard_reads_every_scalar() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("net");
    trainings::data(&directory.path().join("data"), 9);
    answer(&trainings::train(&out, "vmao", 4, &[]).output().unwrap());
    let python = python(directory.path(), &PACKAGES);
    let lines = lines_of(include_str!("../../../docs/training.md")).replace("DIR", out.to_str().unwrap());
    let script =
        format!("{lines}\nprint(arrays['decoder.logits.bias'].shape, len(arrays) > 50, config['kind'], inside['epoch'] >= 1)");
    assert_eq!(run(&python, &["-c", &script]).trim(), "(2,) True vmao True");

    let script = "import sys
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
for grasp in range(2):
    log = EventAccumulator(f'{sys.argv[1]}/grasp-{grasp}')
    log.Reload()
    for tag in sorted(log.Tags()['scalars']):
        for event in log.Scalars(tag):
            print(grasp, tag, event.step, event.wall_time, event.value.hex())";
    let found = run(&python, &["-c", script, out.to_str().unwrap()]);
    let mut found: Vec<&str> = found.lines().collect();
    found.sort_unstable();
    let mut expected = Vec::new();
    for line in curves(&out).unwrap() {
        let values = [
            ("cross_entropy/training", line.train_reconstruction),
            ("cross_entropy/validation", line.validation_reconstruction.unwrap()),
            ("gradient_norm", line.gradient_norm),
            ("kl/training", line.train_kl),
            ("kl/validation", line.validation_kl.unwrap()),
            ("schedule/beta", line.beta),
            ("schedule/learning_rate", line.learning_rate),
        ];
        let epoch = line.epoch;
        expected.extend(values.map(|(tag, value)| format!("{} {tag} {epoch} {epoch}.0 {}", line.grasp, hex_float(value))));
    }
    expected.sort_unstable();
    assert_eq!(found, expected);
}

/// A float as Python's `float.hex` writes it.
fn hex_float(value: f32) -> String {
    let value = f64::from(value);
    if value == 0.0 {
        return "0x0.0p+0".to_owned();
    }
    let bits = value.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i64 - 1023, bits & ((1 << 52) - 1));
    format!("{}0x1.{fraction:013x}p{exponent:+}", if value < 0.0 { "-" } else { "" })
}
