//! What sampling some rows costs, from a part of their patches: these are sampled as in a run, and stand for the
//! others.

use super::room::Room;
use super::rows::sample_patches;
use super::view_context::ViewContext;
use crate::lines::PatchPlaces;
use crate::sampling::CellBatch;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use std::ops::Range;
use std::time::Instant;

/// A survey takes as much memory as a run without a limit.
const ROOM: Room = Room { limit: None, words: 0 };

/// Takes cells as [`super::rows::Take`] does, and returns the seconds that a run takes for them
/// beyond those that it took itself.
pub(crate) type TakePart<'a> = &'a mut dyn FnMut(&mut Tracer, &CellBatch) -> Result<f64>;

/// Cost of the patches of some rows of a view.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct RowsCost {
    /// Rows.
    pub rows: f64,
    /// Patches that shadows touch.
    pub patches: f64,
    /// Patches among them that were sampled.
    pub sampled: f64,
    /// Rays and lines of these.
    pub rays: f64,
    pub lines: f64,
    /// Their cells.
    pub cells: f64,
    /// Seconds that sampling and illuminating them took.
    pub seconds: f64,
}

impl RowsCost {
    /// All patches for each that was sampled.
    pub(crate) fn scale(&self) -> f64 {
        if self.sampled > 0.0 { self.patches / self.sampled } else { 0.0 }
    }
}

/// Samples at most `most` patches of some rows, evenly spread from the share `start` of their distance on, and hands
/// their cells to `take`.
///
/// # Errors
/// As [`Tracer::trace`]; errors of `take`.
pub(crate) fn survey_rows(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    lit: &Range<i64>,
    (most, start): (f64, f64),
    take: TakePart<'_>,
) -> Result<RowsCost> {
    let begin = Instant::now();
    let before = tracer.rays_traced();
    let places = PatchPlaces::new(view, rows.clone());
    let mut patches = Vec::new();
    for beamlet in view.lattice.beamlets.clone() {
        for row in rows.clone().filter(|row| places.is_touched(beamlet, *row)) {
            patches.push((beamlet, row));
        }
    }
    let chosen = spread(&patches, most, start);
    let (mut lines, mut count, mut beyond) = (0, 0, 0.0);
    let mut keep = |tracer: &mut Tracer, cells: CellBatch, _: Vec<(i64, i64)>| {
        lines += cells.tally.lines;
        count += cells.cells.len();
        if !cells.cell_rows.is_empty() {
            beyond += take(tracer, &cells)?;
        }
        Ok(())
    };
    let ignored = &mut |_: &Tracer, _| {};
    sample_patches(view, tracer, (&chosen, &places), (lit, &ROOM), &mut keep, ignored)?;
    Ok(RowsCost {
        rows: (rows.end - rows.start) as f64,
        patches: patches.len() as f64,
        sampled: chosen.len() as f64,
        rays: (tracer.rays_traced() - before) as f64,
        lines: lines as f64,
        cells: count as f64,
        seconds: begin.elapsed().as_secs_f64() + beyond,
    })
}

/// At most `most` of some patches, evenly spread.
fn spread(patches: &[(i64, i64)], most: f64, start: f64) -> Vec<(i64, i64)> {
    let count = (patches.len() as f64).min(most.max(1.0).floor());
    let step = patches.len() as f64 / count.max(1.0);
    (0..numbers::whole::<usize>(count))
        .map(|i| patches[numbers::whole::<usize>((i as f64 + start) * step)])
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_patches_are_spread_and_none_is_chosen_twice() {
        let all: Vec<(i64, i64)> = (0..10).map(|i| (i, 0)).collect();
        let places = |most, start| -> Vec<i64> {
            spread(&all, most, start).into_iter().map(|(beamlet, _)| beamlet).collect()
        };
        assert_eq!(places(3.0, 0.0), [0, 3, 6]);
        assert_eq!(places(3.0, 0.99), [3, 6, 9]);
        assert_eq!(places(20.0, 0.5), (0..10).collect::<Vec<_>>());
        assert!(spread(&[], 5.0, 0.5).is_empty());
    }
}
