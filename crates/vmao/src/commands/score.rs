//! `vmao score`: learned distributions against the explored successes of held-out scenes.

use super::{CommonOptions, Session};
use crate::{
    config::Config,
    failure::{Failure, OrBadInput},
    learning::load,
    output::{Layout, print, write_whole},
    provenance::{COMMIT, RunInfo, VERSION},
    reference::{Grounds, load_reference, set_name},
    scenes::grasps,
    scoring::{
        Executed, Models, Rank, Row, Scored, coverage_figure, execute, reliability_figure, scene_figure, score, summarise, table,
    },
};
use anyhow::Context;
use serde::Serialize;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};
use vmao_net::ModelKind;

#[derive(Debug, clap::Args)]
pub(super) struct ScoreArguments {
    /// Checkpoints of `vmao train`, at most one of each model; or a directory with `vmao` and `top1` in it
    #[arg(long, value_name = "DIR", num_args = 1.., required = true)]
    models: Vec<PathBuf>,
    /// What `vmao reference` wrote; its configuration and seed are used, changed by --set
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Samples of each method that are carried out in each scene; none by default, they take as long as trials do
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=1000))]
    execute: u64,
    /// Samples shown in pictures
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u64).range(1..=1000))]
    shown: u64,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

/// `scores.json`.
#[derive(Debug, Serialize)]
struct Scores<'a> {
    schema: u32,
    version: &'a str,
    commit: &'a str,
    config_sha256: &'a str,
    seed: u64,
    /// Scenes of the reference in which some tuple succeeded, of all.
    scenes: [usize; 2],
    rows: &'a [Row],
}

#[derive(Debug, Serialize)]
struct Answer {
    scores: PathBuf,
    pictures: Vec<PathBuf>,
}

pub(super) fn run(arguments: &ScoreArguments, mut session: Session) -> Result<(), Failure> {
    configure(arguments, &mut session)?;
    let models = models(&arguments.models, grasps(&session.config)?)?;
    let grounds = Grounds::new(&session.config, session.info.seed)?;
    let reference = load_reference(&grounds, &arguments.data)?;
    let directory = session.output_directory(Path::new("runs/score"))?;
    let pool = session.pool()?;
    let scored = pool.install(|| score(&grounds, &reference, &models))?;
    if scored.is_empty() {
        let message = format!("{}: no try succeeded, expected successes to compare with", arguments.data.display());
        return Err(Failure::bad_input(message));
    }
    let places: Vec<_> = scored.iter().filter(|scene| scene.score.part == 0).map(|scene| scene.score.place).collect();
    let executed = pool.install(|| execute(&grounds, &places, &models, arguments.execute as usize));
    if !executed.is_empty() {
        write_lines(&directory.join("executed.jsonl"), &executed)?;
    }
    let settings = &session.config.score;
    let rows = summarise(&scored, &executed, settings, session.info.seed);
    let scores = Scores {
        schema: 1,
        version: VERSION,
        commit: COMMIT,
        config_sha256: &session.info.config_sha256,
        seed: session.info.seed,
        scenes: [places.len(), reference.len()],
        rows: &rows,
    };
    let path = directory.join("scores.json");
    let json = serde_json::to_string_pretty(&scores)?;
    write_whole(&path, |file| writeln!(file, "{json}")).with_context(|| path.display().to_string())?;
    let text = table(&rows, &settings.samples);
    let table_path = directory.join("scores.txt");
    write_whole(&table_path, |file| file.write_all(text.as_bytes())).with_context(|| table_path.display().to_string())?;
    let pictures = pictures(&directory, &scored, &rows, &session.config, arguments.shown as usize)?;
    match session.layout {
        Layout::Line => session.print(&Answer { scores: path, pictures }),
        Layout::Indented => Ok(print(text.trim_end())?),
    }
}

/// Takes configuration and seed from the reference, unless a configuration is given.
fn configure(arguments: &ScoreArguments, session: &mut Session) -> Result<(), Failure> {
    let info = RunInfo::load(&arguments.data).or_bad_input()?;
    if arguments.common.config.is_none() {
        let config = Config::load(Some(&arguments.data.join("config.toml")), &arguments.common.settings).or_bad_input()?;
        session.configure(|own| *own = config)?;
    }
    session.info.seed = info.seed;
    Ok(())
}

fn models(places: &[PathBuf], grasps: usize) -> Result<Models, Failure> {
    let mut models = Models::default();
    for place in places {
        let inside: Vec<PathBuf> =
            ModelKind::ALL.map(|kind| place.join(kind.name())).into_iter().filter(|place| place.is_dir()).collect();
        for directory in if inside.is_empty() { vec![place.clone()] } else { inside } {
            let (kind, networks) = load(&directory, grasps)?;
            if models.networks.insert(kind.name(), networks).is_some() {
                let message = format!("{}: another {} model, expected one of each", directory.display(), kind.title());
                return Err(Failure::bad_input(message));
            }
        }
    }
    Ok(models)
}

fn write_lines(path: &Path, lines: &[Executed]) -> Result<(), Failure> {
    write_whole(path, |file| lines.iter().try_for_each(|line| writeln!(file, "{}", serde_json::to_string(line)?)))
        .with_context(|| path.display().to_string())?;
    Ok(())
}

/// Coverage, reliability, and every scene before every grasp.
fn pictures(directory: &Path, scored: &[Scored], rows: &[Row], config: &Config, shown: usize) -> Result<Vec<PathBuf>, Failure> {
    let folder = directory.join("pictures");
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let parts = scored.iter().map(|scene| scene.score.part + 1).max().unwrap_or(0);
    let ranks = |model: &str, part: usize| -> Vec<Rank> {
        let own = scored.iter().filter(|scene| scene.score.part == part);
        own.flat_map(|scene| scene.score.ranks.get(model).cloned().unwrap_or_default()).collect()
    };
    let names = ModelKind::ALL.map(|kind| (kind.name(), kind.title()));
    let mut drawn = vec![
        ("coverage.svg".to_owned(), coverage_figure(rows, "both", &config.score.samples)),
        ("reliability.svg".to_owned(), reliability_figure(&names, parts, &ranks)),
    ];
    for scene in scored {
        let (set, index, grasp) = (set_name(scene.score.place.set), scene.score.place.index, scene.score.part + 1);
        let title = format!("{}, sizes: {set}, scene {index}, grasp {grasp}", config.object_name());
        let name = format!("{set}-{index:03}-grasp-{grasp}.svg");
        drawn.push((name, scene_figure(scene, &title, shown, config.score.distance)));
    }
    let mut written = Vec::with_capacity(drawn.len());
    for (name, picture) in drawn {
        let path = folder.join(name);
        write_whole(&path, |file| file.write_all(picture.as_bytes())).with_context(|| path.display().to_string())?;
        written.push(path);
    }
    Ok(written)
}
