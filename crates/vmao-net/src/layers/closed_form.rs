//! Layers with weights chosen by hand, against values worked out by hand; and prediction against training.

use super::{GroupedMlp, Pass, SetAbstraction, SetUpConv};
use crate::config::{AbstractionConfig, UpConvConfig};
use crate::kernels::edge::Edges;
use crate::kernels::gather::Picks;
use crate::operations::{Fused, Rows};
use crate::parameters::{Layout, Parameters};
use burn::tensor::{Tensor, TensorData};
use std::sync::Arc;

fn set(layout: &Layout, parameters: &mut Parameters, name: &str, values: &[f32]) {
    let i = layout.specs().iter().position(|spec| spec.name == name).unwrap();
    assert_eq!(parameters.values[i].len(), values.len(), "{name}");
    parameters.values[i] = values.to_vec();
}

fn pass(layout: &Layout, parameters: &Parameters) -> Pass<Fused> {
    let tensor = |(values, spec): (&Vec<f32>, &crate::parameters::Spec)| {
        Tensor::from_data(TensorData::new(values.clone(), spec.shape), &Default::default())
    };
    Pass { weights: parameters.values.iter().zip(layout.specs()).map(tensor).collect(), moments: Vec::new() }
}

fn rows(values: &[f32], columns: usize) -> Rows<Fused> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len() / columns, columns]), &Default::default())
}

/// Running statistics that the batch moments of a pass would leave: prediction then equals training on that batch.
fn take_moments(parameters: &mut Parameters, pass: &Pass<Fused>) {
    for (mean, variance, moments) in &pass.moments {
        parameters.values[mean.0] = moments.mean.clone();
        parameters.values[variance.0] = moments.variance.clone();
    }
}

#[test]
fn set_abstraction_takes_the_largest_normalised_sum_of_offset_and_feature() {
    let mut layout = Layout::default();
    let config = AbstractionConfig { num_centroids: 2, radius: 1.0, num_neighbours: 2, channels: vec![1] };
    let layer = SetAbstraction::new(&mut layout, "a", 1, &config);
    let mut parameters = layout.start(0);
    // z = offset x + 2 offset y + 10 feature.
    set(&layout, &mut parameters, "a.mlp.0.weight", &[1.0, 2.0, 0.0, 10.0]);
    set(&layout, &mut parameters, "a.mlp.0.norm.weight", &[3.0]);
    set(&layout, &mut parameters, "a.mlp.0.norm.bias", &[1.0]);
    let offsets = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, -1.0, 5.0, 0.5, 0.25, 0.0];
    let edges = Arc::new(Edges { picks: Picks::new(vec![0, 2, 1, 2], 3), offsets });
    // Features 0.1, 0.2, 0.3: z = 2, 5, -1, 4; mean 2.5, variance 5.25.
    let mut pass = pass(&layout, &parameters);
    let found = layer.forward(&mut pass, rows(&[0.1, 0.2, 0.3], 1), &edges).into_data().into_vec::<f32>().unwrap();
    let expected = |z: f32| 3.0 * (z - 2.5) / (5.25_f32 + 1e-5).sqrt() + 1.0;
    assert!((found[0] - expected(5.0)).abs() < 1e-5 && (found[1] - expected(4.0)).abs() < 1e-5, "{found:?}");
    take_moments(&mut parameters, &pass);
    let (folded, k) = layer.fold(&parameters);
    let predicted = folded.apply(&[0.1, 0.2, 0.3], &edges.picks.sources, &edges.offsets, k);
    assert!(predicted.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-5), "{predicted:?}");
}

#[test]
fn set_up_conv_appends_the_skip_feature_before_its_second_perceptron() {
    let mut layout = Layout::default();
    let config = UpConvConfig { num_neighbours: 1, channels: vec![1], refine: vec![1] };
    let layer = SetUpConv::new(&mut layout, "u", 1, 1, &config);
    let mut parameters = layout.start(0);
    set(&layout, &mut parameters, "u.mlp.0.weight", &[0.0, 0.0, 0.0, 1.0]);
    set(&layout, &mut parameters, "u.mlp.0.norm.bias", &[2.0]);
    set(&layout, &mut parameters, "u.refine.0.weight", &[1.0, 100.0]);
    set(&layout, &mut parameters, "u.refine.0.norm.bias", &[2.0]);
    // One coarse point has feature 3, the other 5: normalised to -1 and 1, shifted to 1 and 3 for fine points 0, 1 and 2, 3.
    let edges = Arc::new(Edges { picks: Picks::new(vec![0, 0, 1, 1], 2), offsets: vec![0.5; 12] });
    let mut pass = pass(&layout, &parameters);
    let skip = [0.0, 0.02, 0.0, 0.02];
    let found =
        layer.forward(&mut pass, rows(&[3.0, 5.0], 1), vec![rows(&skip, 1)], &edges).into_data().into_vec::<f32>().unwrap();
    // Sums 1, 3, 3, 5: mean 3, variance 2; relu(ẑ + 2).
    let expected = [-2.0_f32, 0.0, 0.0, 2.0].map(|z| z / 2.0_f32.sqrt() + 2.0);
    assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
    take_moments(&mut parameters, &pass);
    let predicted = layer.fold(&parameters).apply(&[3.0, 5.0], &skip, &[], &edges.picks.sources, &edges.offsets);
    assert!(predicted.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-4), "{predicted:?}");
}

#[test]
fn a_grouped_perceptron_does_not_care_about_the_order_of_the_neighbours() {
    let mut layout = Layout::default();
    let layer = GroupedMlp::new(&mut layout, "g", 2, &[5, 4]);
    let folded = layer.fold(&layout.start(3));
    let features: Vec<f32> = (0..14).map(|i| (i as f32).sin()).collect();
    let offsets: Vec<f32> = (0..18).map(|i| (2.0 * i as f32).cos()).collect();
    let there = folded.apply(&features, &[0, 3, 6, 1, 2, 5], &offsets, 3);
    let mut turned = offsets.clone();
    turned[..9].rotate_left(3);
    let back = folded.apply(&features, &[3, 6, 0, 1, 2, 5], &turned, 3);
    assert_eq!(there, back);
    assert!(there.iter().any(|&y| y > 0.1));
}
