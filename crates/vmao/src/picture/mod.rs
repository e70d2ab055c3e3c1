//! Pictures without a display: rollouts and clouds drawn by casting rays, as PNG and GIF with a palette.

mod animation;
mod cloud;
mod eye;
mod palette;
mod png;
mod studio;

pub(crate) use animation::{Animation, encode};
pub(crate) use cloud::{Cloud, eye_of};
pub(crate) use png::{save, sheet};
pub(crate) use studio::{Framing, Layer, Studio};
