//! From PartNet-Mobility folders, URDF and MJCF files to objects that can be simulated.
//!
//! Whatever is read was written by others: bounded in size, counts, nesting and paths, and refused with a place and a reason.
//! docs/import.md says what is read, repaired and refused. This crate knows files and meshes; it knows no simulator.

pub mod cache;
pub mod category;
pub mod decompose;
pub mod description;
mod error;
pub mod files;
pub mod hull;
mod import;
pub mod mesh;
pub mod mjcf;
mod overlap;
pub mod partnet;
pub mod readers;
pub mod repairs;
mod solid;
pub mod source;
pub mod structure;
pub mod surface;
pub mod texture;
pub mod urdf;
mod visual;
pub mod xml;

pub use error::Error;
pub use import::{DEFAULT_HULLS, Import, MAX_HULLS, Options, UpAxis, import};
pub use structure::HelperMotion;
pub use visual::Picture;
