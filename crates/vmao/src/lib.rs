//! The program around the method: configuration, command line, data set, results.
//!
//! It knows files and people; the simulator's pointers and the network's tensors stay in their own crates.

pub mod acceptance;
pub mod commands;
pub mod config;
mod config_layers;
mod contact_maps;
pub mod dataset;
pub mod demonstrations;
pub mod evaluation;
pub mod exploration;
pub mod failure;
mod figures;
pub mod ik;
pub mod inputs;
pub mod interruption;
pub mod json;
mod json_place;
pub mod kept_trials;
pub mod learned_contacts;
pub mod learning;
pub mod merging;
pub mod object_import;
pub mod ocao;
pub mod output;
mod picture;
pub mod plan;
pub mod provenance;
pub mod published;
pub mod reference;
pub mod replay;
pub mod report;
pub mod results;
pub mod robot_meshes;
pub mod rollouts;
pub mod run_report;
pub mod scenes;
pub mod score_config;
pub mod scoring;
pub mod sharing;
pub mod significance;
pub mod statistics;
pub mod tensorboard;
pub mod training;
pub mod training_device;
pub mod training_log;
pub use vmao_core::wording;
