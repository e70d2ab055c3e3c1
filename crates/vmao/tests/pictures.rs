//! A small run through the real program: its motions are kept, exported, shown by the report, and drawn as figures.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod explorations;
mod page;

use explorations::{answer, check_failure, vmao};
use serde_json::Value;
use std::{fs, path::Path};

/// Explores, trains and evaluates V-MAO on two trials of each order.
fn small_run(out: &Path) {
    let mut command = vmao(&["demo", "--json", "--workers", "2"]);
    for setting in [
        "explore.successes=30",
        "train.epochs=10",
        "evaluate.trials=2",
        "evaluate.methods=[\"vmao\"]",
        "cameras.width=120",
        "cameras.height=90",
    ] {
        command.args(["--set", setting]);
    }
    answer(&command.arg("--out").arg(out).output().unwrap());
}

/// Width, height and frames of a GIF, every frame decoded.
fn decoded(path: &Path) -> (u16, u16, usize) {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::Indexed);
    let mut decoder = options.read_info(std::io::BufReader::new(fs::File::open(path).unwrap())).unwrap();
    let (width, height, mut frames) = (decoder.width(), decoder.height(), 0);
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert!(frame.left + frame.width <= width && frame.top + frame.height <= height && frame.delay > 0);
        assert!(frames > 0 || (frame.width, frame.height, frame.transparent) == (width, height, None), "the first is whole");
        frames += 1;
    }
    (width, height, frames)
}

fn png_size(path: &Path) -> (u32, u32) {
    let reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap())).read_info().unwrap();
    (reader.info().width, reader.info().height)
}

#[test]
fn a_run_is_exported_reported_and_drawn() {
    let directory = tempfile::tempdir().unwrap();
    let run = directory.path().join("run");
    small_run(&run);
    let text = |path: &Path| path.to_str().unwrap().to_owned();
    let place = text(&run);
    check_kept_and_reported(&run);

    let gif = directory.path().join("deep/trial.gif");
    let export = |more: &[&str]| {
        let arguments = ["export", &place, "--trial", "1", "--width", "120", "--rate", "5", "--json"];
        vmao(&[&arguments, more].concat()).output().unwrap()
    };
    let told = answer(&export(&["--out", &text(&gif), "--workers", "2"]));
    assert_eq!(decoded(&gif), (120, 80, told["frames"].as_u64().unwrap() as usize));
    let bytes = fs::read(&gif).unwrap();
    assert_eq!(told["bytes"], bytes.len());
    answer(&export(&["--out", &text(&gif), "--workers", "1"]));
    assert!(bytes == fs::read(&gif).unwrap(), "one worker draws what two do");
    answer(&export(&["--out", &text(&gif), "--plain", "--turn", "-60"]));
    assert_eq!(decoded(&gif).2, told["frames"].as_u64().unwrap() as usize);

    let refused = |arguments: &[&str], message: &str| {
        let output = vmao(&[&["export", &place], arguments].concat()).output().unwrap();
        check_failure(&output, 2, &[message]);
    };
    refused(&["--trial", "77"], "trials.jsonl: no trial 77; trials are 0 to 1 of: sequential vmao, parallel vmao");
    refused(&["--trial", "1", "--method", "top1"], "no trial 1 top1; trials are 0 to 1");
    refused(&["--trial", "1", "--order", "backwards"], "orders are: parallel, sequential-parallel, sequential");
    refused(&["--trial", "1", "--rate", "nan"], "expected 0.5 to 50");
    refused(&["--trial", "0", "--out", &place], "a directory, expected the file to write");

    // A damaged motion is refused with its name; a run that kept none runs its trial again.
    let kept = run.join("rollouts/sequential-vmao-1.json");
    let whole = fs::read_to_string(&kept).unwrap();
    fs::write(&kept, &whole[..whole.len() / 2]).unwrap();
    refused(&["--trial", "1"], "sequential-vmao-1.json: ");
    fs::write(&kept, whole.replacen("\"index\":1", "\"index\":0", 1)).unwrap();
    refused(&["--trial", "1"], "the rollout of trial 0 of vmao, sequential, expected that of its name");
    fs::remove_file(&kept).unwrap();
    let again = answer(&export(&["--out", &text(&gif)]));
    assert_eq!((&again["frames"], decoded(&gif).2 as u64), (&told["frames"], told["frames"].as_u64().unwrap()));

    check_figures(&run);
}

/// The motions lie beside the table, and the page carries them all.
fn check_kept_and_reported(run: &Path) {
    let mut kept: Vec<String> =
        fs::read_dir(run.join("rollouts")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    kept.sort();
    let expected = ["parallel-vmao-0.json", "parallel-vmao-1.json", "sequential-vmao-0.json", "sequential-vmao-1.json"];
    assert_eq!(kept, expected);
    let page = fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.len() < 20_000_000);
    let data = page::carried(&page);
    assert_eq!(data["rollouts_note"], "All 4 trials of the table can be played.");
    let rollouts = data["rollouts"].as_array().unwrap();
    assert_eq!(rollouts.len(), 4);
    assert!(rollouts.iter().all(|figure| figure["rollout"]["arms"] == 2), "every motion has its forces");
    assert!(data["cells"].as_array().unwrap().iter().all(|cell| cell["goals"]["reachable"].is_u64()));
    let failed: u64 = data["failure_classes"].as_array().unwrap().iter().map(|class| class["count"].as_u64().unwrap()).sum();
    assert_eq!(failed, rollouts.iter().filter(|figure| !figure["trial"]["failed"].is_null()).count() as u64);
    for class in data["failure_classes"].as_array().unwrap() {
        let example = class["example"].as_u64().expect("every class has an example") as usize;
        assert_eq!(rollouts[example]["trial"]["failed"], class["stage"]);
    }
    for scene in data["contact_maps"].as_array().unwrap() {
        let maps = scene["maps"].as_array().unwrap();
        assert_eq!(maps.len(), 5);
        assert!(maps.iter().all(|map| map["executed"]["rollout"]["frames"].as_u64().unwrap() > 0), "each code was carried out");
    }
}

fn check_figures(run: &Path) {
    let place = run.to_str().unwrap();
    let drawn = answer(&vmao(&["figures", place, "--scenes", "2", "--codes", "5", "--json"]).output().unwrap());
    let at = |value: &Value| Path::new(value.as_str().unwrap()).to_owned();
    let (columns, height) = png_size(&at(&drawn["figures"][0]));
    assert!(columns % 244 == 240 && height == 2 * 180 + 4, "two rows of key frames: {columns} × {height}");
    assert_eq!(png_size(&at(&drawn["figures"][1])), (6 * 200 + 5 * 4, 2 * 150 + 4), "the cloud and five maps, lying and lifted");
    let lifting: Value = serde_json::from_slice(&fs::read(at(&drawn["lifting"])).unwrap()).unwrap();
    let measure = |name: &str| lifting["measures"].as_array().unwrap().iter().find(|measure| measure["name"] == name).unwrap();
    for state in ["before", "after"] {
        let shares = ["mass-up", "mass-side", "mass-down"].map(|name| measure(name)[state]["value"].as_f64().unwrap());
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9 && shares.iter().all(|share| *share >= 0.0), "{shares:?}");
        assert!(measure("axis-height")[state]["value"].as_f64().is_some_and(|height| (0.0..=1.0).contains(&height)));
    }
    let refused = vmao(&["figures", place, "--trial", "9"]).output().unwrap();
    check_failure(&refused, 2, &["no trial 9 of V-MAO in sequential order; there are: 0 to 1"]);
}
