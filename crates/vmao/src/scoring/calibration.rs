//! Whether a map's probabilities mean what they say: how often contacts fall into regions of given probability mass.

/// Where a contact lies in its predicted map: mass of the points that are more probable, and of those as probable as its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rank {
    /// Σ of p over points with p > p(contact).
    pub above: f64,
    /// Σ of p over points with p = p(contact), its own among them.
    pub level: f64,
}

impl Rank {
    /// Of `point` in a map.
    pub fn of(map: &[f64], point: usize) -> Self {
        let mass = |keep: &dyn Fn(f64) -> bool| map.iter().filter(|&&p| keep(p)).sum::<f64>();
        Self { above: mass(&|p| p > map[point]), level: mass(&|p| p == map[point]) }
    }

    /// Whether the contact is in the most probable region that holds `mass`; a region cut within the contact's level counts in part.
    fn within(&self, mass: f64) -> f64 {
        if self.level > 0.0 { ((mass - self.above) / self.level).clamp(0.0, 1.0) } else { f64::from(mass > self.above) }
    }
}

/// Masses at which reliability is measured: tenths.
pub(super) const STEPS: usize = 10;

/// For the masses 1/10, 2/10, … 1 the share of contacts within the most probable region of that mass; equal to it if calibrated.
pub fn reliability(ranks: &[Rank]) -> [f64; STEPS] {
    std::array::from_fn(|step| {
        let mass = (step + 1) as f64 / STEPS as f64;
        ranks.iter().map(|rank| rank.within(mass)).sum::<f64>() / ranks.len().max(1) as f64
    })
}

/// Expected calibration error: the mean over those masses of |observed share − predicted mass|; none without contacts.
pub fn calibration_error(ranks: &[Rank]) -> Option<f64> {
    let gap = |(step, share): (usize, f64)| (share - (step + 1) as f64 / STEPS as f64).abs();
    (!ranks.is_empty()).then(|| reliability(ranks).into_iter().enumerate().map(gap).sum::<f64>() / STEPS as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use vmao_core::random::Stream;

    /// Contacts drawn from `truth` and predicted by `map`.
    fn drawn(map: &[f64], truth: &[f64]) -> Vec<Rank> {
        let mut stream = Stream::new(2, &[]);
        (0..20_000).map(|_| Rank::of(map, stream.weighted(truth))).collect()
    }

    #[test]
    fn a_map_that_says_the_truth_has_no_calibration_error() {
        let truth = [0.5, 0.05, 0.2, 0.05, 0.2];
        let ranks = drawn(&truth, &truth);
        assert!(calibration_error(&ranks).unwrap() < 0.005, "{:?}", reliability(&ranks));
    }

    #[test]
    fn a_flat_map_of_a_sure_thing_and_a_sure_map_of_a_coin_are_found_out() {
        // Underconfident: the contact is always the slightly more probable point; the region of mass m < 0.6 holds m / 0.6.
        let timid = reliability(&drawn(&[0.6, 0.4], &[1.0, 0.0]));
        assert!((timid[2] - 0.5).abs() < 1e-12 && timid[5] == 1.0, "{timid:?}");
        // Overconfident: a point of mass 0.9 is right half of the time: share m / 0.9 · ½ below 0.9, then the rest in one step.
        let bold = drawn(&[0.9, 0.1], &[0.5, 0.5]);
        let share = reliability(&bold);
        assert!((share[4] - 0.25 / 0.9).abs() < 0.01 && (share[8] - 0.5).abs() < 0.01 && share[9] > 0.999, "{share:?}");
        let gap = |m: f64| (m - 0.5 * m / 0.9).abs();
        let expected = (1..=9).map(|step| gap(f64::from(step) / 10.0)).sum::<f64>() / 10.0;
        assert!((calibration_error(&bold).unwrap() - expected).abs() < 0.01);
        assert_eq!(calibration_error(&[]), None);
    }

    #[test]
    fn a_uniform_map_is_calibrated_whatever_happens() {
        let ranks = drawn(&[0.25; 4], &[1.0, 0.0, 0.0, 0.0]);
        assert!(calibration_error(&ranks).unwrap() < 1e-12);
    }
}
