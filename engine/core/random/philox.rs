//! Random numbers by counter: a pure function of key and counter, so that no order of work
//! changes a bit. Philox4x32-10 of Salmon, Moraes, Dror and Shaw 2011, "Parallel random numbers:
//! as easy as 1, 2, 3".

use super::normal::normal_quantile;
use crate::numbers::{high_word, low_word};

/// 128 random bits.
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    let multiply = |a: u32, b: u32| {
        let product = u64::from(a) * u64::from(b);
        [high_word(product), low_word(product)]
    };
    for _ in 0..10 {
        let [high0, low0] = multiply(0xD251_1F53, counter[0]);
        let [high1, low1] = multiply(0xCD9E_8D57, counter[2]);
        counter = [high1 ^ counter[1] ^ key[0], low1, high0 ^ counter[3] ^ key[1], low0];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

/// The number in (0, 1) of 64 random bits, of which the high 53 count.
pub(super) fn unit([high, low]: [u32; 2]) -> f64 {
    let whole = (u64::from(high) << 32 | u64::from(low)) >> 11;
    // The largest one rounds to 2^53.
    ((whole as f64 + 0.5) * (1.0 / 9_007_199_254_740_992.0)).min(1.0 - 0.5 * f64::EPSILON)
}

/// A sequence of random numbers that belongs to one place.
#[derive(Debug, Clone)]
pub struct Draws {
    key: [u32; 2],
    counter: [u32; 4],
    /// The half of the last pair that a single draw left.
    spare: Option<f64>,
}

impl Draws {
    /// The sequence of a seed and a place of three words and a kind.
    pub const fn new(seed: u64, place: [u32; 3], kind: u8) -> Self {
        let key = [low_word(seed), high_word(seed)];
        Self { key, counter: [place[0], place[1], place[2], (kind as u32) << 24], spare: None }
    }

    /// Two numbers in (0, 1), multiples of 2^-53 and a half.
    pub fn pair(&mut self) -> [f64; 2] {
        let bits = philox(self.counter, self.key);
        // 2^24 pairs, of which a place needs a handful.
        self.counter[3] += 1;
        [unit([bits[0], bits[1]]), unit([bits[2], bits[3]])]
    }

    /// One number in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let [u, v] = self.pair();
        self.spare = Some(v);
        u
    }

    /// A number of the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        normal_quantile(self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of the authors' Random123 (file `kat_vectors`, philox4x32 10).
    #[test]
    fn philox_gives_the_answers_of_its_authors() {
        let cases = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, wanted) in cases {
            assert_eq!(philox(counter, key), wanted);
        }
    }
}
