//! Whether two methods differ on the same trials: McNemar's exact test.

use crate::evaluation::TrialLine;
use crate::results::{Method, aligned};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use vmao_core::order::GraspOrder;

/// Two methods on the same trials of one order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// The grasp order.
    pub order: GraspOrder,
    /// The first method.
    pub first: Method,
    /// The second method.
    pub second: Method,
    /// Trials in which both succeeded.
    pub both: u64,
    /// Trials in which only the first succeeded.
    pub only_first: u64,
    /// Trials in which only the second succeeded.
    pub only_second: u64,
    /// The probability of so uneven a split, or a more uneven one, between equal methods.
    pub p: f64,
}

/// p of McNemar's exact test (two-sided sign test of the discordant pairs; McNemar, Psychometrika 12, 1947).
///
/// min(1, 2 Σ_{i ≤ min(b, c)} C(b + c, i) / 2^(b + c)).
pub fn mcnemar(b: u64, c: u64) -> f64 {
    let (n, fewer) = ((b + c) as f64, b.min(c));
    // In logarithms: 2^-n is zero in doubles from n = 1075 on.
    let mut term = -n * std::f64::consts::LN_2;
    let mut sum = term.exp();
    for i in 1..=fewer {
        term += ((n - i as f64 + 1.0) / i as f64).ln();
        sum += term.exp();
    }
    (2.0 * sum).min(1.0)
}

/// Every pair of methods in every order, on the trials that both ran.
pub fn comparisons(lines: &[TrialLine]) -> Vec<Comparison> {
    let mut orders: Vec<GraspOrder> = Vec::new();
    let mut methods: Vec<Method> = Vec::new();
    let mut succeeded: BTreeMap<(GraspOrder, Method), BTreeMap<u64, bool>> = BTreeMap::new();
    for line in lines {
        if !orders.contains(&line.order) {
            orders.push(line.order);
        }
        if !methods.contains(&line.method) {
            methods.push(line.method);
        }
        succeeded.entry((line.order, line.method)).or_default().insert(line.index, line.outcome.is_success());
    }
    let mut found = Vec::new();
    for &order in &orders {
        for (index, &first) in methods.iter().enumerate() {
            for &second in &methods[index + 1..] {
                let (Some(ours), Some(theirs)) = (succeeded.get(&(order, first)), succeeded.get(&(order, second))) else {
                    continue;
                };
                let pairs = || ours.iter().filter_map(|(trial, &ours)| Some((ours, *theirs.get(trial)?)));
                let count = |pair: (bool, bool)| pairs().filter(|&found| found == pair).count() as u64;
                let (both, only_first, only_second) = (count((true, true)), count((true, false)), count((false, true)));
                found.push(Comparison {
                    order,
                    first,
                    second,
                    both,
                    only_first,
                    only_second,
                    p: mcnemar(only_first, only_second),
                });
            }
        }
    }
    found
}

/// For people: a row for each comparison.
pub fn table(comparisons: &[Comparison]) -> String {
    if comparisons.is_empty() {
        return String::new();
    }
    let heading = ["order", "first", "second", "both", "only first", "only second", "McNemar p"];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for Comparison { order, first, second, both, only_first, only_second, p } in comparisons {
        let counts = [both, only_first, only_second].map(ToString::to_string);
        let mut row = vec![order.name().to_owned(), first.title().to_owned(), second.title().to_owned()];
        row.extend(counts);
        row.push(p_value(*p));
        rows.push(row);
    }
    aligned(&rows, 3)
}

/// A probability as tables print it.
pub fn p_value(p: f64) -> String {
    if p < 1e-4 { "< 0.0001".to_owned() } else { format!("{p:.4}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_test_is_the_exact_binomial_one() {
        // By hand: 2 (1 + 6) / 2^6; 2 · 1 / 2^5; ties and nothing at all.
        assert!((mcnemar(1, 5) - 14.0 / 64.0).abs() < 1e-15);
        assert!((mcnemar(5, 0) - 2.0 / 32.0).abs() < 1e-15);
        assert!((mcnemar(3, 3) - 1.0).abs() < 1e-15);
        assert!((mcnemar(0, 0) - 1.0).abs() < 1e-15);
        for (b, c) in [(10, 3), (40, 61), (700, 500), (1500, 1700)] {
            assert_eq!(mcnemar(b, c).to_bits(), mcnemar(c, b).to_bits());
        }
    }

    #[test]
    fn many_pairs_neither_vanish_nor_overflow() {
        // 2 Σ C(3200, i) / 2^3200 for i ≤ 1500 in whole numbers: python3 -c "from math import comb; print(...)".
        assert!((mcnemar(1500, 1700) / 4.333_403_593_997_503_5e-4 - 1.0).abs() < 1e-9);
    }
}
