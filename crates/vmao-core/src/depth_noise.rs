//! What a depth camera that triangulates, by stereo or structured light, does to true depths.

use crate::random::Stream;
use serde::{Deserialize, Serialize};

/// Errors of a depth camera; all zero is a perfect one.
///
/// Disparity is proportional to 1/z, so that a constant error of it is a depth error that grows with z² (Khoshelham and
/// Oude Elberink, "Accuracy and Resolution of Kinect Depth Data", Sensors 2012).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthNoise {
    /// Standard deviation at 1 m (m); at z metres z² times as much.
    pub deviation: f64,
    /// Distance between neighbouring depths that can be told apart at 1 m (m); at z metres z² times as much.
    pub step: f64,
    /// Share of pixels that are lost anywhere.
    pub dropout: f64,
    /// Surfaces that a ray meets at a flatter angle than this are lost (degrees).
    pub grazing_deg: f64,
    /// Share of pixels that are lost besides, where a neighbour's depth is another.
    pub edge_dropout: f64,
    /// Difference of depth that makes an edge (m).
    pub edge_step: f64,
}

impl DepthNoise {
    /// Whether this is a perfect camera.
    pub fn is_off(&self) -> bool {
        let Self { deviation, step, dropout, grazing_deg, edge_dropout, edge_step: _ } = *self;
        [deviation, step, dropout, grazing_deg, edge_dropout].iter().all(|&value| value <= 0.0)
    }

    /// The depth that is measured at a pixel of depth `depth` (m), if any; `sine` is that of the angle between ray and surface.
    ///
    /// Draws the same numbers whatever becomes of the pixel.
    pub fn measure(&self, depth: f64, sine: f64, on_edge: bool, stream: &mut Stream) -> Option<f64> {
        let (lost, edge_lost) = (stream.unit() < self.dropout, stream.unit() < self.edge_dropout);
        let noisy = depth + self.deviation * depth * depth * stream.normal();
        let grazing = sine < self.grazing_deg.to_radians().sin();
        if lost || grazing || (on_edge && edge_lost) || noisy <= 0.0 {
            return None;
        }
        Some(self.quantized(noisy)).filter(|depth| depth.is_finite())
    }

    /// The nearest depth whose disparity is a whole number of steps; infinite beyond the last.
    fn quantized(&self, depth: f64) -> f64 {
        if self.step > 0.0 { 1.0 / ((1.0 / (depth * self.step)).round() * self.step) } else { depth }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWS: usize = 100_000;

    /// All measurements of a surface that is met squarely, off edges unless said.
    fn measured(noise: &DepthNoise, depth: f64, sine: f64, on_edge: bool) -> Vec<f64> {
        let mut stream = Stream::new(5, &[1]);
        (0..DRAWS).filter_map(|_| noise.measure(depth, sine, on_edge, &mut stream)).collect()
    }

    #[test]
    fn the_deviation_grows_with_the_square_of_depth_and_the_mean_stays() {
        let noise = DepthNoise { deviation: 0.0014, ..DepthNoise::default() };
        for depth in [0.5, 1.0, 2.5] {
            let values = measured(&noise, depth, 1.0, false);
            let mean = values.iter().sum::<f64>() / DRAWS as f64;
            let deviation = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / DRAWS as f64).sqrt();
            let expected = noise.deviation * depth * depth;
            assert_eq!(values.len(), DRAWS);
            // Five standard errors of a mean and of a deviation.
            assert!((mean - depth).abs() < 5.0 * expected / (DRAWS as f64).sqrt(), "{mean} at {depth}");
            assert!((deviation / expected - 1.0).abs() < 5.0 / (2.0 * DRAWS as f64).sqrt(), "{deviation} at {depth}");
        }
    }

    #[test]
    fn quantized_depths_are_steps_apart_that_grow_with_the_square_of_depth() {
        let noise = DepthNoise { step: 0.003, ..DepthNoise::default() };
        for depth in [0.4, 1.0, 2.0] {
            let step = noise.step * depth * depth;
            let here = noise.quantized(depth);
            assert!((here - depth).abs() <= 0.51 * step, "{here} at {depth}");
            assert_eq!(noise.quantized(here), here, "a depth that can be told apart stays");
            let next = noise.quantized(here + 0.6 * step);
            assert!(((next - here) / step - 1.0).abs() < 0.02, "{next} after {here}");
        }
        assert_eq!(measured(&noise, 1e6, 1.0, false), Vec::<f64>::new(), "no disparity left");
    }

    #[test]
    fn pixels_are_lost_in_their_shares_and_only_where_they_shall_be() {
        let noise = DepthNoise { dropout: 0.1, edge_dropout: 0.3, grazing_deg: 10.0, edge_step: 0.01, ..DepthNoise::default() };
        let kept = |sine: f64, on_edge: bool| measured(&noise, 0.7, sine, on_edge).len() as f64 / DRAWS as f64;
        assert!((kept(1.0, false) - 0.9).abs() < 5.0 * (0.09 / DRAWS as f64).sqrt());
        assert!((kept(1.0, true) - 0.63).abs() < 5.0 * (0.2331 / DRAWS as f64).sqrt());
        assert_eq!(kept(9.9_f64.to_radians().sin(), false), 0.0);
        assert!(kept(10.1_f64.to_radians().sin(), false) > 0.85);
    }

    #[test]
    fn a_perfect_camera_measures_what_is_there() {
        let off = DepthNoise { edge_step: 0.01, ..DepthNoise::default() };
        assert!(off.is_off() && !DepthNoise { step: 0.001, ..off }.is_off());
        assert_eq!(off.measure(0.7, 1e-9, true, &mut Stream::new(0, &[])), Some(0.7));
    }
}
