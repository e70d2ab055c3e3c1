//! Intervals by drawing the scenes again: scenes, not contacts, are independent of each other.

use vmao_core::random::Stream;

/// Names the stream of the draws.
const RESAMPLES: u64 = 1 << 37;

/// A number, its 95 % interval, and how many scenes it is from.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Over all scenes.
    pub value: f64,
    /// 2.5 % and 97.5 % quantile of the value over resampled scenes (Efron 1979, percentile method).
    pub interval95: [f64; 2],
    /// Scenes that have the number.
    pub scenes: usize,
}

/// `value` of all `count` scenes, and its interval over `resamples` draws of as many scenes with replacement.
///
/// Draws on which there is no value are left out; none if there is none on all scenes. The same seed gives the same draws.
pub fn bootstrap(count: usize, resamples: usize, seed: u64, value: &dyn Fn(&[usize]) -> Option<f64>) -> Option<Estimate> {
    let all: Vec<usize> = (0..count).collect();
    let whole = value(&all)?;
    let draw = |resample: u64| {
        let mut stream = Stream::new(seed, &[RESAMPLES, resample]);
        let picked: Vec<usize> = (0..count).map(|_| stream.index(count)).collect();
        value(&picked)
    };
    let mut drawn: Vec<f64> = (0..resamples as u64).filter_map(draw).collect();
    drawn.sort_by(f64::total_cmp);
    let at = |share: f64| drawn.get((share * drawn.len() as f64) as usize).copied().unwrap_or(whole);
    Some(Estimate { value: whole, interval95: [at(0.025), at(0.975)], scenes: count })
}

/// The mean of the values that scenes have, with its interval.
pub fn mean_of(values: &[Option<f64>], resamples: usize, seed: u64) -> Option<Estimate> {
    let known: Vec<f64> = values.iter().flatten().copied().collect();
    let mean = |picked: &[usize]| Some(picked.iter().map(|&i| known[i]).sum::<f64>() / picked.len() as f64);
    if known.is_empty() { None } else { bootstrap(known.len(), resamples, seed, &mean) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_is_that_of_its_standard_error() {
        let mut stream = Stream::new(1, &[]);
        let values: Vec<Option<f64>> = (0..400).map(|_| Some(3.0 + 2.0 * stream.normal())).collect();
        let found = mean_of(&values, 2000, 7).unwrap();
        let [low, high] = found.interval95;
        // ±1.96 · 2 / √400 about the mean.
        assert!((found.value - low - 0.196).abs() < 0.03 && (high - found.value - 0.196).abs() < 0.03, "{found:?}");
        assert_eq!(mean_of(&values, 2000, 7), Some(found), "the same seed, the same interval");
        assert_ne!(mean_of(&values, 2000, 8).unwrap().interval95, found.interval95);
    }

    #[test]
    fn scenes_without_a_number_do_not_count() {
        let found = mean_of(&[Some(2.0), None, Some(4.0)], 100, 0).unwrap();
        assert_eq!((found.value, found.scenes), (3.0, 2));
        assert_eq!(mean_of(&[None, None], 100, 0), None);
        let sure = mean_of(&[Some(5.0); 3], 100, 0).unwrap();
        assert_eq!(sure.interval95, [5.0, 5.0]);
    }
}
