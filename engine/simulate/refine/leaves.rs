//! Cells that the host makes of rectangles that the device refined, with moments for other energies and masks.

use super::refiner::{DeviceRefiner, Take};
use super::room::RefineRoom;
use crate::sampling::{self, TakeCells, ViewContext};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::tally::Tally;
use beamlet_interface::RefinedLeaf;
use std::ops::Range;

impl DeviceRefiner<'_> {
    /// Samples the patches of some rows and hands their cells to `take`, in parts, as
    /// [`sampling::sample_rows`]; returns the counts of their rays and errors.
    ///
    /// # Errors
    /// As [`Self::refine`].
    pub(crate) fn sample_rows(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        from: (usize, RefineRoom),
        (rows, lit): (&Range<i64>, &Range<i64>),
        take: TakeCells<'_>,
        advance: &mut dyn FnMut(&Tracer, f64),
    ) -> Result<Tally> {
        let mut blank = Vec::new();
        let mut make = |tracer: &mut Tracer, leaves: Vec<RefinedLeaf>| {
            let (cells, empty) = sampling::cells_of_leaves(view, tracer, leaves, lit)?;
            blank.extend(empty);
            take(tracer, &cells)
        };
        let mut leaves = Take::Leaves(&mut make);
        let (found, missed) = self.refine(view, tracer, from, (rows, lit), &mut leaves, advance)?;
        blank.extend(missed);
        sampling::take_blank(view, tracer, (blank, lit), take)?;
        Ok(found.tally)
    }
}
