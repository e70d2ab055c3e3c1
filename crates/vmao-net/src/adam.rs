//! Adam (Kingma & Ba 2015, algorithm 1), one array at a time, in a fixed order.

use crate::parameters::{Parameters, Spec};

const FIRST_DECAY: f32 = 0.9;
const SECOND_DECAY: f32 = 0.999;
const EPSILON: f32 = 1e-8;

/// Running means of the gradients and of their squares.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Adam {
    pub(crate) first: Vec<Vec<f32>>,
    pub(crate) second: Vec<Vec<f32>>,
    pub(crate) step: i32,
}

impl Adam {
    /// No step taken yet.
    pub(crate) fn new(specs: &[Spec]) -> Self {
        let zeros = || specs.iter().map(|spec| vec![0.0; if spec.is_trained() { spec.len() } else { 0 }]).collect();
        Self { first: zeros(), second: zeros(), step: 0 }
    }

    /// One step against `gradients`; arrays without gradient stay.
    pub(crate) fn update(&mut self, parameters: &mut Parameters, gradients: &[Option<Vec<f32>>], learning_rate: f32) {
        self.step += 1;
        let (first_bias, second_bias) = (1.0 - FIRST_DECAY.powi(self.step), 1.0 - SECOND_DECAY.powi(self.step));
        for (i, gradient) in gradients.iter().enumerate() {
            let Some(gradient) = gradient else { continue };
            let moments = self.first[i].iter_mut().zip(&mut self.second[i]);
            for ((value, &g), (m, v)) in parameters.values[i].iter_mut().zip(gradient).zip(moments) {
                *m = FIRST_DECAY * *m + (1.0 - FIRST_DECAY) * g;
                *v = SECOND_DECAY * *v + (1.0 - SECOND_DECAY) * g * g;
                *value -= learning_rate * (*m / first_bias) / ((*v / second_bias).sqrt() + EPSILON);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::{Layout, Start};

    #[test]
    fn the_first_step_is_the_learning_rate_against_the_sign() {
        let mut layout = Layout::default();
        layout.add("a".to_owned(), [1, 2], Start::Constant(1.0));
        layout.add("b".to_owned(), [1, 1], Start::Statistic(5.0));
        let mut parameters = layout.start(0);
        let mut adam = Adam::new(layout.specs());
        adam.update(&mut parameters, &[Some(vec![3.0, -0.01]), None], 0.1);
        assert!((parameters.values[0][0] - 0.9).abs() < 1e-5 && (parameters.values[0][1] - 1.1).abs() < 1e-5);
        assert_eq!(parameters.values[1], vec![5.0]);
    }

    #[test]
    fn it_finds_the_minimum_of_a_bowl() {
        let mut layout = Layout::default();
        layout.add("x".to_owned(), [1, 2], Start::Constant(2.0));
        let mut parameters = layout.start(0);
        let mut adam = Adam::new(layout.specs());
        for step in 0..2000 {
            let x = &parameters.values[0];
            let gradient = vec![2.0 * (x[0] - 0.5), 20.0 * (x[1] + 1.0)];
            adam.update(&mut parameters, &[Some(gradient)], 0.1 * 0.997_f32.powi(step));
        }
        assert!((parameters.values[0][0] - 0.5).abs() < 1e-2 && (parameters.values[0][1] + 1.0).abs() < 1e-2);
    }
}
