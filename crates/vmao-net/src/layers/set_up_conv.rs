//! Set up-convolution (Liu et al., FlowNet3D, CVPR 2019, section 4.3).

use super::{Folded, FoldedGroup, GroupedMlp, NormLinear, Pass};
use crate::config::UpConvConfig;
use crate::kernels::blocks::BLOCK;
use crate::operations::{Operations, Rows};
use crate::parameters::{Layout, Parameters};
use burn::tensor::Tensor;
use rayon::prelude::*;

/// Carries coarse features to a finer cloud.
///
/// For each fine point its nearest coarse points → shared perceptron on (offset, feature) → maximum → own skip feature appended →
/// second perceptron.
#[derive(Debug)]
pub(crate) struct SetUpConv {
    group: GroupedMlp,
    refine: Vec<NormLinear>,
    num_neighbours: usize,
    channels: usize,
}

impl SetUpConv {
    /// Declares the arrays; `coarse` and `skip` are the widths of the coarse and of the appended features.
    pub(crate) fn new(layout: &mut Layout, name: &str, coarse: usize, skip: usize, config: &UpConvConfig) -> Self {
        let group = GroupedMlp::new(layout, &format!("{name}.mlp"), coarse, &config.channels);
        let mut inputs = config.channels[config.channels.len() - 1] + skip;
        let mut refine = Vec::with_capacity(config.refine.len());
        for (i, &channels) in config.refine.iter().enumerate() {
            refine.push(NormLinear::new(layout, &format!("{name}.refine.{i}"), inputs, channels));
            inputs = channels;
        }
        Self { group, refine, num_neighbours: config.num_neighbours, channels: inputs }
    }

    /// Width of the output.
    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    /// Training: coarse points × coarse width, and skip features of the fine points, → fine points × channels.
    pub(crate) fn forward<O: Operations>(
        &self,
        pass: &mut Pass<O>,
        coarse: Rows<O>,
        mut skip: Vec<Rows<O>>,
        nearest: &O::Edges,
    ) -> Rows<O> {
        let pooled = self.group.forward(pass, coarse, nearest, self.num_neighbours);
        let [fine, _] = pooled.dims();
        assert!(skip.iter().all(|s| s.dims()[0] == fine), "a skip feature for each of {fine} fine points");
        skip.insert(0, pooled);
        let mut y = Tensor::cat(skip, 1);
        for layer in &self.refine {
            y = layer.forward(pass, y, 1);
        }
        assert_eq!(y.dims(), [fine, self.channels], "one row for each fine point");
        y
    }

    /// Prediction.
    pub(crate) fn fold(&self, parameters: &Parameters) -> FoldedUpConv {
        FoldedUpConv {
            group: self.group.fold(parameters),
            refine: self.refine.iter().map(|layer| layer.fold(parameters)).collect(),
            num_neighbours: self.num_neighbours,
        }
    }
}

/// A [`SetUpConv`] ready for prediction.
#[derive(Debug, Clone)]
pub(crate) struct FoldedUpConv {
    group: FoldedGroup,
    refine: Vec<Folded>,
    num_neighbours: usize,
}

impl FoldedUpConv {
    /// Coarse features and skip features (fine points × any width) and one row `common` for all, → fine points × channels.
    pub(crate) fn apply(&self, coarse: &[f32], skip: &[f32], common: &[f32], sources: &[u32], offsets: &[f32]) -> Vec<f32> {
        let pooled = self.group.apply(coarse, sources, offsets, self.num_neighbours);
        let fine = sources.len() / self.num_neighbours;
        let (own, skips) = (pooled.len() / fine, skip.len() / fine);
        let block = |(pooled, skip): (&[f32], &[f32])| {
            let mut rows = Vec::with_capacity(pooled.len() + skip.len() + pooled.len() / own * common.len());
            for (pooled, skip) in pooled.chunks_exact(own).zip(skip.chunks_exact(skips)) {
                rows.extend_from_slice(pooled);
                rows.extend_from_slice(skip);
                rows.extend_from_slice(common);
            }
            let mut next = Vec::new();
            for layer in &self.refine {
                layer.apply(&rows, &mut next);
                std::mem::swap(&mut rows, &mut next);
            }
            rows
        };
        pooled.par_chunks(BLOCK * own).zip(skip.par_chunks(BLOCK * skips)).map(block).collect::<Vec<_>>().concat()
    }
}
