//! What docs/dataset.md shows is run as it stands there.

mod explorations;

use explorations::{answer, explore};
use std::process::Command;
use vmao::dataset;

/// Pinned, with all it needs, by its version.
const PACKAGES: [&str; 2] = ["pyarrow==26.0.1", "numpy==2.4.6"];

#[test]
#[ignore = "downloads pyarrow into an environment of its own"]
fn the_lines_of_python_read_the_records() {
    let text = include_str!("../../../docs/dataset.md");
    let (_, after) = text.split_once("```python\n").unwrap();
    let (lines, _) = after.split_once("```").unwrap();
    assert_eq!(lines.lines().count(), 5, "five lines, as promised");

    let directory = tempfile::tempdir().unwrap();
    let (data, python) = (directory.path().join("data"), directory.path().join("venv/bin/python"));
    answer(&explore(&data, 6, 3, &[]).output().unwrap());
    let run = |program: &str, arguments: &[&str]| {
        let output = Command::new(program).args(arguments).output().unwrap();
        assert!(output.status.success(), "{program} {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    run("python3", &["-m", "venv", directory.path().join("venv").to_str().unwrap()]);
    let python = python.to_str().unwrap();
    run(python, &[&["-m", "pip", "install", "--quiet"], &PACKAGES[..]].concat());
    let lines = lines.replace("DIR", data.to_str().unwrap());
    let script =
        format!("{lines}\nprint(trials.num_rows, successes.num_rows, *cloud.shape, on_part.sum(), repr(float(cloud[7, 2])))");
    let found = run(python, &["-c", &script]);

    let records = dataset::load(&data).unwrap();
    let successes: Vec<_> = records.iter().filter(|record| record.outcome.is_success()).collect();
    let grasp = &successes[0].grasps[0];
    let seen = &grasp.observation;
    let part = vmao_core::observation::PointLabel::Part(grasp.contact.part.0);
    let on_part = seen.labels.iter().filter(|&&label| label == part).count();
    let height = f64::from(seen.points[7][2]);
    assert_eq!(found.trim(), format!("{} {} {} 3 {on_part} {height:?}", records.len(), successes.len(), seen.len()));
}
