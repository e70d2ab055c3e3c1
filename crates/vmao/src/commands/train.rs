//! `vmao train`: checkpoints from a data set.

use super::{CommonOptions, Session};
use crate::{
    dataset,
    failure::{Failure, OrBadInput},
    interruption::keeps,
    learning::train_all,
    training_device::DeviceOptions,
};
use serde::Serialize;
use std::path::{Path, PathBuf};
use vmao_net::{Device, ModelKind};

#[derive(Debug, clap::Args)]
pub(super) struct TrainArguments {
    /// A data set written by `vmao explore`
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// The contact model
    #[arg(long, value_enum)]
    model: Model,
    #[command(flatten)]
    device: DeviceOptions,
    #[command(flatten)]
    pub(super) common: CommonOptions,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Model {
    /// The generative model
    Vmao,
    /// The deterministic baseline
    Top1,
}

#[derive(Debug, Serialize)]
struct Answer {
    checkpoint: PathBuf,
    device: Device,
    epochs: usize,
    validation: Vec<Validation>,
}

#[derive(Debug, Serialize)]
struct Validation {
    grasp: usize,
    reconstruction: Option<f32>,
    kl: Option<f32>,
}

pub(super) fn run(arguments: &TrainArguments, session: &Session) -> Result<(), Failure> {
    let kind = match arguments.model {
        Model::Vmao => ModelKind::Vmao,
        Model::Top1 => ModelKind::Top1,
    };
    let records = dataset::load(&arguments.data).or_bad_input()?;
    if records.is_empty() {
        return Err(Failure::bad_input(format!("{}: no trials, expected a data set", arguments.data.display())));
    }
    let directory = session.output_directory(&Path::new("runs/train").join(kind.name()))?;
    keeps(format!("the data set is kept, networks that were finished are in {}; run it again", directory.display()));
    let device = arguments.device.resolve();
    let lines = session.pool()?.install(|| train_all(&session.config, kind, &records, session.info.seed, device, &directory))?;
    let last = |grasp: usize| lines.iter().rfind(|line| line.grasp == grasp);
    let validation = (0..crate::scenes::grasps(&session.config)?)
        .filter_map(last)
        .map(|line| Validation { grasp: line.grasp, reconstruction: line.validation_reconstruction, kl: line.validation_kl })
        .collect();
    session.print(&Answer { checkpoint: directory, device, epochs: session.config.train.epochs, validation })
}
