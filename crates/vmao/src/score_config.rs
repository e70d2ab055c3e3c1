//! How well a learned distribution is measured: the configuration's `[score]`.

use crate::config_bounds::within;
use serde::{Deserialize, Serialize};

/// What `vmao reference` tries and `vmao score` compares.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScoreConfig {
    /// Held-out scenes of the sizes explored, and as many of those kept back.
    pub scenes: u64,
    /// Tuples tried in each scene.
    pub tries: u64,
    /// Two contacts are the same if each finger is within this distance (m).
    pub distance: f64,
    /// Contacts whose middles are as near are connected to one mode (m) ...
    pub mode_distance: f64,
    /// ... if their closing axes are as near too (degrees).
    pub mode_angle_deg: f64,
    /// K: how many samples are compared with the reference.
    pub samples: Vec<usize>,
    /// Latent codes that a likelihood is estimated with.
    pub codes: usize,
    /// Successes of each scene whose likelihood is estimated, at most.
    pub likelihoods: usize,
    /// Scenes before a later grasp that are sampled.
    pub contexts: usize,
    /// Resamples of the scenes for an interval.
    pub resamples: usize,
}

impl ScoreConfig {
    /// Refuses what cannot be measured with.
    pub fn check(&self) -> Result<(), String> {
        let lengths = [("score.distance", self.distance), ("score.mode_distance", self.mode_distance)];
        for (key, value) in lengths {
            within(key, value, 1e-4, 1.0)?;
        }
        within("score.mode_angle_deg", self.mode_angle_deg, 0.1, 90.0)?;
        within("score.scenes", self.scenes as f64, 1.0, 999.0)?;
        within("score.tries", self.tries as f64, 1.0, 1e5)?;
        within("score.samples", self.samples.len() as f64, 1.0, 16.0)?;
        for &count in &self.samples {
            within("score.samples", count as f64, 1.0, 4096.0)?;
        }
        let counts = [
            ("score.codes", self.codes),
            ("score.likelihoods", self.likelihoods),
            ("score.contexts", self.contexts),
            ("score.resamples", self.resamples),
        ];
        counts.into_iter().try_for_each(|(key, value)| within(key, value as f64, 1.0, 1e5))
    }
}
