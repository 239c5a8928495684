//! Flats and darks of a scan: one for all views, or one every few views; of flats also one for each view.

use super::Input;
use crate::{Error, Result};
use ndarray::Array3;
use std::ops::Range;

impl Input {
    /// Takes flats that were taken every `views` views, the first before the first view: that of a view is
    /// interpolated between those before and behind it.
    #[must_use]
    pub const fn with_flats_every(mut self, views: Option<u32>) -> Self {
        self.flats_every = views;
        self
    }

    /// Views between one flat and the next, where they are interpolated.
    pub(in super::super) const fn flats_every(&self) -> Option<u32> {
        self.flats_every
    }

    /// Whether views have flats of their own.
    pub(in super::super) const fn has_flats(&self) -> bool {
        self.flat.shape()[0] > 1
    }

    /// Refuses flats that are neither one, nor one for each view, nor enough for the views between them.
    pub(super) fn check_flats(&self) -> Result<()> {
        let (flats, views) = (self.flat.shape()[0], self.views());
        let refused = |problem: String| Err(Error::file(self.flat.path(), problem, None));
        match self.flats_every {
            None if flats == 1 || flats == views => Ok(()),
            None => refused(format!(
                "has {flats} flats for {views} views; allowed: one flat, one for each view, or \
                 several with --flats-every N"
            )),
            Some(0) => refused(
                "has no views between its flats; --flats-every must be 1 or more".to_owned(),
            ),
            Some(_) if flats < 2 => {
                refused("has one flat; --flats-every needs two or more".to_owned())
            }
            Some(every) => {
                let needed = views.div_ceil(every as usize);
                if flats == needed || flats == needed + 1 {
                    return Ok(());
                }
                refused(format!(
                    "has {flats} flats for {views} views, {every} between them; allowed: {needed}, \
                     or {} with a flat after the last view",
                    needed + 1
                ))
            }
        }
    }

    /// Rows of the flat of a view, `[step][row][column]`.
    ///
    /// # Errors
    /// As [`crate::stack::StackFile::rows`].
    pub fn flat_rows(&self, view: usize, rows: Range<u32>) -> Result<Array3<f32>> {
        let flats = self.flat.shape()[0];
        let Some(every) = self.flats_every else {
            // One flat is taken before the first view.
            let time = if flats == 1 { 0.0 } else { during(view) };
            return self.values(&self.flat, view.min(flats - 1), &rows, time);
        };
        let times = self.times(every, flats);
        let (before, share) = times.at(during(view));
        let mut mean = self.values(&self.flat, before, &rows, times.of(before))?;
        if share == 0.0 {
            return Ok(mean);
        }
        let next = self.values(&self.flat, before + 1, &rows, times.of(before + 1))?;
        mean.zip_mut_with(&next, |a, b| {
            *a = match a.max(*b) {
                // A value that is left out in either is left out.
                most if most >= super::LEFT_OUT => most,
                _ => *a + share * (b - *a),
            };
        });
        Ok(mean)
    }

    fn times(&self, every: u32, count: usize) -> Times {
        match self.is_run {
            true => Times::simulated(every, count, self.scene.scan.views()),
            false => Times { every, count, last: self.views() as f64, shift: 0.0 },
        }
    }
}

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
        let before = crate::numbers::whole::<usize>((time - self.shift) / f64::from(self.every));
        let [from, to] = [before, before + 1].map(|index| self.of(index));
        (before, crate::numbers::single((time - from) / (to - from)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_between_the_flats_before_and_behind_them() {
        // Flats before views 0, 4 and 8, and behind view 9.
        let times = Times { every: 4, count: 4, last: 10.0, shift: 0.0 };
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
