//! Counter-based random streams: the same (seed, labels) give the same numbers on any thread, in any order.

/// A stream of random numbers that is a pure function of its seed, its labels and how many were drawn.
///
/// Philox-4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011).
#[derive(Debug, Clone)]
pub struct Stream {
    key: [u32; 2],
    stream: u64,
    block: u64,
    buffer: [u32; 4],
    used: usize,
}

impl Stream {
    /// The stream of `seed` named by `labels`, such as `[trial index, stage]`.
    pub fn new(seed: u64, labels: &[u64]) -> Self {
        let stream =
            labels.iter().fold(0x9e37_79b9_7f4a_7c15, |hash, &label| mix(hash ^ mix(label.wrapping_add(0x632b_e59b_d9b4_e019))));
        Self { key: [seed as u32, (seed >> 32) as u32], stream, block: 0, buffer: [0; 4], used: 4 }
    }

    /// 32 random bits.
    pub fn bits(&mut self) -> u32 {
        if self.used == 4 {
            let counter = [self.block as u32, (self.block >> 32) as u32, self.stream as u32, (self.stream >> 32) as u32];
            self.buffer = philox(counter, self.key);
            self.block += 1;
            self.used = 0;
        }
        self.used += 1;
        self.buffer[self.used - 1]
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn unit(&mut self) -> f64 {
        let bits = (u64::from(self.bits()) << 32) | u64::from(self.bits());
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [`low`, `high`).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `0..count`. Panics if `count` is zero.
    pub fn index(&mut self, count: usize) -> usize {
        assert!(count > 0, "a draw from nothing");
        ((self.unit() * count as f64) as usize).min(count - 1)
    }

    /// Standard normal (Box-Muller, one of the pair).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// An index drawn with probability proportional to `weights` (none negative, not all zero).
    pub fn weighted(&mut self, weights: &[f64]) -> usize {
        let mut left = self.unit() * weights.iter().sum::<f64>();
        for (index, &weight) in weights.iter().enumerate() {
            left -= weight;
            if left < 0.0 {
                return index;
            }
        }
        weights.iter().rposition(|&weight| weight > 0.0).unwrap_or(0)
    }

    /// A random order of `0..count` (Fisher-Yates).
    pub fn permutation(&mut self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        for last in (1..count).rev() {
            order.swap(last, self.index(last + 1));
        }
        order
    }
}

/// SplitMix64's finaliser: spreads labels over the stream identifiers.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let left = u64::from(counter[0]) * 0xd251_1f53;
        let right = u64::from(counter[2]) * 0xcd9e_8d57;
        counter =
            [(right >> 32) as u32 ^ counter[1] ^ key[0], right as u32, (left >> 32) as u32 ^ counter[3] ^ key[1], left as u32];
        key = [key[0].wrapping_add(0x9e37_79b9), key[1].wrapping_add(0xbb67_ae85)];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_gives_the_published_known_answers() {
        // Random123 kat_vectors, philox4x32-10.
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([u32::MAX; 4], [u32::MAX; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
    }

    #[test]
    fn streams_repeat_and_differ_by_label_and_seed() {
        let draw = |seed, labels: &[u64]| {
            let mut s = Stream::new(seed, labels);
            (0..9).map(|_| s.bits()).collect::<Vec<_>>()
        };
        assert_eq!(draw(3, &[1, 2]), draw(3, &[1, 2]));
        for other in [draw(4, &[1, 2]), draw(3, &[2, 1]), draw(3, &[1]), draw(3, &[1, 2, 0])] {
            assert_ne!(draw(3, &[1, 2]), other);
        }
    }

    #[test]
    fn moments_are_those_of_the_named_distributions() {
        let mut stream = Stream::new(7, &[]);
        let n = 200_000;
        let (mut mean, mut square, mut uniform) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = stream.normal();
            mean += x / n as f64;
            square += x * x / n as f64;
            uniform += stream.range(-1.0, 3.0) / n as f64;
        }
        assert!(mean.abs() < 0.01 && (square - 1.0).abs() < 0.015 && (uniform - 1.0).abs() < 0.01);
    }

    #[test]
    fn weighted_draws_never_take_a_zero_weight() {
        let mut stream = Stream::new(1, &[]);
        for _ in 0..1000 {
            assert_eq!(stream.weighted(&[0.0, 2.0, 0.0]), 1);
        }
    }
}
