//! Random numbers that are a pure function of a seed and a place: the same bits in any order of
//! work and on any number of threads.

mod normal;
mod philox;

pub use philox::Draws;

/// Fractional part of the golden ratio: its multiples, less whole numbers, spread evenly over [0, 1).
pub const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Largest draw of the normal distribution, in standard deviations: the least uniform number, 2^-54,
/// gives 8.292.
pub const REACH: f64 = 8.3;
