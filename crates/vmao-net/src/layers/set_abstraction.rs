//! Set abstraction (Qi et al., PointNet++, NIPS 2017, section 3.2).

use super::{FoldedGroup, GroupedMlp, Pass};
use crate::config::AbstractionConfig;
use crate::operations::{Operations, Rows};
use crate::parameters::{Layout, Parameters};

/// Carries the features of a cloud to fewer points: ball around each centroid → shared perceptron → maximum.
#[derive(Debug)]
pub(crate) struct SetAbstraction {
    group: GroupedMlp,
    num_neighbours: usize,
    num_centroids: usize,
    channels: usize,
}

impl SetAbstraction {
    /// Declares the arrays; `inputs` is the width of the finer features.
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, config: &AbstractionConfig) -> Self {
        Self {
            group: GroupedMlp::new(layout, &format!("{name}.mlp"), inputs, &config.channels),
            num_neighbours: config.num_neighbours,
            num_centroids: config.num_centroids,
            channels: config.channels[config.channels.len() - 1],
        }
    }

    /// Width of the output.
    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    /// Training: finer points × inputs → (clouds · centroids) × channels.
    pub(crate) fn forward<O: Operations>(&self, pass: &mut Pass<O>, finer: Rows<O>, balls: &O::Edges) -> Rows<O> {
        let y = self.group.forward(pass, finer, balls, self.num_neighbours);
        let [rows, channels] = y.dims();
        assert!(rows.is_multiple_of(self.num_centroids) && channels == self.channels, "{rows} x {channels} abstracted features");
        y
    }

    /// Prediction.
    pub(crate) fn fold(&self, parameters: &Parameters) -> (FoldedGroup, usize) {
        (self.group.fold(parameters), self.num_neighbours)
    }
}
