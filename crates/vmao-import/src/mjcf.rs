//! Reads MJCF, MuJoCo's own format. Includes are not followed.

mod document;
mod object;

pub use document::{Attributes, Body, Element, MeshAsset, Model};
pub use object::read;
