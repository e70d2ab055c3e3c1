//! The report page: self-contained, robust to hostile and empty data, and there to be looked at.

mod page;
mod synthetic;

use page::carried;
use vmao::config::Config;
use vmao::report::{Cell, ReportData, TrainingCurve, TrainingEpoch, render};
use vmao::rollouts::PackedRollout;
use vmao_core::catalogue::{InstanceSet, item};
use vmao_core::contact_model::JitteredTuple;
use vmao_core::geometry::pose_distance;
use vmao_core::order::GraspOrder;
use vmao_core::robots::panda;
use vmao_sim::{Recording, Scene, run_trial};

#[test]
fn a_full_report_is_written_for_looking_at() {
    let page = render(&synthetic::report()).unwrap();
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report.html");
    std::fs::write(&path, &page).unwrap();
    let data = carried(&page);
    assert_eq!(data["cells"][0]["failures"]["no-contact"], 2);
    assert_eq!(data["cells"][0]["order"], "sequential");
    assert_eq!(data["contact_maps"][0]["maps"].as_array().unwrap().len(), 5);
    assert_eq!(data["provenance"]["seed"], u64::MAX.to_string());
    let made = synthetic::motion::rollout(false);
    let shown = &data["rollouts"][0];
    assert_eq!((shown["trial"]["index"].as_u64(), shown["trial"]["failed"].is_null()), (Some(17), true));
    assert_eq!(data["rollouts"][1]["trial"]["failed"], "slip");
    assert_eq!(data["failure_classes"][0]["example"], 1);
    assert_eq!(data["cells"][0]["goals"]["unreachable"], 2);
    assert_eq!(data["contact_maps"][0]["maps"][4]["executed"]["title"], "Code 5: success");
    // What the page carries is the motion that was given, to the stated precision.
    let packed: PackedRollout = serde_json::from_value(shown["rollout"].clone()).unwrap();
    let back = packed.unpack().unwrap();
    assert_eq!(
        (back.bodies.len(), back.frames.len(), back.forces.len()),
        (made.bodies.len(), made.frames.len(), made.frames.len())
    );
    for (made, back) in made.frames.iter().flatten().zip(back.frames.iter().flatten()) {
        let [distance, angle] = pose_distance(made, back);
        assert!(distance < 3e-4 && angle < 1e-3, "{distance} m, {angle} rad");
    }
    // Four frames share the mean of their forces.
    for (made, back) in made.forces.chunks(4).zip(back.forces.chunks(4)) {
        for (arm, pad, axis) in (0..2).flat_map(|arm| (0..6).map(move |k| (arm, k / 3, k % 3))) {
            let mean = made.iter().map(|frame| frame[arm][pad].force[axis]).sum::<f64>() / made.len() as f64;
            assert!(back.iter().all(|frame| (frame[arm][pad].force[axis] - mean).abs() <= 0.05 + 1e-9));
            // Where a pad presses all the time, its point is between where it was.
            let points: Vec<f64> = made.iter().map(|frame| frame[arm][pad].point[axis]).collect();
            if made.iter().all(|frame| frame[arm][pad].force != [0.0; 3]) {
                let [least, most] = [f64::min, f64::max].map(|of| points.iter().copied().reduce(of).unwrap());
                assert!((least - 6e-4..=most + 6e-4).contains(&back[0][arm][pad].point[axis]));
            }
        }
    }
    assert_eq!((&back.events, &back.outcome), (&made.events, &made.outcome));
    for (made, back) in made.contacts.iter().zip(&back.contacts) {
        assert_eq!((made.time, made.arm, made.part), (back.time, back.arm, back.part));
        assert!(made.fingers.iter().flatten().zip(back.fingers.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-5));
    }
    assert_eq!(page, render(&synthetic::report()).unwrap(), "the same data gives the same page");
}

#[test]
fn nothing_in_the_page_is_loaded_from_elsewhere() {
    let page = render(&ReportData::default()).unwrap();
    for loads in ["src=\"", "href=\"http", "href=\"//", "@import", "url(", "@font-face"] {
        let html = page.replace("<script>", "\n<script>");
        let outside_script = html.split("\n<script>").next().unwrap();
        assert!(!outside_script.contains(loads), "{loads}");
    }
    assert!(page.contains("default-src 'none'"), "the browser is told to load nothing");
}

#[test]
fn hostile_text_stays_text() {
    let hostile = "</script><script>alert(1)</script><!-- {{data}} & \" ' \u{2028}";
    let mut data = synthetic::report();
    data.title = hostile.into();
    data.summary = hostile.into();
    data.cells[0].object = hostile.into();
    data.rollouts[0].rollout.outcome = hostile.into();
    data.provenance.config = hostile.into();
    let page = render(&data).unwrap();
    std::fs::write(std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("report-hostile.html"), &page).unwrap();
    let back = carried(&page);
    for text in [&back["title"], &back["summary"], &back["cells"][0]["object"], &back["provenance"]["config"]] {
        assert_eq!(text, hostile);
    }
    let plain = render(&synthetic::report()).unwrap();
    for tag in ["<script", "</script", "<!--"] {
        assert_eq!(page.matches(tag).count(), plain.matches(tag).count(), "{tag}");
    }
}

#[test]
fn a_packed_motion_that_no_trial_made_is_refused_in_words() {
    let good = PackedRollout::pack(&synthetic::motion::rollout(false)).unwrap();
    let check = |change: &dyn Fn(&mut PackedRollout), message: &str| {
        let mut bad = good.clone();
        change(&mut bad);
        let found = bad.unpack().unwrap_err();
        assert!(found.contains(message), "{found}");
    };
    check(&|bad| bad.frame_seconds = 0.0, "frame_seconds: 0");
    check(&|bad| bad.bodies.truncate(40), "bodies: ");
    check(&|bad| bad.body_count += 1, "expected body_count");
    check(&|bad| bad.frames = usize::MAX, "frames: ");
    check(&|bad| bad.frames += 1, "motion: ");
    check(&|bad| bad.frames -= 1, "after the last column");
    check(&|bad| bad.arms = 1 << 40, "forces: ");
    let nothing = PackedRollout::pack(&vmao_core::rollout::Rollout { frame_seconds: 0.04, ..Default::default() }).unwrap();
    assert!(nothing.unpack().unwrap().frames.is_empty());
    let endless = PackedRollout { frames: usize::MAX, ..nothing };
    assert!(endless.unpack().unwrap_err().contains("frames: "));
    check(&|bad| bad.goal.truncate(1), "goal: 1 poses, expected 2");
    // Recorded without forces, as older programs did: the motion is there, the forces are not.
    let mut older = synthetic::motion::rollout(false);
    older.forces.clear();
    let packed = PackedRollout::pack(&older).unwrap();
    assert_eq!(packed.arms, 0);
    assert!(packed.unpack().unwrap().forces.iter().all(Vec::is_empty));
}

#[test]
fn a_cell_of_results_json_is_a_row_of_the_table() {
    let cell: Cell = serde_json::from_str(
        r#"{"object": "three-sticks", "robots": ["sawyer", "sawyer", "sawyer"], "order": "sequential-parallel", "method": "vmao",
            "trials": 500, "successes": 430, "rate": 0.86, "wilson95": [0.827, 0.888],
            "failures": {"no-contact": 40, "unreachable": 0, "no-plan": 0, "collision": 0, "slip": 30, "threshold": 0, "timeout": 0}}"#,
    )
    .unwrap();
    assert_eq!(cell.failures[&vmao_core::outcome::FailureStage::Slip], 30);
    let back = carried(&render(&ReportData { cells: vec![cell], ..ReportData::default() }).unwrap());
    assert_eq!(back["cells"][0]["failures"]["no-contact"], 40);
    assert_eq!(back["cells"][0]["order"], "sequential-parallel");
}

#[test]
fn an_empty_report_and_numbers_that_are_none_are_still_json() {
    assert!(carried(&render(&ReportData::default()).unwrap())["exploration"].is_null());
    let mut data = synthetic::report();
    data.cells[0].rate = f64::NAN;
    data.cells[0].wilson95 = [f64::NEG_INFINITY, f64::INFINITY];
    data.contact_maps[0].points[0] = [f32::NAN; 3];
    data.contact_maps[0].maps[0].finger1[0] = f32::NAN;
    data.contact_maps[0].maps[0].latent[0] = f32::INFINITY;
    let mut astray = synthetic::motion::rollout(false);
    astray.frames[3][2].translation.x = f64::NAN;
    astray.frames[4][2].translation.x = f64::INFINITY;
    astray.frames.truncate(9);
    data.rollouts[0].rollout = PackedRollout::pack(&astray).unwrap();
    let none =
        TrainingEpoch { train_reconstruction: f64::NAN, validation_reconstruction: 1.0, kl: f64::INFINITY, beta: f64::NAN };
    data.training.push(TrainingCurve { model: "broken".into(), epochs: vec![none; 3] });
    let page = render(&data).unwrap();
    let back = carried(&page);
    assert!(back["cells"][0]["rate"].is_null() && back["cells"][0]["wilson95"][1].is_null());
    assert!(back["training"][2]["epochs"][0]["kl"].is_null());
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join("report-broken.html"), &page).unwrap();
    std::fs::write(folder.join("report-empty.html"), render(&ReportData::default()).unwrap()).unwrap();
}

#[test]
fn a_real_motion_is_packed_as_the_joints_that_made_it() {
    let config = Config::load(None, &[]).unwrap();
    let scene = Scene::new(&config.scene, vec![panda(), panda()], item("pliers", InstanceSet::Train, 2).unwrap()).unwrap();
    let model = JitteredTuple { tuple: scene.demonstrations[0].clone(), radius: 0.005 };
    let solved = |index| {
        let trial = run_trial(&scene, &config.trial_config(), &model, GraspOrder::Sequential, (1, index), Recording::On);
        trial.record.outcome.is_success().then_some(trial)
    };
    let made = (0..8).find_map(solved).and_then(|trial| trial.rollout).expect("demonstrated contacts succeed at times");
    let packed = PackedRollout::pack(&made).unwrap();
    let back = packed.unpack().unwrap();
    for (made, back) in made.frames.iter().flatten().zip(back.frames.iter().flatten()) {
        let [distance, angle] = pose_distance(made, back);
        assert!(distance < 1.5e-3 && angle < 4e-3, "{distance} m, {angle} rad");
    }
    // Whole poses of as many frames took 20 bytes a frame and arm.
    assert!(packed.motion.len() < 12 * made.frames.len(), "{} bytes for {} frames", packed.motion.len(), made.frames.len());
}
