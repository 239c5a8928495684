//! Stacks of frames and the sinks that take them.

use crate::Result;
use crate::scene::Scene;
use ndarray::{Array3, Array4, ArrayView3};
use std::ops::Range;

/// A view is the unit of commit. The flat field is a view of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum View {
    /// Without the sample.
    Flat,
    /// With the sample, index into the scene's angles.
    Sample(u32),
}

/// Takes stacks band by band. Calls come in this order: `begin`, then for each view `write`
/// for each band of rows (top to bottom) and one `commit`, then `finish`.
pub trait Sink {
    /// A run begins. Nothing may have been written before this returns.
    ///
    /// # Errors
    /// Where the place cannot take the stacks.
    fn begin(&mut self, scene: &Scene) -> Result<()>;

    /// One band of rows of a view with all its steps; intensities, `[step][row][column]`.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn write(&mut self, view: View, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()>;

    /// Every row of the view has been written: keep it whole.
    ///
    /// # Errors
    /// Where the data cannot be kept.
    fn commit(&mut self, view: View) -> Result<()>;

    /// The run is over; every view is committed.
    ///
    /// # Errors
    /// Where the record of the run cannot be kept.
    fn finish(&mut self, record: &crate::RunRecord) -> Result<()>;
}

/// Stacks in memory, with the record of their run.
#[derive(Debug, Clone)]
pub struct Stacks {
    /// Without the sample, `[step][row][column]`.
    pub flat: Array3<f32>,
    /// With the sample, `[view][step][row][column]`.
    pub sample: Array4<f32>,
    /// Provenance and counts.
    pub record: crate::RunRecord,
}
