//! `vmao sample`: contact maps of scenes that were never explored, for several latent codes.

use super::{CommonOptions, Session};
use crate::{
    contact_maps::{latent_maps, ply},
    evaluation::Evaluation,
    failure::Failure,
    learned_contacts::LearnedContacts,
    learning::load,
    output::write_whole,
    report::{ContactMapFigure, Provenance, ReportData, render},
    results::Method,
    scenes::grasps,
};
use anyhow::Context;
use serde_json::json;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};
use vmao_core::{order::GraspOrder, record::GraspRecord};
use vmao_net::ModelKind;
use vmao_sim::Recording;

/// Trials carried out at most for each scene that is asked for; those that fail before the grasp show nothing.
const MOST_TRIALS_FOR_A_SCENE: u64 = 20;

#[derive(Debug, clap::Args)]
pub(super) struct SampleArguments {
    /// A checkpoint of `vmao train`
    #[arg(long, value_name = "DIR")]
    checkpoint: PathBuf,
    /// Latent codes drawn for each scene; Top-1 has none and gives one map
    #[arg(long, value_name = "K", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    samples: u64,
    /// Scenes, the first ones of `evaluate` that come as far as the grasp
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=1000))]
    scenes: u64,
    /// Which grasp's maps, from one; the grasps before it are carried out in the simulator first
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    grasp: u64,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn run(arguments: &SampleArguments, session: &Session) -> Result<(), Failure> {
    let (kind, networks) = load(&arguments.checkpoint, grasps(&session.config)?)?;
    let method = match kind {
        ModelKind::Vmao => Method::Vmao,
        ModelKind::Top1 => Method::Top1,
    };
    let model = LearnedContacts {
        networks,
        samples: 1,
        draw: session.config.evaluate.draw,
        peak_radius: session.config.evaluate.peak_radius,
    };
    let grasp = arguments.grasp as usize - 1;
    if grasp >= model.networks.len() {
        let found = arguments.grasp;
        return Err(Failure::bad_input(format!("--grasp {found}: the checkpoint has grasps 1 to {}", model.networks.len())));
    }
    let directory = session.output_directory(Path::new("runs/sample"))?;
    let maps = directory.join("maps");
    fs::create_dir_all(&maps).with_context(|| maps.display().to_string())?;
    let evaluation = Evaluation::new(&session.config, session.info.seed, vec![(method, model)])?;
    let order = session.config.trial.order;
    let (mut written, mut figures) = (Vec::new(), Vec::new());
    let pool = session.pool()?;
    let most = MOST_TRIALS_FOR_A_SCENE * arguments.scenes;
    for index in 0..most {
        if figures.len() as u64 == arguments.scenes {
            break;
        }
        let Some(seen) = pool.install(|| look(&evaluation, method, order, index, grasp)) else { continue };
        let model = evaluation.model(method).context("the model is in the table")?;
        let part = usize::from(seen.contact.part.0);
        let codes = if model.networks[part].latent_size() == 0 { 1 } else { arguments.samples };
        let span = evaluation.scene(index).robots[usize::from(seen.arm.0)].gripper.span();
        let sampled = latent_maps(model, part, &seen.observation, span, session.info.seed, codes)?;
        for (number, map) in sampled.iter().enumerate() {
            let path = maps.join(format!("scene-{index}-grasp-{}-code-{number}.ply", arguments.grasp));
            write_whole(&path, |file| ply(file, &seen.observation, map)).with_context(|| path.display().to_string())?;
            written.push(path);
        }
        figures.push(ContactMapFigure::new(
            format!("Scene {index}, grasp {}", arguments.grasp),
            format!("What {} sees before grasp {} of trial {index}, {} order.", method.title(), arguments.grasp, order.name()),
            &seen.observation,
            sampled,
        ));
    }
    if figures.is_empty() {
        let grasp = arguments.grasp;
        return Err(anyhow::anyhow!("none of {most} trials came as far as grasp {grasp}: is the checkpoint trained?").into());
    }
    let info = &session.info;
    let data = ReportData {
        title: format!("vmao · contact maps of {}", session.config.object_name()),
        summary: format!("{} maps of {} scenes by {}.", written.len(), figures.len(), method.title()),
        contact_maps: figures,
        provenance: Provenance {
            command: info.command.join(" "),
            version: info.version.clone(),
            commit: info.commit.clone(),
            seed: info.seed,
            digest: String::new(),
            config: session.config.to_toml()?,
        },
        ..ReportData::default()
    };
    let report = directory.join("report.html");
    let page = render(&data)?;
    write_whole(&report, |file| file.write_all(page.as_bytes())).with_context(|| report.display().to_string())?;
    session.print(&json!({ "maps": written, "report": report }))
}

/// What is seen before `grasp` of a trial; none if the trial failed before.
fn look(evaluation: &Evaluation<'_>, method: Method, order: GraspOrder, index: u64, grasp: usize) -> Option<GraspRecord> {
    evaluation.trial(order, method, index, Recording::Off)?.record.grasps.into_iter().nth(grasp)
}
