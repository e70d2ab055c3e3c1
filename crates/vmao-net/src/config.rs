//! What a network is made of, and how it is trained.

use crate::error::Error;
use serde::{Deserialize, Serialize};
use std::fmt::Display;
use vmao_core::wording::excerpt;

/// With or without a latent code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelKind {
    /// The conditional variational autoencoder: a map for every latent code.
    Vmao,
    /// The same network without latent code: one map (supplement, appendix C).
    Top1,
}

impl ModelKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::Vmao, Self::Top1];

    /// The name in documents, and of a checkpoint's directory.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vmao => "vmao",
            Self::Top1 => "top1",
        }
    }

    /// The name for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Vmao => "V-MAO",
            Self::Top1 => "Top-1",
        }
    }
}

/// One set-abstraction layer (PointNet++).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AbstractionConfig {
    /// Points kept, by farthest-point sampling.
    pub num_centroids: usize,
    /// Reach of the ball query (m).
    pub radius: f32,
    /// Neighbours per centroid.
    pub num_neighbours: usize,
    /// Widths of the shared perceptron.
    pub channels: Vec<usize>,
}

/// One set up-convolution layer (FlowNet3D).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UpConvConfig {
    /// Nearest coarse points per fine point.
    pub num_neighbours: usize,
    /// Widths of the perceptron before the maximum.
    pub channels: Vec<usize>,
    /// Widths of the perceptron after the skip features are appended.
    pub refine: Vec<usize>,
}

/// Where the decoder sees the latent code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LatentPlacement {
    /// Appended to the coarsest features only.
    Bottleneck,
    /// Appended to the coarsest features and to the skip features of every level.
    EveryLevel,
}

/// The network of the supplement's Figure 2 and its objective.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// Points of a training cloud; larger ones are thinned at random, smaller ones taken as they are.
    pub points: usize,
    /// How far centroids follow the density of the points: 0 covers space evenly (PointNet++), 1 is as dense as the points are.
    pub density_power: f32,
    /// Set abstraction, finest first; scene and posterior encoder have the same layers.
    pub abstraction: Vec<AbstractionConfig>,
    /// Set up-convolution, coarsest first; the last one reaches every point.
    pub up_conv: Vec<UpConvConfig>,
    /// Width of the layer before the two logits.
    pub head: usize,
    /// Z, length of the latent code.
    pub latent_size: usize,
    /// Where the decoder sees it.
    pub latent_placement: LatentPlacement,
    /// Weight of the KL divergence against the reconstruction (nats per nat).
    pub beta: f32,
    /// λ: what each number of the latent code may say without being charged for, on the mean over a batch (nats); 0 charges for all.
    #[serde(default)]
    pub free_bits: f32,
    /// Fraction of the epochs in which the weight of the KL divergence rises linearly from zero.
    pub warm_up: f32,
    /// Spread of a contact label over the cloud: standard deviation of a Gaussian about the contact point (m).
    pub label_sigma: f32,
    /// Points above this height stand on the table and centre the cloud (m).
    pub table_height: f32,
    /// Height taken as zero by the network (m).
    pub height_origin: f32,
    /// Length that one unit of a position feature stands for (m).
    pub position_unit: f32,
}

/// Random changes of a training cloud and its labels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AugmentationConfig {
    /// Largest rotation about gravity, either way (rad).
    pub rotation: f32,
    /// Standard deviation of the noise on each coordinate (m).
    pub jitter: f32,
    /// Largest relative change of each colour channel.
    pub color_gain: f32,
}

/// How a network is trained.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingConfig {
    /// Passes over the training examples.
    pub epochs: usize,
    /// Clouds per optimiser step.
    pub batch_size: usize,
    /// Adam's step size at the start.
    pub learning_rate: f32,
    /// Adam's step size at the end; a half cosine lies between.
    pub final_learning_rate: f32,
    /// Epochs after the warm-up without a better validation loss that end the training; 0 for all epochs.
    pub patience: usize,
    /// Share of the examples kept for validation.
    pub validation_fraction: f32,
    /// Random changes of the training clouds.
    pub augmentation: AugmentationConfig,
}

impl NetworkConfig {
    /// A network of some 50 000 weights for a table-top object of 0.2 m, trained on a few hundred clouds in seconds.
    ///
    /// Radii grow from finger width (15 mm) to the length of a handle; the last level is the whole cloud. β is between two failures
    /// seen on toys: below 0.01 drawn codes fall outside what the posterior uses, above 0.1 the code falls silent.
    pub fn small() -> Self {
        let down = |num_centroids, radius, num_neighbours, channels: &[usize]| AbstractionConfig {
            num_centroids,
            radius,
            num_neighbours,
            channels: channels.to_vec(),
        };
        let up = |num_neighbours, channels: &[usize], refine: &[usize]| UpConvConfig {
            num_neighbours,
            channels: channels.to_vec(),
            refine: refine.to_vec(),
        };
        Self {
            points: 2048,
            density_power: 1.0,
            abstraction: vec![
                down(192, 0.015, 16, &[16, 32]),
                down(64, 0.03, 16, &[32, 64]),
                down(16, 0.06, 16, &[64, 64]),
                down(1, 10.0, 16, &[64, 96]),
            ],
            up_conv: vec![up(1, &[64], &[64]), up(4, &[64], &[64]), up(4, &[48], &[32]), up(3, &[32], &[32])],
            head: 32,
            latent_size: 3,
            latent_placement: LatentPlacement::EveryLevel,
            beta: 0.03,
            free_bits: 0.5,
            warm_up: 0.1,
            label_sigma: 0.006,
            table_height: 0.003,
            height_origin: 0.03,
            position_unit: 0.05,
        }
    }

    /// The fewest points that a cloud may have.
    pub fn fewest_points(&self) -> usize {
        self.abstraction.first().map_or(1, |level| level.num_centroids)
    }

    /// Refuses what no network can be built from.
    pub fn validate(&self) -> Result<(), Error> {
        check("abstraction", self.abstraction.len(), (1..=8).contains(&self.abstraction.len()), "1 to 8 layers")?;
        let same = self.up_conv.len() == self.abstraction.len();
        check("up_conv", self.up_conv.len(), same, "as many layers as abstraction")?;
        let mut finer = self.points;
        for (i, level) in self.abstraction.iter().enumerate() {
            let field = |name| format!("abstraction[{i}].{name}");
            let count = level.num_centroids;
            check(
                &field("num_centroids"),
                count,
                (1..=finer).contains(&count),
                &format!("1 to {finer}, the points of the finer level"),
            )?;
            check(&field("radius"), level.radius, level.radius > 0.0 && level.radius.is_finite(), "a positive length (m)")?;
            check(&field("num_neighbours"), level.num_neighbours, (1..=1024).contains(&level.num_neighbours), "1 to 1024")?;
            widths(&field("channels"), &level.channels)?;
            finer = count;
        }
        for (i, (layer, level)) in self.up_conv.iter().zip(self.abstraction.iter().rev()).enumerate() {
            let field = |name| format!("up_conv[{i}].{name}");
            let (k, most) = (layer.num_neighbours, level.num_centroids.min(1024));
            check(
                &field("num_neighbours"),
                k,
                (1..=most).contains(&k),
                &format!("1 to {most}, the points of the coarser level"),
            )?;
            widths(&field("channels"), &layer.channels)?;
            widths(&field("refine"), &layer.refine)?;
        }
        let power = self.density_power;
        check("density_power", power, (0.0..=2.0).contains(&power), "0 to 2")?;
        check("head", self.head, (1..=4096).contains(&self.head), "1 to 4096")?;
        check("latent_size", self.latent_size, (1..=1024).contains(&self.latent_size), "1 to 1024")?;
        check("beta", self.beta, self.beta >= 0.0 && self.beta.is_finite(), "zero or positive")?;
        check("free_bits", self.free_bits, (0.0..=100.0).contains(&self.free_bits), "0 to 100 (nats)")?;
        check("warm_up", self.warm_up, (0.0..=1.0).contains(&self.warm_up), "a fraction of the epochs, 0 to 1")?;
        for (field, value) in [("label_sigma", self.label_sigma), ("position_unit", self.position_unit)] {
            check(field, value, value > 0.0 && value.is_finite(), "a positive length (m)")?;
        }
        for (field, value) in [("table_height", self.table_height), ("height_origin", self.height_origin)] {
            check(field, value, value.is_finite(), "a height (m)")?;
        }
        Ok(())
    }
}

impl TrainingConfig {
    /// Half a minute of training on two cores for two hundred clouds of [`NetworkConfig::small`].
    ///
    /// The augmentation is strong because a network that can tell the training scenes apart learns their grips by heart, and then
    /// needs no latent code.
    pub fn small() -> Self {
        Self {
            epochs: 40,
            batch_size: 8,
            learning_rate: 1e-2,
            final_learning_rate: 1e-4,
            patience: 12,
            validation_fraction: 0.1,
            augmentation: AugmentationConfig { rotation: 0.8, jitter: 0.003, color_gain: 0.3 },
        }
    }

    /// Refuses what cannot be trained with.
    pub fn validate(&self) -> Result<(), Error> {
        check("epochs", self.epochs, (1..=10_000_000).contains(&self.epochs), "1 to 10000000")?;
        check("batch_size", self.batch_size, (1..=4096).contains(&self.batch_size), "1 to 4096")?;
        for (field, value) in [("learning_rate", self.learning_rate), ("final_learning_rate", self.final_learning_rate)] {
            check(field, value, value > 0.0 && value.is_finite(), "positive")?;
        }
        let fraction = self.validation_fraction;
        check("validation_fraction", fraction, (0.0..=0.9).contains(&fraction), "0 to 0.9")?;
        let a = &self.augmentation;
        let largest = std::f32::consts::PI + 1e-6;
        check("augmentation.rotation", a.rotation, (0.0..=largest).contains(&a.rotation), "an angle from 0 to pi (rad)")?;
        check("augmentation.jitter", a.jitter, a.jitter >= 0.0 && a.jitter.is_finite(), "zero or a positive length (m)")?;
        check("augmentation.color_gain", a.color_gain, (0.0..1.0).contains(&a.color_gain), "at least 0 and below 1")
    }
}

fn check(field: &str, found: impl Display, holds: bool, expected: &str) -> Result<(), Error> {
    if holds {
        return Ok(());
    }
    Err(Error::Config { field: field.to_owned(), found: excerpt(&found.to_string()), expected: expected.to_owned() })
}

fn widths(field: &str, channels: &[usize]) -> Result<(), Error> {
    let fine = !channels.is_empty() && channels.iter().all(|c| (1..=4096).contains(c));
    check(field, format!("{channels:?}"), fine, "one or more widths from 1 to 4096")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_small_configurations_are_valid_and_survive_json() {
        let network = NetworkConfig::small();
        network.validate().unwrap();
        TrainingConfig::small().validate().unwrap();
        let json = serde_json::to_string(&network).unwrap();
        assert_eq!(serde_json::from_str::<NetworkConfig>(&json).unwrap(), network);
        let extra = json.replacen('{', "{\"sparkle\":1,", 1);
        assert!(serde_json::from_str::<NetworkConfig>(&extra).unwrap_err().to_string().contains("sparkle"));
    }

    #[test]
    fn a_level_cannot_keep_more_points_than_the_one_below() {
        let mut network = NetworkConfig::small();
        network.abstraction[1].num_centroids = 500;
        assert_eq!(
            network.validate().unwrap_err().to_string(),
            "abstraction[1].num_centroids is 500; it must be 1 to 192, the points of the finer level"
        );
    }
}
