//! Cross entropy between target maps and the softmax of logits over the points of each cloud, channel by channel.
//!
//! L = −(1 / clouds·channels) Σ_cloud Σ_channel Σ_point p log softmax(logit), with Σ_point p = 1 (supplement, appendix C: the
//! average over the points' cross entropies up to the constant number of points).

/// Fingers of a gripper, channels of a map.
pub(crate) const FINGERS: usize = 2;

/// Softmax over the points of one cloud for each channel; `logits` points × 2.
pub(crate) fn softmax(logits: &[f32]) -> Vec<f32> {
    let mut out = logits.to_vec();
    for finger in 0..FINGERS {
        let channel = || logits.iter().skip(finger).step_by(FINGERS);
        let largest = channel().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
        let total: f64 = channel().map(|&l| f64::from((l - largest).exp())).sum();
        for value in out.iter_mut().skip(finger).step_by(FINGERS) {
            *value = (f64::from((*value - largest).exp()) / total) as f32;
        }
    }
    out
}

/// The loss and softmax(logits) − target, which is its gradient times clouds·channels; `starts` bounds the clouds.
pub(crate) fn cross_entropy(logits: &[f32], targets: &[f32], starts: &[usize]) -> (f32, Vec<f32>) {
    assert_eq!(logits.len(), targets.len(), "a target for each logit");
    let mut residual = Vec::with_capacity(logits.len());
    let mut loss = 0.0_f64;
    for cloud in starts.windows(2) {
        let span = cloud[0] * FINGERS..cloud[1] * FINGERS;
        let (logits, targets) = (&logits[span.clone()], &targets[span]);
        for finger in 0..FINGERS {
            let channel = || logits.iter().skip(finger).step_by(FINGERS);
            let largest = channel().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
            let log_total = channel().map(|&l| f64::from((l - largest).exp())).sum::<f64>().ln() + f64::from(largest);
            let pairs = channel().zip(targets.iter().skip(finger).step_by(FINGERS));
            loss += pairs.map(|(&l, &p)| f64::from(p) * (log_total - f64::from(l))).sum::<f64>();
        }
        residual.extend(softmax(logits).iter().zip(targets).map(|(p, t)| p - t));
    }
    let terms = (starts.len() - 1) * FINGERS;
    ((loss / terms as f64) as f32, residual)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_logits_give_the_entropy_of_the_uniform_map() {
        let targets = [1.0, 0.0, 0.0, 0.25, 0.0, 0.75, /* second cloud */ 0.5, 1.0, 0.5, 0.0];
        let (loss, residual) = cross_entropy(&[0.7; 10], &targets, &[0, 3, 5]);
        assert!((loss - (2.0 * 3.0_f32.ln() + 2.0 * 2.0_f32.ln()) / 4.0).abs() < 1e-6);
        assert!((residual[0] - (1.0 / 3.0 - 1.0)).abs() < 1e-6 && (residual[9] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn a_large_logit_takes_all_without_overflow() {
        let p = softmax(&[1000.0, -1000.0, 0.0, 0.0]);
        assert_eq!(p, vec![1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn the_residual_is_the_gradient() {
        use crate::kernels::finite_difference::{check, normal};
        let starts = [0, 5, 18];
        let logits = normal(1, 36);
        let targets: Vec<f32> = starts.windows(2).flat_map(|w| softmax(&normal(w[1] as u64, 2 * (w[1] - w[0])))).collect();
        let gradient: Vec<f32> = cross_entropy(&logits, &targets, &starts).1.iter().map(|r| r / 4.0).collect();
        check("logits", &logits, &gradient, &[3e-2], 5e-3, |l| f64::from(cross_entropy(l, &targets, &starts).0));
    }
}
