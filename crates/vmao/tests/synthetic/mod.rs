//! Made-up report data for looking at the page. None of it comes from a run.

pub(crate) mod motion;

use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use vmao::report::{
    Cell, ContactMapFigure, ExplorationRound, ExplorationSummary, FailureClass, LatentMap, Provenance, ReportData, RolloutFigure,
    ThresholdPoint, TrainingCurve, TrainingEpoch, TrialPlace,
};
use vmao::results::GoalCounts;
use vmao::rollouts::PackedRollout;
use vmao_core::{observation::PointLabel, order::GraspOrder, outcome::FailureStage, random::Stream, shape::Shape};

fn wilson(successes: f64, n: f64) -> [f64; 2] {
    let (z, p) = (1.959_964, successes / n);
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    [middle - half, middle + half]
}

fn cell(order: GraspOrder, method: &str, counts: [u64; 7]) -> Cell {
    let trials = 60;
    let successes = trials - counts.iter().sum::<u64>();
    let rate = successes as f64 / trials as f64;
    let curve = |k: i32| {
        let scale = f64::from(k) * 0.1;
        ThresholdPoint { scale, rate: (rate * 1.12 * (1.0 - (-2.3 * scale.powf(1.6)).exp())).min(1.0) }
    };
    Cell {
        object: "pliers".into(),
        robots: vec!["panda".into(), "panda".into()],
        order,
        method: method.into(),
        trials,
        successes,
        rate,
        wilson95: wilson(successes as f64, trials as f64),
        failures: FailureStage::ALL.into_iter().zip(counts).collect(),
        goals: Some(GoalCounts { reachable: trials - 3, unreachable: 2, unknown: 1, redraws: 0 }),
        threshold_curve: (0..=20).map(curve).collect(),
    }
}

fn surface(shape: &Shape, stream: &mut Stream) -> Point3<f64> {
    let turn = stream.range(0.0, std::f64::consts::TAU);
    let up = stream.range(-1.0, 1.0);
    match *shape {
        Shape::Sphere { radius } => Point3::from(Vector3::new(turn.cos(), turn.sin(), up) * radius),
        Shape::Capsule { radius, half_length } | Shape::Cylinder { radius, half_length } => {
            Point3::new(radius * turn.cos(), radius * turn.sin(), up * (half_length + 0.5 * radius))
        }
        Shape::Box { half_extents: h } => {
            let mut point = [up, stream.range(-1.0, 1.0), stream.range(-1.0, 1.0)];
            point[stream.index(3)] = up.signum();
            Point3::new(point[0] * h[0], point[1] * h[1], point[2] * h[2])
        }
        Shape::Convex(ref hull) => hull.vertices()[stream.index(hull.vertices().len())],
    }
}

/// The made-up motion as a figure; `trial` is its number and where it failed.
fn figure_of(title: &str, trial: Option<(u64, Option<FailureStage>)>, fails: bool) -> RolloutFigure {
    let place = |(index, failed)| TrialPlace { order: GraspOrder::Sequential, method: "vmao".into(), index, failed };
    let rollout = PackedRollout::pack(&motion::rollout(fails)).expect("packing writes to memory");
    RolloutFigure { title: title.into(), caption: String::new(), trial: trial.map(place), rollout }
}

/// The scene before the second grasp, with maps that slide along the second handle from code to code.
fn contact_maps() -> ContactMapFigure {
    let mut stream = Stream::new(5, &[]);
    let motion = motion::rollout(false);
    let frame = &motion.frames[95];
    let mut figure =
        ContactMapFigure { title: "Second grasp (handle-b, arm 1), scene of trial 17".into(), ..ContactMapFigure::default() };
    let mut push = |point: Point3<f64>, color: [f32; 3], label, stream: &mut Stream| {
        let shade = 0.9 + 0.15 * stream.unit() as f32;
        figure.points.push([point.x as f32, point.y as f32, point.z as f32]);
        figure.colors.push(color.map(|value| value * shade));
        figure.labels.push(label);
    };
    for (body, pose) in motion.bodies.iter().zip(frame) {
        let density = match body.label {
            PointLabel::Table => 0,
            PointLabel::Arm(_) => 45,
            PointLabel::Part(_) => 170,
        };
        for solid in &body.solids {
            for _ in 0..density {
                let point = pose * solid.carrier_from_solid * surface(&solid.shape, &mut stream);
                if point.z < 0.3 && point.x.abs() < 0.35 {
                    push(point, solid.color, body.label, &mut stream);
                }
            }
        }
    }
    for _ in 0..700 {
        push(
            Point3::new(stream.range(-0.3, 0.3), stream.range(-0.35, 0.3), 0.0),
            [0.80, 0.74, 0.66],
            PointLabel::Table,
            &mut stream,
        );
    }
    let world_from_half = frame[frame.len() - 1];
    figure.maps = (0..5)
        .map(|code| {
            let channel = |sign: f64| {
                let peak = world_from_half * Point3::new(-0.135 + 0.02 * f64::from(code), -0.013 + sign * 0.009, 0.0);
                let bump = |p: &[f32; 3]| {
                    let away = (Point3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])) - peak).norm();
                    (-(away / 0.012).powi(2)).exp() + 0.25 * (-(away / 0.03).powi(2)).exp() + 1e-4
                };
                let raw: Vec<f64> = figure.points.iter().map(bump).collect();
                let sum: f64 = raw.iter().sum();
                raw.iter().map(|value| (value / sum) as f32).collect::<Vec<f32>>()
            };
            let (finger1, finger2) = (channel(1.0), channel(-1.0));
            let executed = Some(figure_of(&format!("Code {}: success", code + 1), None, code > 2));
            let peak = |channel: &[f32]| (0..channel.len()).max_by(|&a, &b| channel[a].total_cmp(&channel[b])).unwrap_or(0);
            let peaks = [peak(&finger1), peak(&finger2)];
            LatentMap { latent: (0..16).map(|_| stream.normal() as f32).collect(), finger1, finger2, peaks, executed }
        })
        .collect();
    figure
}

fn training(model: &str, level: f64, latent: bool) -> TrainingCurve {
    let mut stream = Stream::new(9, &[model.len() as u64]);
    let epoch = |k: i32| {
        let x = f64::from(k);
        let decay = level + 4.2 * (-x / 9.0).exp();
        TrainingEpoch {
            train_reconstruction: decay + 0.04 * stream.normal(),
            validation_reconstruction: decay + 0.25 + 0.004 * x + 0.08 * stream.normal(),
            kl: if latent { 9.0 * (-x / 14.0).exp() + 2.1 + 0.1 * stream.normal() } else { f64::NAN },
            beta: if latent { (x / 30.0).min(1.0) } else { f64::NAN },
        }
    };
    TrainingCurve { model: model.into(), epochs: (0..60).map(epoch).collect() }
}

/// A whole report's worth.
pub(crate) fn report() -> ReportData {
    let rounds: Vec<ExplorationRound> =
        (0..14).map(|k: u64| ExplorationRound { trials: 64, successes: (18 + 2 * k + (k * 7) % 5).min(52) }).collect();
    let trials = rounds.iter().map(|round| round.trials).sum();
    let successes: u64 = rounds.iter().map(|round| round.successes).sum();
    let failed = trials - successes;
    let failures = BTreeMap::from([
        (FailureStage::NoContact, failed / 3),
        (FailureStage::Unreachable, failed / 5),
        (FailureStage::Slip, failed / 6),
        (FailureStage::Collision, failed - failed / 3 - failed / 5 - failed / 6),
    ]);
    ReportData {
        title: "Two arms, one pair of pliers".into(),
        summary: "SYNTHETIC DATA for looking at the page: two Panda arms learn where to hold a pair of pliers and move it to a goal pose \
                  and a goal angle, in two grasp orders, with V-MAO and with Top-1."
            .into(),
        cells: vec![
            cell(GraspOrder::Sequential, "vmao", [2, 1, 1, 1, 3, 2, 0]),
            cell(GraspOrder::Sequential, "top1", [9, 4, 2, 2, 5, 2, 1]),
            cell(GraspOrder::Parallel, "vmao", [3, 2, 2, 1, 4, 2, 0]),
            cell(GraspOrder::Parallel, "top1", [11, 3, 3, 3, 6, 1, 0]),
        ],
        contact_maps: vec![contact_maps()],
        rollouts: vec![
            figure_of("Trial 17, V-MAO, sequential", Some((17, None)), false),
            figure_of("Trial 23, V-MAO, sequential", Some((23, Some(FailureStage::Slip))), true),
        ],
        rollouts_note: "2 of the table's 240 trials can be played here.".into(),
        failure_classes: vec![FailureClass {
            stage: FailureStage::Slip,
            count: 13,
            meaning: "A part was lost.".into(),
            remedy: "Hold it.".into(),
            example: Some(1),
        }],
        training: vec![training("vmao", 3.1, true), training("top1", 3.6, false)],
        exploration: Some(ExplorationSummary { trials, successes, demonstrations: 8, failures, rounds }),
        provenance: Provenance {
            command: "vmao demo --seed 3 --workers 2 --out runs/demo".into(),
            version: "0.1.0".into(),
            commit: "bddeaca31c0ffee5a1e".into(),
            seed: u64::MAX,
            digest: "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08".into(),
            config: "# Resolved configuration\nseed = 3\n\n[object]\nname = \"pliers\"\n\n[robots]\nnames = [\"panda\", \"panda\"]\n\n\
                     [trial]\norder = \"sequential\"\nposition_threshold = 0.02   # m\nangle_threshold = 0.1745    # rad\n"
                .into(),
        },
    }
}
