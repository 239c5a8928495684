//! How much work the next dispatch gets, by how long the last one took.

use std::time::Duration;

/// Dispatches longer than this are cut, well short of a desktop driver's time-out.
const LONG: Duration = Duration::from_millis(100);

/// Size of a dispatch, in items of the caller: halves after a long one, doubles after a short one.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    size: u32,
    least: u32,
    most: u32,
}

impl Pace {
    /// Begins at `size` and stays from `least` to `most`.
    pub const fn new(size: u32, least: u32, most: u32) -> Self {
        Self { size, least, most }
    }

    /// Items of the next dispatch.
    pub const fn size(&self) -> u32 {
        self.size
    }

    /// Takes the time of a dispatch of that size.
    pub fn adapt(&mut self, took: Duration) {
        if took > LONG {
            self.size = (self.size / 2).max(self.least);
        } else if took < LONG / 4 {
            self.size = self.size.saturating_mul(2).min(self.most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_dispatches_shrink_and_short_ones_grow_within_bounds() {
        let (long, middle, short) = (LONG * 2, LONG / 2, LONG / 8);
        let mut pace = Pace::new(4096, 1000, 10_000);
        let mut after = |took| {
            pace.adapt(took);
            pace.size()
        };
        assert_eq!([short, short, middle].map(&mut after), [8192, 10_000, 10_000]);
        assert_eq!([long, long, long, long].map(after), [5000, 2500, 1250, 1000]);
    }
}
