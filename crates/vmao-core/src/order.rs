//! Grasp orders (supplement, appendix D): which parts are grasped and moved together, in turn.

use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The three ways of taking hold of N parts with N arms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GraspOrder {
    /// All parts are grasped at once, then moved together.
    Parallel,
    /// All parts but the last two one after the other, then the rest together.
    SequentialParallel,
    /// One after the other: each part is grasped and moved while those before are held.
    Sequential,
}

impl GraspOrder {
    /// The name used on the command line and in `results.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parallel => "parallel",
            Self::SequentialParallel => "sequential-parallel",
            Self::Sequential => "sequential",
        }
    }

    /// The steps of a grasp of `count` parts; each step is the range of grasps made at the same time.
    pub fn steps(self, count: usize) -> Vec<Range<usize>> {
        let leading = match self {
            Self::Parallel => 0,
            Self::SequentialParallel => count.saturating_sub(2),
            Self::Sequential => count,
        };
        let mut steps: Vec<Range<usize>> = (0..leading).map(|i| i..i + 1).collect();
        if leading < count {
            steps.push(leading..count);
        }
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_order_grasps_every_part_once_and_in_turn() {
        assert_eq!(GraspOrder::Parallel.steps(3), vec![0..3]);
        assert_eq!(GraspOrder::SequentialParallel.steps(3), vec![0..1, 1..3]);
        assert_eq!(GraspOrder::Sequential.steps(3), vec![0..1, 1..2, 2..3]);
        for order in [GraspOrder::Parallel, GraspOrder::SequentialParallel, GraspOrder::Sequential] {
            for count in 1..7 {
                let flat: Vec<usize> = order.steps(count).into_iter().flatten().collect();
                assert_eq!(flat, (0..count).collect::<Vec<_>>(), "{order:?} of {count}");
            }
        }
    }
}
