//! The arithmetic that an iteration of inverse kinematics spends its time in, laid out for it: no heap, no calls.

use nalgebra::Vector6;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// JJᵀ + λ of six rows, factored as LDLᵀ.
#[derive(Debug, Clone)]
pub(crate) struct NormalEquations {
    /// Below the diagonal.
    lower: [[f64; 6]; 6],
    inverse_diagonal: [f64; 6],
}

impl NormalEquations {
    /// Of these columns of J and this λ; none unless it is positive definite.
    pub(crate) fn new<'a>(columns: impl Iterator<Item = &'a Vector6<f64>>, damping: f64) -> Option<Self> {
        let mut matrix = [[0.0; 6]; 6];
        for i in 0..6 {
            matrix[i][i] = damping;
        }
        for column in columns {
            for i in 0..6 {
                for j in 0..=i {
                    matrix[i][j] += column[i] * column[j];
                }
            }
        }
        let mut inverse_diagonal = [0.0; 6];
        for j in 0..6 {
            let mut scaled = [0.0; 6];
            let mut pivot = matrix[j][j];
            for k in 0..j {
                scaled[k] = matrix[j][k];
                matrix[j][k] *= inverse_diagonal[k];
                pivot -= matrix[j][k] * scaled[k];
            }
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            inverse_diagonal[j] = 1.0 / pivot;
            for i in j + 1..6 {
                for k in 0..j {
                    matrix[i][j] -= matrix[i][k] * matrix[j][k];
                }
            }
        }
        Some(Self { lower: matrix, inverse_diagonal })
    }

    /// The x of (JJᵀ + λ) x = `right`.
    pub(crate) fn solve(&self, right: &Vector6<f64>) -> Vector6<f64> {
        let mut x = *right;
        for i in 1..6 {
            for k in 0..i {
                x[i] -= self.lower[i][k] * x[k];
            }
        }
        for i in (0..6).rev() {
            x[i] *= self.inverse_diagonal[i];
            for k in i + 1..6 {
                x[i] -= self.lower[k][i] * x[k];
            }
        }
        x
    }
}

/// Sines and cosines of several angles at once, to about 1e-15 for angles of a few turns.
pub(crate) fn sines_cosines<const N: usize>(angles: &[f64; N]) -> ([f64; N], [f64; N]) {
    // adding and taking away 1.5 · 2⁵² rounds to a whole number, whose last bits are then those of the sum
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// π/2 less its nearest double.
    const REST: f64 = 6.123_233_995_736_766e-17;
    let (mut sines, mut cosines) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        let shifted = angles[i] * FRAC_2_PI + ROUND;
        let quarters = shifted - ROUND;
        let r = angles[i] - quarters * FRAC_PI_2 - quarters * REST;
        let (sine, cosine) = (taylor_sine(r), taylor_cosine(r));
        let quadrant = shifted.to_bits() & 3;
        let (s, c) = if quadrant & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
        sines[i] = if quadrant & 2 == 0 { s } else { -s };
        cosines[i] = if (quadrant + 1) & 2 == 0 { c } else { -c };
    }
    (sines, cosines)
}

/// For |r| ≤ π/4, where the first term left out is below 1e-16.
fn taylor_sine(r: f64) -> f64 {
    const FACTORS: [f64; 7] = [-210.0, -156.0, -110.0, -72.0, -42.0, -20.0, -6.0];
    nested(&FACTORS, r * r) * r
}

fn taylor_cosine(r: f64) -> f64 {
    const FACTORS: [f64; 8] = [-240.0, -182.0, -132.0, -90.0, -56.0, -30.0, -12.0, -2.0];
    nested(&FACTORS, r * r)
}

/// 1 + x/f₇ (1 + x/f₆ (1 + …)), innermost factor first.
fn nested<const N: usize>(factors: &[f64; N], x: f64) -> f64 {
    factors.iter().fold(1.0, |sum, factor| 1.0 + x * (1.0 / factor) * sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use nalgebra::Matrix6;

    #[test]
    fn sines_and_cosines_are_those_of_the_library() {
        let mut stream = Stream::new(1, &[]);
        let ends = [0.0, -0.0, FRAC_PI_2, -FRAC_PI_2, 2.0 * FRAC_PI_2, 1e-300, FRAC_PI_2 / 2.0, 20.0];
        for angles in std::iter::once(ends).chain((0..10_000).map(|_| std::array::from_fn(|_| stream.range(-20.0, 20.0)))) {
            let (sines, cosines) = sines_cosines(&angles);
            for i in 0..8 {
                let (sine, cosine) = angles[i].sin_cos();
                assert!((sines[i] - sine).abs() < 4e-15 && (cosines[i] - cosine).abs() < 4e-15, "{}", angles[i]);
            }
        }
        assert!(sines_cosines(&[f64::NAN]).0[0].is_nan());
    }

    #[test]
    fn systems_are_solved_as_by_the_dense_method_and_bad_ones_refused() {
        let mut stream = Stream::new(2, &[]);
        for _ in 0..1000 {
            let columns: [Vector6<f64>; 7] = std::array::from_fn(|_| Vector6::from_fn(|_, _| stream.normal()));
            let right = Vector6::from_fn(|_, _| stream.normal());
            let dense: Matrix6<f64> =
                columns.iter().map(|c| c * c.transpose()).sum::<Matrix6<f64>>() + Matrix6::identity() * 0.01;
            let x = NormalEquations::new(columns.iter(), 0.01).unwrap().solve(&right);
            assert!((dense * x - right).norm() < 1e-10, "{x}");
        }
        assert!(NormalEquations::new([Vector6::x()].iter(), 0.0).is_none());
        assert!(NormalEquations::new([Vector6::repeat(f64::NAN)].iter(), 1.0).is_none());
    }
}
