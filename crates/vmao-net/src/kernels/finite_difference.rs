//! Gradients against central differences along random directions; for tests.

use vmao_core::random::Stream;

/// `count` standard normal numbers.
pub(crate) fn normal(seed: u64, count: usize) -> Vec<f32> {
    let mut stream = Stream::new(seed, &[77]);
    (0..count).map(|_| stream.normal() as f32).collect()
}

/// Asserts that `gradient` predicts how `loss` changes when `x` moves along directions half gradient, half random.
///
/// One of `steps` has to agree to `tolerance` of the gradient's length: long ones meet the kinks of ReLU and maximum, short ones
/// drown in rounding, but a wrong gradient agrees with none.
#[track_caller]
pub(crate) fn check(what: &str, x: &[f32], gradient: &[f32], steps: &[f64], tolerance: f64, mut loss: impl FnMut(&[f32]) -> f64) {
    assert_eq!(x.len(), gradient.len(), "{what}: a derivative for each number");
    let length = dot(gradient, gradient).sqrt();
    assert!(length > 1e-6, "{what}: a gradient of zero tests nothing");
    for seed in 0..3 {
        let random = normal(1000 + seed, x.len());
        let scale = dot(&random, &random).sqrt();
        let pair = || gradient.iter().zip(&random);
        let direction: Vec<f64> = pair().map(|(&g, &r)| f64::from(g) / length + f64::from(r) / scale).collect();
        let mut moved = |step: f64| {
            let x: Vec<f32> = x.iter().zip(&direction).map(|(x, d)| (f64::from(*x) + step * d) as f32).collect();
            loss(&x)
        };
        let expected: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(*g) * d).sum();
        let found: Vec<f64> = steps.iter().map(|&step| (moved(step) - moved(-step)) / (2.0 * step)).collect();
        let close = found.iter().any(|found| (found - expected).abs() < tolerance * length);
        assert!(close, "{what}: differences {found:?}, gradient {expected}, length {length}");
    }
}

/// Σ of products, in double precision.
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}
