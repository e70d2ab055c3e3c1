//! Random changes of a training cloud that leave its label true.

use crate::config::AugmentationConfig;
use vmao_core::random::Stream;

/// A centred cloud as one training step sees it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) colors: Vec<[f32; 3]>,
    /// Outward offset of each point.
    pub(crate) outward: Vec<[f32; 3]>,
}

/// Turns the centred cloud about gravity, shakes its points and tints it.
pub(crate) fn augment(cloud: &mut View, config: &AugmentationConfig, stream: &mut Stream) {
    let rotation = f64::from(config.rotation);
    let (sin, cos) = stream.range(-rotation, rotation).sin_cos();
    let (sin, cos) = (sin as f32, cos as f32);
    let gain: [f32; 3] = std::array::from_fn(|_| 1.0 + config.color_gain * stream.range(-1.0, 1.0) as f32);
    let turn = |p: [f32; 3]| [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]];
    cloud.outward.iter_mut().for_each(|o| *o = turn(*o));
    for p in &mut cloud.points {
        *p = turn(*p);
        if config.jitter > 0.0 {
            p.iter_mut().for_each(|x| *x += config.jitter * stream.normal() as f32);
        }
    }
    for c in &mut cloud.colors {
        *c = std::array::from_fn(|i| (c[i] * gain[i]).clamp(0.0, 1.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_keeps_heights_and_distances_from_the_axis() {
        let before = [[0.1, 0.02, 0.3], [-0.05, 0.2, 0.0]];
        let mut cloud = View { points: before.to_vec(), colors: vec![[0.5, 0.9, 0.0]; 2], outward: before.to_vec() };
        let config = AugmentationConfig { rotation: 3.0, jitter: 0.0, color_gain: 0.2 };
        augment(&mut cloud, &config, &mut Stream::new(1, &[]));
        for (p, q) in before.iter().zip(&cloud.points) {
            assert!((p[0].hypot(p[1]) - q[0].hypot(q[1])).abs() < 1e-6 && p[2] == q[2] && (p[0] - q[0]).abs() > 1e-3);
        }
        assert_eq!(cloud.points, cloud.outward, "both are turned alike");
        let colors = &cloud.colors;
        assert!(colors[0] == colors[1] && colors[0][0] != 0.5 && colors[0][2] == 0.0 && colors[0][1] <= 1.0);
    }
}
