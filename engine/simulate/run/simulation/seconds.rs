//! Times of the stages of a run.

use std::ops::AddAssign;

/// Seconds by stage.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seconds {
    pub(super) trace: f64,
    pub(super) illuminate: f64,
    /// Reading light from the device, blur, scatter.
    pub(super) detect: f64,
    pub(super) noise: f64,
    pub(super) write: f64,
}

impl AddAssign for Seconds {
    fn add_assign(&mut self, other: Self) {
        self.trace += other.trace;
        self.illuminate += other.illuminate;
        self.detect += other.detect;
        self.noise += other.noise;
        self.write += other.write;
    }
}
