//! Random numbers that a seed determines: `SplitMix64`.

use std::ops::Range;

/// A sequence of random numbers.
#[derive(Debug, Clone)]
pub(crate) struct Draws(u64);

impl Draws {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(71))
    }

    /// A sequence of its own, which leaves this one as it is.
    pub(crate) fn aside(&self) -> Self {
        Self::new(self.0 ^ 0x5bf0_3635_dcd1_4a8d)
    }

    /// Uniform in [0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// Uniform in [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Even in the logarithm over [low, high).
    pub(crate) fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// True with this probability.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Whole number below `count`.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        let drawn = self.uniform() * count as f64;
        (1..count).take_while(|&it| it as f64 <= drawn).count()
    }

    /// Whole number of a range.
    pub(crate) fn whole(&mut self, range: Range<u32>) -> u32 {
        let drawn = self.between(range.start.into(), range.end.into());
        range.clone().take_while(|&it| f64::from(it) <= drawn).last().unwrap_or(range.start)
    }

    /// One of the values.
    pub(crate) fn pick<T: Copy, const N: usize>(&mut self, values: [T; N]) -> T {
        values[self.below(N)]
    }

    /// Direction, uniform over the sphere.
    pub(crate) fn direction(&mut self) -> [f64; 3] {
        let (z, angle) = (self.between(-1.0, 1.0), self.between(0.0, std::f64::consts::TAU));
        let flat = (1.0 - z * z).sqrt();
        [flat * angle.cos(), flat * angle.sin(), z]
    }
}
