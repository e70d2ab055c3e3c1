//! The supplement's Figures 3 and 4 for a run, and what lifting the object changes for the next grasp.
//!
//! `docs/figures.md` shows them and defines the measures.

mod key_frames;
mod lifting;

pub(crate) use key_frames::key_frames;
pub(crate) use lifting::{changes, lifted_scenes, maps_picture, table};
