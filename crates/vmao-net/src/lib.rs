//! The network of V-MAO (Liu & Kitani, CoRL 2021, supplement, Figure 2): from a coloured cloud and a latent code to contact maps.
//!
//! PointNet++ set abstraction down, FlowNet3D set up-convolution back to every point, trained as a conditional variational
//! autoencoder ([`ModelKind::Vmao`]) or without latent code ([`ModelKind::Top1`]). Trains on burn with fused operations,
//! predicts on plain slices. Opens no files and knows no simulator.

pub mod neighbours;

mod adam;
mod augment;
mod batch;
mod checkpoint;
mod cloud;
mod config;
mod cvae;
mod error;
mod kernels;
mod layers;
mod network;
#[cfg(test)]
mod objective_checks;
mod parameters;
mod pyramid;
#[cfg(test)]
mod pytorch_goldens;
mod tape;
mod training;

pub use checkpoint::Checkpoint;
pub use cloud::Example;
pub use config::{
    AbstractionConfig, AugmentationConfig, LatentPlacement, ModelKind, NetworkConfig, TrainingConfig, UpConvConfig,
};
pub use error::Error;
pub use network::{CodeDistribution, ContactNetwork, EncodedScene};
pub use training::{Elbo, EpochReport, train};
