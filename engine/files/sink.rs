//! The interface that a run hands its stacks to.

use super::record::{RunRecord, RunStart};
use beamlet_core::{Result, Tally};
use beamlet_model::scene::{Exposure, Scene};
use ndarray::ArrayView3;
use std::ops::Range;

/// Receives stacks band by band. Calls come in this order: `begin`, then for each view `write` for each
/// band of rows (top to bottom) and one `commit`, then `finish`. With noise, `write_counts` follows each
/// `write`; An [`Exposure::Dark`] has counts only.
pub trait Sink {
    /// A run begins. Nothing may have been written before this returns.
    ///
    /// # Errors
    /// Where the place cannot take the stacks.
    fn begin(&mut self, scene: &Scene, start: &RunStart) -> Result<()>;

    /// One band of rows of a view with all its steps; intensities, `[step][row][column]`.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()>;

    /// The same band as detector numbers: with noise, gain, offset and bit depth.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn write_counts(
        &mut self,
        view: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()>;

    /// Counts of the rays of a view; comes before its `commit`.
    ///
    /// # Errors
    /// Where the counts cannot be kept.
    fn tally(&mut self, _view: Exposure, _tally: &Tally) -> Result<()> {
        Ok(())
    }

    /// Every row of the view has been written, its counts too: keep it whole.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn commit(&mut self, view: Exposure) -> Result<()>;

    /// The run is over; every view is committed.
    ///
    /// # Errors
    /// Where the record of the run cannot be kept.
    fn finish(&mut self, record: &RunRecord) -> Result<()>;
}
