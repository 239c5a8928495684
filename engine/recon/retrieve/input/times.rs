//! Times of flats and darks between views.

/// Time of a view, in views from the beginning of the first.
pub(super) fn during(view: usize) -> f64 {
    view as f64 + 0.5
}

/// Times of flats or darks, in views: one before every few views, and one behind the last.
#[derive(Debug, Clone, Copy)]
pub(super) struct Times {
    every: u32,
    count: usize,
    /// Greatest time.
    last: f64,
    /// Time behind the beginning of the view that follows.
    shift: f64,
}

impl Times {
    /// Times of a simulated scan, whose flats have source and masks as they are in the view that follows,
    /// and those behind the last view as they are in the last.
    pub(super) fn simulated(every: u32, count: usize, views: usize) -> Self {
        Self { every, count, last: during(views.saturating_sub(1)), shift: during(0) }
    }

    /// Times of a measured scan: flats are taken before the view that follows, or behind the last view.
    pub(super) fn measured(every: u32, count: usize, views: usize) -> Self {
        Self { every, count, last: views as f64, shift: 0.0 }
    }

    /// Time of one of them.
    pub(super) fn of(self, index: usize) -> f64 {
        (index.saturating_mul(self.every as usize) as f64 + self.shift).min(self.last)
    }

    /// The last at or before a time, and the share of the next in a linear interpolation. Behind the last
    /// nothing is known but it.
    pub(super) fn at(self, time: f64) -> (usize, f32) {
        let last = self.count - 1;
        if time >= self.of(last) {
            return (last, 0.0);
        }
        let before =
            beamlet_core::numbers::whole::<usize>((time - self.shift) / f64::from(self.every));
        let [from, to] = [before, before + 1].map(|index| self.of(index));
        (before, beamlet_core::numbers::single((time - from) / (to - from)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_between_the_flats_before_and_behind_them() {
        // Flats before views 0, 4 and 8, and behind view 9.
        let times = Times::measured(4, 4, 10);
        let of = |view| times.at(during(view));
        assert_eq!(
            [0, 3, 4, 8, 9].map(of),
            [(0, 0.125), (0, 0.875), (1, 0.125), (2, 0.25), (2, 0.75)]
        );
        assert_eq!([0.0, 8.0, 10.0].map(|time| times.at(time)), [(0, 0.0), (2, 0.0), (3, 0.0)]);
        // Without a flat behind the last view.
        assert_eq!(Times { count: 3, ..times }.at(9.5), (2, 0.0));
        // Simulated flats are as their views, the last as view 9.
        let of = |view| Times::simulated(4, 4, 10).at(during(view));
        assert_eq!([0, 3, 4, 8, 9].map(of), [(0, 0.0), (0, 0.75), (1, 0.0), (2, 0.0), (3, 0.0)]);
        assert_eq!(Times::simulated(3, 3, 4).at(during(3)), (2, 0.0));
    }
}
