//! The perceptron that set abstraction and set up-convolution share over all neighbour pairs, and the maximum after it.

use super::{Folded, NormLinear, Pass};
use crate::kernels::edge::add_offsets;
use crate::kernels::linear::linear;
use crate::kernels::max_pool::max_pool;
use crate::operations::{Operations, Rows};
use crate::parameters::{Layout, Parameters};
use rayon::prelude::*;

/// For each centre: [offset, feature] of its k neighbours → shared perceptron → maximum over the k.
#[derive(Debug)]
pub(crate) struct GroupedMlp {
    first: NormLinear,
    rest: Vec<NormLinear>,
}

impl GroupedMlp {
    /// Declares the arrays; `inputs` is the width of the features without the offset.
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, channels: &[usize]) -> Self {
        let first = NormLinear::new(layout, &format!("{name}.0"), inputs + 3, channels[0]);
        let rest =
            (1..channels.len()).map(|i| NormLinear::new(layout, &format!("{name}.{i}"), channels[i - 1], channels[i])).collect();
        Self { first, rest }
    }

    /// Training: sources × inputs → centres × channels; `edges` holds centres × k pairs.
    pub(crate) fn forward<O: Operations>(&self, pass: &mut Pass<O>, x: Rows<O>, edges: &O::Edges, k: usize) -> Rows<O> {
        // The maximum is taken inside the last layer: its rows are never written out.
        let pool = |last: bool| if last { k } else { 1 };
        let mut y = self.first.forward_edges(pass, x, edges, pool(self.rest.is_empty()));
        for (i, layer) in self.rest.iter().enumerate() {
            y = layer.forward(pass, y, pool(i + 1 == self.rest.len()));
        }
        y
    }

    /// Prediction.
    pub(crate) fn fold(&self, parameters: &Parameters) -> FoldedGroup {
        FoldedGroup { first: self.first.fold(parameters), rest: self.rest.iter().map(|layer| layer.fold(parameters)).collect() }
    }
}

/// A [`GroupedMlp`] ready for prediction.
#[derive(Debug, Clone)]
pub(crate) struct FoldedGroup {
    first: Folded,
    rest: Vec<Folded>,
}

/// Grouped rows that one task of the prediction works on.
const TASK_ROWS: usize = 512;

impl FoldedGroup {
    /// sources × inputs → centres × channels, block by block: no grouped row outlives its block.
    pub(crate) fn apply(&self, x: &[f32], sources: &[u32], offsets: &[f32], k: usize) -> Vec<f32> {
        let channels = self.first.channels();
        let table = linear(x, &self.first.weight[3 * channels..], &self.first.bias, channels);
        let centres = TASK_ROWS.div_ceil(k);
        let blocks = sources.par_chunks(centres * k).zip(offsets.par_chunks(centres * k * 3));
        let block = |(sources, offsets): (&[u32], &[f32])| {
            let mut rows = Vec::with_capacity(sources.len() * channels);
            for &source in sources {
                rows.extend_from_slice(&table[source as usize * channels..(source as usize + 1) * channels]);
            }
            add_offsets(&mut rows, offsets, &self.first.weight, channels);
            rows.iter_mut().for_each(|value| *value = value.max(0.0));
            let (mut width, mut next) = (channels, Vec::new());
            for layer in &self.rest {
                layer.apply(&rows, &mut next);
                std::mem::swap(&mut rows, &mut next);
                width = layer.channels();
            }
            max_pool(&rows, k, width).0
        };
        blocks.map(block).collect::<Vec<_>>().concat()
    }
}
