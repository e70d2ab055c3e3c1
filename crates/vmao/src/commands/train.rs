//! `vmao train`: checkpoints from a data set.

use super::{CommonOptions, Session};
use crate::{
    dataset,
    failure::{Failure, OrBadInput},
    scenes::grasps,
    training::{Found, TrainingRun, found, go_on},
    training_device::DeviceOptions,
};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};
use vmao_net::{Device, ModelKind};

#[derive(Debug, clap::Args)]
pub(super) struct TrainArguments {
    /// A data set written by `vmao explore`
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// The contact model
    #[arg(long, value_enum)]
    model: Model,
    /// Go on with the training that is there
    #[arg(long)]
    resume: bool,
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
    /// By the name of the network's directory.
    validation: BTreeMap<String, Validation>,
}

/// The terms of the weights that are kept; none without validation examples.
#[derive(Debug, Serialize)]
struct Validation {
    epoch: usize,
    reconstruction: Option<f32>,
    kl: Option<f32>,
}

pub(super) fn run(arguments: &TrainArguments, session: &Session) -> Result<(), Failure> {
    let kind = match arguments.model {
        Model::Vmao => ModelKind::Vmao,
        Model::Top1 => ModelKind::Top1,
    };
    let (config, info) = (&session.config, &session.info);
    let default = Path::new("runs/train").join(kind.name());
    let directory = session.out.clone().unwrap_or(default);
    if arguments.resume {
        info.check_resumes(&directory, config).or_bad_input()?;
    } else if found(&directory, grasps(config)?) == Found::Training {
        let directory = directory.display();
        let message = format!("{directory}: holds a training, expected an empty directory; --resume goes on with it");
        return Err(Failure::bad_input(message));
    }
    let records = dataset::load(&arguments.data).or_bad_input()?;
    if records.is_empty() {
        return Err(Failure::bad_input(format!("{}: no trials, expected a data set", arguments.data.display())));
    }
    if !arguments.resume {
        session.output_directory(&directory)?;
    }
    let go_on = go_on(&directory.join("config.toml"), info.seed, &arguments.data, kind, &directory);
    let device = arguments.device.resolve();
    let run = TrainingRun { config, kind, records: &records, seed: info.seed, device, directory: &directory, go_on };
    let (networks, lines) = session.pool()?.install(|| run.train())?;
    let validation = |(grasp, network): (usize, &vmao_net::Checkpoint)| {
        let (reconstruction, kl) = network.validation.map(|elbo| (elbo.reconstruction, elbo.kl)).unzip();
        (format!("grasp-{grasp}"), Validation { epoch: network.epoch, reconstruction, kl })
    };
    let epochs = lines.lines().iter().map(|line| line.epoch).max().unwrap_or(0);
    let validation = networks.iter().enumerate().map(validation).collect();
    session.print(&Answer { checkpoint: directory, device, epochs, validation })
}
