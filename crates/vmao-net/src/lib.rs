//! The network of V-MAO (Liu & Kitani, CoRL 2021, supplement, Figure 2): from a coloured cloud and a latent code to contact maps.
//!
//! PointNet++ set abstraction down, FlowNet3D set up-convolution back to every point, trained as a conditional variational
//! autoencoder ([`ModelKind::Vmao`]) or without latent code ([`ModelKind::Top1`]). Trains on burn with fused operations,
//! predicts on plain slices. Opens no files and knows no simulator.

pub mod neighbours;
pub mod readers;

mod adam;
mod augment;
mod batch;
mod checkpoint;
mod cloud;
mod config;
mod course;
mod cvae;
mod device;
mod error;
mod kernels;
mod layers;
mod lesson;
mod network;
mod objective;
#[cfg(test)]
mod objective_checks;
mod operations;
mod parameters;
mod pyramid;
#[cfg(test)]
mod pytorch_goldens;
mod rehearsal;
mod sealed;
mod training;

pub use checkpoint::Checkpoint;
pub use cloud::Example;
pub use config::{
    AbstractionConfig, AugmentationConfig, LatentPlacement, ModelKind, NetworkConfig, TrainingConfig, UpConvConfig,
};
pub use course::{Training, train};
pub use device::Device;
pub use error::Error;
pub use lesson::{Lesson, Origin};
pub use network::{CodeDistribution, ContactNetwork, EncodedScene};
pub use rehearsal::Rehearsal;
pub use training::{Elbo, EpochReport};
