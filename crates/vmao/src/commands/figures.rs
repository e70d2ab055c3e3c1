//! `vmao figures RUN_DIR`: the supplement's Figures 3 and 4 of a run, and what lifting changes, measured.

use super::{CommonOptions, Session, export::motion};
use crate::{
    config::Config,
    evaluation::{Evaluation, TrialLine},
    failure::{Failure, OrBadInput},
    figures::{changes, key_frames, lifted_scenes, maps_picture, table},
    learning::json_lines,
    output::{Layout, print, progress_bar, write_whole},
    picture::save,
    provenance::RunInfo,
    results::Method,
};
use anyhow::Context;
use serde_json::json;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};
use vmao_core::order::GraspOrder;

/// Scenes of Figure 4.
const SHOWN: usize = 1;

#[derive(Debug, clap::Args)]
pub(super) struct FiguresArguments {
    /// A run of `vmao demo`, `reproduce` or `evaluate` with V-MAO's networks
    #[arg(value_name = "RUN_DIR")]
    run: PathBuf,
    /// Number of the trial in key frames [default: the first that V-MAO solved in sequential order]
    #[arg(long, value_name = "K")]
    trial: Option<u64>,
    /// Scenes that the statement about lifting is measured on
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    scenes: u64,
    /// Latent codes for each scene
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(5..=1000))]
    codes: u64,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &FiguresArguments, session: &Session) -> Result<(), Failure> {
    let run = &arguments.run;
    let config = Config::load(Some(&run.join("config.toml")), &[]).or_bad_input()?;
    let info = RunInfo::load(run).or_bad_input()?;
    let lines: Vec<TrialLine> = json_lines(&run.join("trials.jsonl"))?;
    let line = sequential(&lines, arguments.trial, &run.join("trials.jsonl"))?;
    let evaluation = Evaluation::of_run(run, &config, info.seed)?;
    let pool = session.pool()?;
    let bar = progress_bar("scenes", arguments.scenes);
    let asked = (arguments.scenes, arguments.codes);
    let scenes = pool.install(|| lifted_scenes(&evaluation, asked, info.seed, &|| bar.inc(1)))?;
    bar.finish();
    if scenes.is_empty() {
        let models = run.join("models").join(Method::Vmao.name());
        return Err(Failure::Work(anyhow::anyhow!("{}: no trial came to the second grasp: is V-MAO trained?", models.display())));
    }
    let directory = session.out.clone().unwrap_or_else(|| run.join("figures"));
    fs::create_dir_all(&directory).with_context(|| format!("{}: cannot be made a directory", directory.display()))?;
    let figure_3 = pool.install(|| motion(run, line).map(|rollout| key_frames(&rollout)))?;
    let figure_4 = pool.install(|| maps_picture(&scenes[..scenes.len().min(SHOWN)]));
    let mut written = vec![
        write(&directory, "figure-3.png", |file| save(&figure_3, file))?,
        write(&directory, "figure-4.png", |file| save(&figure_4, file))?,
    ];
    let changes = changes(&scenes, info.seed);
    let indices: Vec<u64> = scenes.iter().map(|scene| scene.index).collect();
    let document = json!({
        "object": config.object_name(), "robots": config.robots.names, "commit": crate::provenance::COMMIT, "run": info,
        "codes": arguments.codes, "scenes": indices, "measures": changes,
    });
    let text = serde_json::to_string_pretty(&document)? + "\n";
    written.push(write(&directory, "lifting.json", |file| file.write_all(text.as_bytes()))?);
    match session.layout {
        Layout::Line => session.print(&json!({ "figures": &written[..2], "lifting": written[2] })),
        Layout::Indented => {
            let paths: String = written.iter().map(|path| format!("\n{}", path.display())).collect();
            Ok(print(&format!("{}{paths}", table(&changes)))?)
        }
    }
}

fn write(
    directory: &Path,
    name: &str,
    content: impl FnOnce(&mut std::io::BufWriter<fs::File>) -> std::io::Result<()>,
) -> Result<PathBuf, Failure> {
    let path = directory.join(name);
    write_whole(&path, content).with_context(|| path.display().to_string())?;
    Ok(path)
}

/// The asked trial of V-MAO in sequential order, or the first that it solved.
fn sequential<'l>(lines: &'l [TrialLine], trial: Option<u64>, place: &Path) -> Result<&'l TrialLine, Failure> {
    let own = || lines.iter().filter(|line| line.order == GraspOrder::Sequential && line.method == Method::Vmao);
    let found = match trial {
        Some(trial) => own().find(|line| line.index == trial),
        None => own().find(|line| line.outcome.is_success()).or_else(|| own().max_by_key(|line| line.steps)),
    };
    found.ok_or_else(|| {
        let asked = trial.map_or_else(|| "no trial".to_owned(), |trial| format!("no trial {trial}"));
        let exist = own().map(|line| line.index).max().map_or_else(|| "none".to_owned(), |last| format!("0 to {last}"));
        Failure::bad_input(format!("{}: {asked} of V-MAO in sequential order; there are: {exist}", place.display()))
    })
}
