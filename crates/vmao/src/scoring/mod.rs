//! Does a model learn the distribution of contacts that succeed? Its samples and probabilities against explored successes.
//!
//! `docs/distribution.md` defines the measures and shows results; `docs/notation.md` has the symbols.

mod bootstrap;
mod calibration;
mod execution;
mod figures;
mod grips;
mod likelihood;
mod measure;
mod samplers;
mod summary;

pub use bootstrap::{Estimate, bootstrap, mean_of};
pub use calibration::{Rank, calibration_error, reliability};
pub use execution::{Executed, execute};
pub use figures::{coverage_figure, reliability_figure, scene_figure};
pub use grips::{Comparison, compare, diversity, grip_distance, modes};
pub use likelihood::{code_information, divergence, log_mean_exp, log_weight};
pub use measure::{Likelihoods, Models, SceneScore, Scored, score};
pub use samplers::{PeakRules, Sampler, pairs};
pub use summary::{Row, summarise, table};
