//! Random changes of a training cloud that leave its label true.

use crate::config::AugmentationConfig;
use vmao_core::random::Stream;

/// Turns the centred cloud about gravity, shakes its points and tints it.
pub(crate) fn augment(points: &mut [[f32; 3]], colors: &mut [[f32; 3]], config: &AugmentationConfig, stream: &mut Stream) {
    let rotation = f64::from(config.rotation);
    let (sin, cos) = stream.range(-rotation, rotation).sin_cos();
    let (sin, cos) = (sin as f32, cos as f32);
    let gain: [f32; 3] = std::array::from_fn(|_| 1.0 + config.color_gain * stream.range(-1.0, 1.0) as f32);
    for p in points.iter_mut() {
        *p = [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2]];
        if config.jitter > 0.0 {
            // Three normals from sums of uniforms would do as well; the stream's own are exact and cheap enough.
            p.iter_mut().for_each(|x| *x += config.jitter * stream.normal() as f32);
        }
    }
    for c in colors.iter_mut() {
        *c = std::array::from_fn(|i| (c[i] * gain[i]).clamp(0.0, 1.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_keeps_heights_and_distances_from_the_axis() {
        let before = [[0.1, 0.02, 0.3], [-0.05, 0.2, 0.0]];
        let (mut points, mut colors) = (before, [[0.5, 0.9, 0.0]; 2]);
        let config = AugmentationConfig { rotation: 3.0, jitter: 0.0, color_gain: 0.2 };
        augment(&mut points, &mut colors, &config, &mut Stream::new(1, &[]));
        for (p, q) in before.iter().zip(&points) {
            assert!((p[0].hypot(p[1]) - q[0].hypot(q[1])).abs() < 1e-6 && p[2] == q[2] && (p[0] - q[0]).abs() > 1e-3);
        }
        assert!(colors[0] == colors[1] && colors[0][0] != 0.5 && colors[0][2] == 0.0 && colors[0][1] <= 1.0);
    }
}
