//! Training examples made ready once, and batches of them put together for each step.

use crate::augment::augment;
use crate::cloud::{Example, centre, features, label_maps, posterior_features};
use crate::config::{AugmentationConfig, NetworkConfig};
use crate::kernels::edge::Edges;
use crate::kernels::gather::Picks;
use crate::pyramid::{Flow, Pyramid};
use rayon::prelude::*;
use std::sync::Arc;
use vmao_core::random::Stream;

/// An example thinned, centred, ordered and labelled.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub(crate) pyramid: Pyramid,
    /// Centred, farthest-point order.
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) colors: Vec<[f32; 3]>,
    /// Label maps, points × 2.
    pub(crate) maps: Vec<f32>,
}

impl Prepared {
    /// Thins to `config.points` at random, then orders and labels.
    pub(crate) fn new(example: &Example, config: &NetworkConfig, stream: &mut Stream) -> Self {
        let mut kept: Vec<usize> = (0..example.points.len()).collect();
        if kept.len() > config.points {
            kept = stream.permutation(example.points.len());
            kept.truncate(config.points);
            kept.sort_unstable();
        }
        let world: Vec<[f32; 3]> = kept.iter().map(|&i| example.points[i]).collect();
        let colors: Vec<[f32; 3]> = kept.iter().map(|&i| example.colors[i]).collect();
        let pyramid = Pyramid::new(&world, config);
        let maps = label_maps(&pyramid.sort(&world), &example.contacts, config.label_sigma);
        let points = pyramid.sort(&centre(&world, config));
        let colors = pyramid.sort(&colors);
        Self { pyramid, points, colors, maps }
    }

    /// A copy with another turn, noise and tint.
    pub(crate) fn augmented(&self, config: &AugmentationConfig, stream: &mut Stream) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let (mut points, mut colors) = (self.points.clone(), self.colors.clone());
        augment(&mut points, &mut colors, config, stream);
        (points, colors)
    }
}

/// An example with its points and colours as augmented for one step.
pub(crate) type Member<'a> = (&'a Prepared, Vec<[f32; 3]>, Vec<[f32; 3]>);

/// Clouds one after the other, with all neighbour pairs in rows of the whole batch.
#[derive(Debug)]
pub(crate) struct Batch {
    /// Number of clouds.
    pub(crate) clouds: usize,
    /// Points × 6.
    pub(crate) features: Vec<f32>,
    /// Points × 8: the features and the label maps.
    pub(crate) posterior_features: Vec<f32>,
    /// Label maps, points × 2.
    pub(crate) targets: Vec<f32>,
    /// First row of each cloud, and the number of rows.
    pub(crate) starts: Vec<usize>,
    /// Set-abstraction pairs from each level to the next coarser.
    pub(crate) down: Vec<Arc<Edges>>,
    /// Up-convolution pairs to each level from the next coarser.
    pub(crate) up: Vec<Arc<Edges>>,
    /// For each level the cloud that each row belongs to.
    pub(crate) owners: Vec<Arc<Picks>>,
}

impl Batch {
    /// Puts together `members`.
    pub(crate) fn new(members: &[Member<'_>], config: &NetworkConfig) -> Self {
        let (mut rows, mut posterior, mut targets, mut starts) = (Vec::new(), Vec::new(), Vec::new(), vec![0]);
        for (prepared, points, colors) in members {
            let own = features(points, colors, config);
            posterior.extend(posterior_features(&own, &prepared.maps));
            rows.extend(own);
            targets.extend_from_slice(&prepared.maps);
            starts.push(starts[starts.len() - 1] + points.len());
        }
        let levels = config.abstraction.len();
        let size = |level: usize| members.iter().map(|(p, ..)| p.pyramid.counts[level]).sum::<usize>();
        let edges = |level: usize, flow: Flow| {
            let mut out = (Vec::new(), Vec::new());
            let from = if flow == Flow::Down { level } else { level + 1 };
            let mut base = 0;
            for (prepared, points, _) in members {
                prepared.pyramid.pairs(points, level, flow, base, &mut out);
                base += prepared.pyramid.counts[from];
            }
            Arc::new(Edges { picks: Picks::new(out.0, size(from)), offsets: out.1 })
        };
        let tasks: Vec<(usize, Flow)> = (0..levels).map(|l| (l, Flow::Down)).chain((0..levels).map(|l| (l, Flow::Up))).collect();
        let mut down: Vec<Arc<Edges>> = tasks.into_par_iter().map(|(level, flow)| edges(level, flow)).collect();
        let up = down.split_off(levels);
        let owner = |level: usize| {
            let own = members.iter().enumerate().flat_map(|(b, (p, ..))| std::iter::repeat_n(b as u32, p.pyramid.counts[level]));
            Arc::new(Picks::new(own.collect(), members.len()))
        };
        let owners = (0..=levels).map(owner).collect();
        Self { clouds: members.len(), features: rows, posterior_features: posterior, targets, starts, down, up, owners }
    }
}
