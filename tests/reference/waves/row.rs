//! Pixels of a row: columns and openings where a set-up has them.

use super::body::Body;
use super::field::Grid;
use super::light::Case;
use super::setup::{Setup, Slits, Window};

/// A row of pixels behind a periodic mask without end. Column c of C is centred at (c + ½ − C/2)
/// pitches, opening k at (k + ½ − C/2) periods.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Number of columns.
    pub columns: u32,
    /// Pixels with their openings.
    pub window: Window,
    /// Aperture of the sample mask, m; none without a mask.
    pub aperture: Option<f64>,
    /// Period of the sample mask in its plane, m.
    pub period: f64,
    /// Transmission of the bars of the sample mask; their phase is 0.
    pub leak: f64,
}

impl Row {
    /// Centres of the columns in the plane of the analyser, m.
    pub fn centres(&self) -> Vec<f64> {
        let at = |c| (f64::from(c) + 0.5 - 0.5 * f64::from(self.columns)) * self.window.pixel;
        (0..self.columns).map(at).collect()
    }

    /// Grid of `spacing` (m) over all columns and at least two pixels at both ends.
    pub fn grid(&self, setup: &Setup, spacing: f64) -> Grid {
        let length = f64::from(self.columns + 4) * self.window.pixel / setup.magnification();
        let count = ((length / spacing).ceil() as usize).next_power_of_two();
        Grid { count, spacing, repeats: false }
    }

    /// Openings over the whole grid at offset 0, of a mask that moves less than its period.
    pub fn slits(&self, grid: Grid) -> Option<Slits> {
        let count = (0.5 * grid.length() / self.period).ceil() as i32 + 2;
        let middle = 0.5 * f64::from((self.columns + 1) % 2) * self.period;
        let slits = Slits::periodic(self.aperture?, self.period, count).moved(middle);
        Some(slits.leaking(self.leak, 0.0))
    }

    /// Light of all columns at each offset of the mask, `[offset][column]`, 1 for the open beam. `points`
    /// of the focal spot see the sample moved against the mask; none take the spot as a blur.
    pub fn light(
        &self,
        setup: &Setup,
        sample: &[Body],
        spacing: f64,
        offsets: &[f64],
        points: Option<usize>,
    ) -> Vec<Vec<f64>> {
        let grid = self.grid(setup, spacing);
        let slits = self.slits(grid);
        let case = Case { setup, slits: slits.as_ref(), sample, window: self.window };
        match points {
            Some(count) => case.by_source_points(grid, &self.centres(), offsets, count),
            None => case.curves(grid, &self.centres(), offsets),
        }
    }
}
