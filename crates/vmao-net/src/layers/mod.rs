//! The layers of the network: each is declared once, trained on burn and predicted on plain slices.

#[cfg(test)]
mod closed_form;
mod dense;
mod modulated_head;
mod norm_linear;
mod set_abstraction;
mod set_up_conv;
mod shared_mlp;

pub(crate) use dense::{Head, PlainLinear};
pub(crate) use modulated_head::{FoldedModulated, ModulatedHead};
pub(crate) use norm_linear::{Folded, NormLinear};
pub(crate) use set_abstraction::SetAbstraction;
pub(crate) use set_up_conv::{FoldedUpConv, SetUpConv};
pub(crate) use shared_mlp::{FoldedGroup, GroupedMlp};

use crate::operations::{Operations, Rows};
use crate::parameters::ParameterId;

/// One training pass: the parameters as tensors, and the batch moments that the pass met.
#[derive(Debug)]
pub(crate) struct Pass<O: Operations> {
    /// Every array of the layout.
    pub(crate) weights: Vec<Rows<O>>,
    /// Mean and variance arrays of each normalisation, with the moments of this batch.
    pub(crate) moments: Vec<(ParameterId, ParameterId, O::Moments)>,
}

impl<O: Operations> Pass<O> {
    /// The array at `id`.
    pub(crate) fn get(&self, id: ParameterId) -> Rows<O> {
        self.weights[id.0].clone()
    }
}
