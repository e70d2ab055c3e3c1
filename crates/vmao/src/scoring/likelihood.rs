//! How probable a model finds a contact, and how far the latent code decides the map: estimates from finitely many codes.

use std::f64::consts::TAU;

/// ln (1/n Σ exp aᵢ), without overflow; minus infinity of nothing.
pub fn log_mean_exp(logs: &[f64]) -> f64 {
    let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        return largest;
    }
    largest + (logs.iter().map(|log| (log - largest).exp()).sum::<f64>() / logs.len() as f64).ln()
}

/// ln N(z; mean, diag exp(`log_variance`)); the lists have equal length.
pub(super) fn log_normal(z: &[f32], mean: &[f32], log_variance: &[f32]) -> f64 {
    let one = |((z, mean), v): ((&f32, &f32), &f32)| {
        let (away, v) = (f64::from(z - mean), f64::from(*v));
        -0.5 * (TAU.ln() + v + away * away / v.exp())
    };
    z.iter().zip(mean).zip(log_variance).map(one).sum()
}

/// ln p(z) − ln q(z): what a code that was drawn from the posterior q weighs under the prior p = N(0, I).
pub fn log_weight(z: &[f32], mean: &[f32], log_variance: &[f32]) -> f64 {
    let zeros = vec![0.0; z.len()];
    log_normal(z, &zeros, &zeros) - log_normal(z, mean, log_variance)
}

/// KL(N(mean, diag exp(`log_variance`)) ‖ N(0, I)) (nats).
pub fn divergence(mean: &[f32], log_variance: &[f32]) -> f64 {
    let one = |(m, v): (&f32, &f32)| {
        let (m, v) = (f64::from(*m), f64::from(*v));
        0.5 * (m * m + v.exp() - 1.0 - v)
    };
    mean.iter().zip(log_variance).map(one).sum()
}

/// −Σ p ln p (nats) of a distribution.
fn entropy(probabilities: impl Iterator<Item = f64>) -> f64 {
    -probabilities.filter(|&p| p > 0.0).map(|p| p * p.ln()).sum::<f64>()
}

/// I(z; point) = H(mean map) − mean H(map) (nats): how much of where a finger touches the code decides.
///
/// Zero if all codes give one map; at most the logarithm of their number. `maps` holds a distribution for each code.
pub fn code_information(maps: &[&[f32]]) -> f64 {
    let Some(first) = maps.first() else { return 0.0 };
    let count = maps.len() as f64;
    let mean = (0..first.len()).map(|i| maps.iter().map(|map| f64::from(map[i])).sum::<f64>() / count);
    let own = maps.iter().map(|map| entropy(map.iter().map(|&p| f64::from(p)))).sum::<f64>() / count;
    (entropy(mean) - own).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::random::Stream;

    #[test]
    fn log_mean_exp_is_the_mean_of_exponentials_at_any_size() {
        assert!((log_mean_exp(&[0.1_f64.ln(), 0.3_f64.ln()]) - 0.2_f64.ln()).abs() < 1e-15);
        assert!((log_mean_exp(&[-2000.0, -2000.0 + 3.0_f64.ln()]) - (2.0_f64.ln() - 2000.0)).abs() < 1e-12);
        assert_eq!(log_mean_exp(&[]), f64::NEG_INFINITY);
        assert!((log_mean_exp(&[f64::NEG_INFINITY, 0.0]) + 2.0_f64.ln()).abs() < 1e-15);
    }

    /// A model whose likelihood is known: z ~ N(0, 1), c | z ~ N(z, s²), so that c ~ N(0, 1 + s²).
    fn conditional(c: f64, z: f32, s: f64) -> f64 {
        let away = (c - f64::from(z)) / s;
        -0.5 * (TAU.ln() + away * away) - s.ln()
    }

    #[test]
    fn the_importance_weighted_bound_is_exact_under_the_true_posterior() {
        let (c, s) = (1.3_f64, 0.4_f64);
        let truth = -0.5 * (TAU.ln() + (1.0 + s * s).ln() + c * c / (1.0 + s * s));
        let variance = s * s / (1.0 + s * s);
        let (mean, log_variance) = ([(c / (1.0 + s * s)) as f32], [variance.ln() as f32]);
        let mut stream = Stream::new(4, &[]);
        for codes in [1, 7] {
            let draws: Vec<[f32; 1]> = (0..codes).map(|_| [mean[0] + (variance.sqrt() * stream.normal()) as f32]).collect();
            let logs: Vec<f64> = draws.iter().map(|z| conditional(c, z[0], s) + log_weight(z, &mean, &log_variance)).collect();
            assert!((log_mean_exp(&logs) - truth).abs() < 1e-5, "{codes}: {} {truth}", log_mean_exp(&logs));
        }
    }

    #[test]
    fn both_estimates_approach_the_likelihood_of_a_mixture() {
        // A code of one number that chooses between two maps over three points: p(point 0) = Φ(0) 0.8 + Φ(0) 0.1.
        let map = |z: f32| if z < 0.0 { [0.8_f64, 0.1, 0.1] } else { [0.1, 0.2, 0.7] };
        let mut stream = Stream::new(5, &[]);
        let prior: Vec<f64> = (0..20_000).map(|_| map(stream.normal() as f32)[0].ln()).collect();
        assert!((log_mean_exp(&prior) - 0.45_f64.ln()).abs() < 0.02);
        // A posterior that is only roughly right leans to the negative codes.
        let (mean, log_variance) = ([-0.6_f32], [(1.1_f32 * 1.1).ln()]);
        let weighted: Vec<f64> = (0..20_000)
            .map(|_| [mean[0] + 1.1 * stream.normal() as f32])
            .map(|z| map(z[0])[0].ln() + log_weight(&z, &mean, &log_variance))
            .collect();
        assert!((log_mean_exp(&weighted) - 0.45_f64.ln()).abs() < 0.03, "{}", log_mean_exp(&weighted));
    }

    #[test]
    fn divergence_and_information_have_their_closed_forms() {
        assert_eq!(divergence(&[0.0; 3], &[0.0; 3]), 0.0);
        // ½ (1 + 4 − 1 − ln 4) + ½ (0.25 − 1 − ln 0.25)
        let expected = 0.5 * (4.0 - 4.0_f64.ln()) + 0.5 * (-0.75 - 0.25_f64.ln());
        assert!((divergence(&[1.0, 0.0], &[4.0_f32.ln(), 0.25_f32.ln()]) - expected).abs() < 1e-6);
        let (a, b): ([f32; 2], [f32; 2]) = ([1.0, 0.0], [0.0, 1.0]);
        assert!((code_information(&[&a, &b]) - 2.0_f64.ln()).abs() < 1e-12, "each code its own point");
        assert_eq!(code_information(&[&[0.3, 0.7], &[0.3, 0.7]]), 0.0, "the code says nothing");
        assert_eq!(code_information(&[]), 0.0);
    }
}
