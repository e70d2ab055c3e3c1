//! report.html: one file that shows a run to a person, offline.
//!
//! [`ReportData`] says what a report holds, [`render`] makes the page. The page's script is built from
//! `viewer/` at the repository root by `viewer/build.sh` and committed here as `viewer.js`.

mod data;
mod failure_classes;
mod pack;
mod page;

pub use data::{
    Cell, ContactMapFigure, ExplorationRound, ExplorationSummary, FailureClass, LatentMap, Provenance, ReportData, RolloutFigure,
    ThresholdPoint, TrainingCurve, TrainingEpoch, TrialPlace,
};
pub(crate) use failure_classes::explanation;
pub use page::render;
