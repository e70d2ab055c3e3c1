//! `vmao evaluate`: cells of the table for trained models.

use super::{CommonOptions, Session};
use crate::{
    evaluation::{Evaluation, save},
    failure::{Failure, OrBadInput},
    interruption::keeps,
    kept_trials::KeptTrials,
    learned_contacts::methods,
    learning::{check_same, copy, load},
    output::{Layout, print},
    results::Results,
};
use std::path::{Path, PathBuf};
use vmao_core::order::GraspOrder;
use vmao_net::{ContactNetwork, ModelKind};

#[derive(Debug, clap::Args)]
pub(super) struct EvaluateArguments {
    /// A checkpoint of `vmao train`, or a directory with `vmao` and `top1` in it
    #[arg(long, value_name = "DIR")]
    checkpoint: PathBuf,
    /// The grasp orders, over the configuration's; may be repeated
    #[arg(long = "order", value_name = "ORDER", value_parser = parse_order)]
    orders: Vec<GraspOrder>,
    /// Trials of each cell, over the configuration's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    trials: Option<u64>,
    /// Go on with the table in --out that was stopped
    #[arg(long, requires = "out")]
    resume: bool,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

pub(super) fn parse_order(name: &str) -> Result<GraspOrder, String> {
    let orders = [GraspOrder::Parallel, GraspOrder::SequentialParallel, GraspOrder::Sequential];
    let found = orders.into_iter().find(|order| order.name() == name);
    found.ok_or_else(|| format!("orders are: {}", orders.map(GraspOrder::name).join(", ")))
}

pub(super) fn run(arguments: &EvaluateArguments, mut session: Session) -> Result<(), Failure> {
    session.configure(|config| {
        config.evaluate.trials = arguments.trials.unwrap_or(config.evaluate.trials);
        if !arguments.orders.is_empty() {
            config.evaluate.orders.clone_from(&arguments.orders);
        }
    })?;
    let grasps = crate::scenes::grasps(&session.config)?;
    let places: Vec<PathBuf> = ModelKind::ALL.map(|kind| arguments.checkpoint.join(kind.name())).into();
    let mut places: Vec<PathBuf> = places.into_iter().filter(|place| place.is_dir()).collect();
    if places.is_empty() {
        places.push(arguments.checkpoint.clone());
    }
    let models = places.iter().map(|place| load(place, grasps)).collect::<Result<Vec<_>, _>>()?;
    if let Some(out) = session.out.as_ref().filter(|_| arguments.resume) {
        session.info.check_same_run(out).or_bad_input()?;
    }
    let directory = session.output_directory(Path::new("runs/evaluate"))?;
    for (place, (kind, _)) in places.iter().zip(&models) {
        let kept = directory.join("models").join(kind.name());
        if arguments.resume && kept.is_dir() {
            check_same(place, &kept, grasps)?;
        } else if place.canonicalize().or_bad_input()? != kept.canonicalize().unwrap_or_default() {
            copy(place, &kept, grasps)?;
        }
    }
    keeps(format!("finished trials are kept in {}; the same command with --resume and --out goes on", directory.display()));
    let results = session.pool()?.install(|| table(&session, &models, &directory, arguments.resume))?;
    match session.layout {
        Layout::Line => session.print(&results),
        Layout::Indented => Ok(print(results.table().trim_end())?),
    }
}

/// Runs the configured cells, with `resume` those of their trials that are not kept in `directory`, and writes their results.
pub(super) fn table(
    session: &Session,
    models: &[(ModelKind, Vec<ContactNetwork>)],
    directory: &Path,
    resume: bool,
) -> Result<Results, Failure> {
    let config = &session.config;
    let methods = methods(&config.evaluate, models);
    if methods.is_empty() {
        let found: Vec<&str> = models.iter().map(|(kind, _)| kind.name()).collect();
        let asked: Vec<&str> = config.evaluate.methods.iter().map(|method| method.name()).collect();
        let (found, asked) = (found.join(", "), asked.join(", "));
        return Err(Failure::bad_input(format!("evaluate.methods: {asked}, and none of them uses the checkpoint's {found}")));
    }
    let evaluation = Evaluation::new(config, session.info.seed, methods)?;
    let (kept, there) = KeptTrials::open(directory, resume)?;
    let lines = evaluation.run(&kept, there)?;
    let results = evaluation.results(&session.info, &lines);
    save(directory, &lines, &results)?;
    kept.finish()?;
    Ok(results)
}
