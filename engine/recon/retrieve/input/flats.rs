//! Flats and darks of a scan: one for all views, or one every few views; of flats also one for each view.

use super::Input;
use super::times::{Times, during};
use crate::retrieve::value_noise::NoiseFactors;
use beamlet_core::{Error, Result};
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

    /// True if views have flats of their own.
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
    /// As [`beamlet_files::StackFile::rows`].
    pub fn flat_rows(&self, view: usize, rows: Range<u32>) -> Result<Array3<f32>> {
        let (flats, flat) = (self.flat.shape()[0], (&self.flat, &self.largest[0]));
        let Some(every) = self.flats_every else {
            // One flat is taken before the first view.
            let time = if flats == 1 { 0.0 } else { during(view) };
            return self.values(flat, view.min(flats - 1), &rows, time);
        };
        let times = self.times(every, flats);
        let (before, share) = times.at(during(view));
        let mut mean = self.values(flat, before, &rows, times.of(before))?;
        if share == 0.0 {
            return Ok(mean);
        }
        let next = self.values(flat, before + 1, &rows, times.of(before + 1))?;
        mean.zip_mut_with(&next, |a, b| {
            *a = match a.max(*b) {
                // A value that is left out in either is left out.
                most if most >= super::LEFT_OUT => most,
                _ => *a + share * (b - *a),
            };
        });
        Ok(mean)
    }

    /// Noise of the flat of a view: interpolated values have less than the values of one flat.
    pub(in super::super) fn flat_noise(&self, view: usize) -> NoiseFactors {
        self.flats_every.map_or(NoiseFactors::ONE, |every| {
            let (_, share) = self.times(every, self.flat.shape()[0]).at(during(view));
            NoiseFactors::interpolated(f64::from(share))
        })
    }

    fn times(&self, every: u32, count: usize) -> Times {
        match self.is_run {
            true => Times::simulated(every, count, self.scene.scan.views()),
            false => Times::measured(every, count, self.views()),
        }
    }
}
