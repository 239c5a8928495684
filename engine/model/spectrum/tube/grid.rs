//! A place on an axis of a table.

/// Between which two entries a value lies, and how far.
#[derive(Debug, Clone, Copy)]
pub(super) struct GridPlace {
    pub(super) below: usize,
    /// 0 at the entry below, 1 at the one above; beyond them outside the axis.
    pub(super) part: f64,
}

impl GridPlace {
    /// Place of `value` on an ascending `axis` of at least two entries.
    pub(super) fn of(axis: &[f64], value: f64) -> Self {
        let below = axis.partition_point(|entry| *entry <= value).clamp(1, axis.len() - 1) - 1;
        let part = (value - axis[below]) / (axis[below + 1] - axis[below]);
        Self { below, part }
    }

    /// Linear between the two entries.
    pub(super) fn between(self, at: impl Fn(usize) -> f64) -> f64 {
        at(self.below) * (1.0 - self.part) + at(self.below + 1) * self.part
    }

    /// Linear in the logarithm of positive entries.
    pub(super) fn between_logs(self, at: impl Fn(usize) -> f64) -> f64 {
        self.between(|index| at(index).ln()).exp()
    }
}
