//! Training examples made ready once, and batches of them put together for each step.

use crate::augment::{View, augment};
use crate::cloud::{Example, Frame, features, label_maps, map_means, outward, posterior_features};
use crate::config::{AugmentationConfig, NetworkConfig};
use crate::kernels::edge::Edges;
use crate::kernels::gather::Picks;
use crate::pyramid::{Flow, Pyramid, spacing};
use rayon::prelude::*;
use std::sync::Arc;
use vmao_core::random::Stream;

/// An example thinned, put in its frame, ordered and labelled.
#[derive(Debug, Clone)]
pub(crate) struct Prepared {
    pub(crate) pyramid: Pyramid,
    /// Farthest-point order.
    pub(crate) cloud: View,
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
        let (pyramid, cloud) = read(&world, &colors, config);
        let maps = label_maps(&pyramid.sort(&world), &example.contacts, config.label_sigma);
        Self { pyramid, cloud, maps }
    }

    /// A copy with another turn, noise and tint.
    pub(crate) fn augmented(&self, config: &AugmentationConfig, stream: &mut Stream) -> View {
        let mut cloud = self.cloud.clone();
        augment(&mut cloud, config, stream);
        cloud
    }
}

/// A world-frame cloud as the network reads it: its neighbourhoods, and its points in its own frame and in farthest-point order.
pub(crate) fn read(points: &[[f32; 3]], colors: &[[f32; 3]], config: &NetworkConfig) -> (Pyramid, View) {
    let spacing = spacing(points);
    let pyramid = Pyramid::new(points, &spacing, config);
    let frame = Frame::of(points, &spacing, config);
    let outward: Vec<[f32; 3]> = outward(points, config.abstraction[0].radius).into_iter().map(|o| frame.turn(o)).collect();
    let cloud = View {
        points: pyramid.sort(&frame.place(points, config)),
        colors: pyramid.sort(colors),
        outward: pyramid.sort(&outward),
    };
    (pyramid, cloud)
}

/// An example with its cloud as augmented for one step.
pub(crate) type Member<'a> = (&'a Prepared, View);

/// Clouds one after the other, with all neighbour pairs in rows of the whole batch.
#[derive(Debug)]
pub(crate) struct Batch {
    /// Number of clouds.
    pub(crate) clouds: usize,
    /// Points × 9.
    pub(crate) features: Vec<f32>,
    /// Points × 11: the features and the label maps.
    pub(crate) posterior_features: Vec<f32>,
    /// Means of the label maps, clouds × 6.
    pub(crate) map_means: Vec<f32>,
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
        let mut means = Vec::with_capacity(members.len() * 6);
        let (mut rows, mut posterior, mut targets, mut starts) = (Vec::new(), Vec::new(), Vec::new(), vec![0]);
        for (prepared, cloud) in members {
            let own = features(&cloud.points, &cloud.colors, &cloud.outward, config);
            posterior.extend(posterior_features(&own, &prepared.maps));
            rows.extend(own);
            means.extend(map_means(&cloud.points, &prepared.maps, config));
            targets.extend_from_slice(&prepared.maps);
            starts.push(starts[starts.len() - 1] + cloud.points.len());
        }
        let levels = config.abstraction.len();
        let size = |level: usize| members.iter().map(|(p, _)| p.pyramid.counts[level]).sum::<usize>();
        let edges = |level: usize, flow: Flow| {
            let mut out = (Vec::new(), Vec::new());
            let from = if flow == Flow::Down { level } else { level + 1 };
            let mut base = 0;
            for (prepared, cloud) in members {
                prepared.pyramid.pairs(&cloud.points, level, flow, base, &mut out);
                base += prepared.pyramid.counts[from];
            }
            Arc::new(Edges { picks: Picks::new(out.0, size(from)), offsets: out.1 })
        };
        let tasks: Vec<(usize, Flow)> = (0..levels).map(|l| (l, Flow::Down)).chain((0..levels).map(|l| (l, Flow::Up))).collect();
        let mut down: Vec<Arc<Edges>> = tasks.into_par_iter().map(|(level, flow)| edges(level, flow)).collect();
        let up = down.split_off(levels);
        let owner = |level: usize| {
            let own = members.iter().enumerate().flat_map(|(b, (p, _))| std::iter::repeat_n(b as u32, p.pyramid.counts[level]));
            Arc::new(Picks::new(own.collect(), members.len()))
        };
        let owners = (0..=levels).map(owner).collect();
        Self {
            clouds: members.len(),
            features: rows,
            posterior_features: posterior,
            map_means: means,
            targets,
            starts,
            down,
            up,
            owners,
        }
    }
}
