//! `vmao export RUN_DIR --trial K`: a trial of a run as an animated GIF.

use super::{CommonOptions, Session, evaluate::parse_order};
use crate::{
    config::Config,
    evaluation::{Evaluation, TrialLine},
    failure::{Failure, OrBadInput},
    learning::json_lines,
    output::{progress_bar, write_whole},
    picture::{Animation, Layer, encode},
    provenance::RunInfo,
    results::Method,
    rollouts::StoredRollouts,
};
use anyhow::Context;
use serde_json::json;
use std::{
    fs, io,
    path::{Path, PathBuf},
};
use vmao_core::{order::GraspOrder, rollout::Rollout};
use vmao_sim::Recording;

/// The most pixels that an animation may have, over all its frames.
const MOST_PIXELS: usize = 2_000_000_000;

#[derive(Debug, clap::Args)]
pub(super) struct ExportArguments {
    /// A run of `vmao demo`, `reproduce` or `evaluate`
    #[arg(value_name = "RUN_DIR")]
    run: PathBuf,
    /// Number of the trial, as in trials.jsonl and in the report
    #[arg(long, value_name = "K")]
    trial: u64,
    /// The grasp order [default: the first that the run has]
    #[arg(long, value_name = "ORDER", value_parser = parse_order)]
    order: Option<GraspOrder>,
    /// Who chose the contacts: vmao, best-of-k or top1 [default: the first that the run has]
    #[arg(long, value_name = "METHOD", value_parser = parse_method)]
    method: Option<Method>,
    /// Pixels across; the height is two thirds of it
    #[arg(long, value_name = "N", default_value_t = 480, value_parser = clap::value_parser!(u16).range(60..=3000))]
    width: u16,
    /// Pictures a second
    #[arg(long, value_name = "N", default_value_t = 12.5, value_parser = parse_rate)]
    rate: f64,
    /// Simulated seconds a second
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = parse_speed)]
    speed: f64,
    /// Where to look from, degrees to the left of the front
    #[arg(long, value_name = "DEG", default_value_t = 24.0, allow_hyphen_values = true, value_parser = parse_angle)]
    turn: f64,
    /// Without contacts and forces
    #[arg(long)]
    plain: bool,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

fn parse_method(name: &str) -> Result<Method, String> {
    let methods = [Method::Vmao, Method::BestOfK, Method::Top1];
    let found = methods.into_iter().find(|method| method.name() == name);
    found.ok_or_else(|| format!("methods are: {}", methods.map(Method::name).join(", ")))
}

fn number(text: &str, [low, high]: [f64; 2]) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_not_a_number: std::num::ParseFloatError| "expected a number".to_owned())?;
    if (low..=high).contains(&value) { Ok(value) } else { Err(format!("expected {low} to {high}")) }
}

fn parse_rate(text: &str) -> Result<f64, String> {
    number(text, [0.5, 50.0])
}

fn parse_speed(text: &str) -> Result<f64, String> {
    number(text, [0.05, 20.0])
}

fn parse_angle(text: &str) -> Result<f64, String> {
    number(text, [-360.0, 360.0])
}

pub(super) fn run(arguments: &ExportArguments, session: &Session) -> Result<(), Failure> {
    let run = &arguments.run;
    let lines: Vec<TrialLine> = json_lines(&run.join("trials.jsonl"))?;
    let line = chosen(arguments, &lines)?;
    let rollout = session.pool()?.install(|| motion(run, line))?;
    let width = usize::from(arguments.width);
    let animation = Animation {
        size: [width, width * 2 / 3],
        rate: arguments.rate,
        speed: arguments.speed,
        turn: arguments.turn.to_radians(),
        elevation: 0.42,
        layer: if arguments.plain { Layer::Plain } else { Layer::Touch },
    };
    let frames = animation.frames(&rollout).len();
    if frames * animation.size[0] * animation.size[1] > MOST_PIXELS {
        let message = format!(
            "{frames} pictures of {width} pixels across: too large, expected a smaller --width or --rate, or more --speed"
        );
        return Err(Failure::bad_input(message));
    }
    let default = run.join(format!("trial-{}-{}-{}.gif", line.order.name(), line.method.name(), line.index));
    let path = session.out.clone().unwrap_or(default);
    if path.is_dir() {
        return Err(Failure::bad_input(format!("--out {}: a directory, expected the file to write", path.display())));
    }
    let bar = progress_bar("draw", frames as u64);
    let mut bytes = Vec::new();
    session.pool()?.install(|| encode(&rollout, &animation, &mut bytes, &|| bar.inc(1)))?;
    bar.finish();
    if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        fs::create_dir_all(parent).with_context(|| parent.display().to_string())?;
    }
    write_whole(&path, |file| io::Write::write_all(file, &bytes)).with_context(|| path.display().to_string())?;
    let [width, height] = animation.size;
    session.print(&json!({ "gif": path, "frames": frames, "width": width, "height": height, "bytes": bytes.len() }))
}

/// The line of the asked trial; says which exist.
fn chosen<'l>(arguments: &ExportArguments, lines: &'l [TrialLine]) -> Result<&'l TrialLine, Failure> {
    let place = arguments.run.join("trials.jsonl");
    let Some(first) = lines.first() else {
        return Err(Failure::bad_input(format!("{}: no trials, expected a run of demo, reproduce or evaluate", place.display())));
    };
    let fits = |line: &&TrialLine| {
        arguments.order.is_none_or(|order| line.order == order) && arguments.method.is_none_or(|method| line.method == method)
    };
    let found = lines.iter().filter(fits).find(|line| line.index == arguments.trial);
    found.ok_or_else(|| {
        let mut cells: Vec<(&str, &str)> = lines.iter().map(|line| (line.order.name(), line.method.name())).collect();
        cells.dedup();
        let cells: Vec<String> = cells.iter().map(|(order, method)| format!("{order} {method}")).collect();
        let last = lines.iter().map(|line| line.index).max().unwrap_or(first.index);
        let asked = [arguments.order.map(GraspOrder::name), arguments.method.map(Method::name)];
        let asked = asked.into_iter().flatten().map(|name| format!(" {name}")).collect::<String>();
        let (place, trial) = (place.display(), arguments.trial);
        Failure::bad_input(format!("{place}: no trial {trial}{asked}; trials are 0 to {last} of: {}", cells.join(", ")))
    })
}

/// The motion as the run keeps it, or run again where it keeps none.
pub(super) fn motion(run: &Path, line: &TrialLine) -> Result<Rollout, Failure> {
    let stored = StoredRollouts::of(run);
    if let Some(packed) = stored.read(line)? {
        return packed
            .unpack()
            .map_err(|problem| Failure::bad_input(format!("{}: {problem}", stored.path(line).display())))
            .and_then(playable);
    }
    let config = Config::load(Some(&run.join("config.toml")), &[]).or_bad_input()?;
    let info = RunInfo::load(run).or_bad_input()?;
    let evaluation = Evaluation::of_run(run, &config, info.seed)?;
    let again = evaluation.trial(line.order, line.method, line.index, Recording::On).with_context(|| {
        format!("{}: no networks of {}, expected those that the trial ran with", run.join("models").display(), line.method.name())
    });
    let again = again.or_bad_input()?;
    if again.record.outcome != line.outcome {
        let (then, now) = (line.outcome.name(), again.record.outcome.name());
        let place = run.join("trials.jsonl");
        return Err(Failure::Work(anyhow::anyhow!(
            "{}: trial {} ended with {then} and now with {now}",
            place.display(),
            line.index
        )));
    }
    playable(again.rollout.unwrap_or_default())
}

fn playable(rollout: Rollout) -> Result<Rollout, Failure> {
    if rollout.frames.is_empty() {
        return Err(Failure::bad_input("the trial's motion has no frame, expected one at least"));
    }
    Ok(rollout)
}
