//! Cells of some rows of a view: lines or rays of each patch, and the resulting cells.

use super::cell_batch::{CellBatch, blank_cell_rows, blank_cells};
use super::emission::Emitter;
use super::lattice::Lattice;
use super::room::Room;
use super::view_context::ViewContext;
use crate::lines::{LineSampler, PatchPlaces, Sampled};
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use std::ops::Range;

/// Rows of patches that are chosen side by side: lines at their borders serve both.
const ROWS_TOGETHER: i64 = 4;
/// Cell rows without a sample that are handed over together.
const BLANK_AT_ONCE: usize = 1 << 12;

/// Takes cell rows as they are ready; may trace with the tracer that it is lent.
pub(crate) type Take<'a> = &'a mut dyn FnMut(&mut Tracer, &CellBatch) -> Result<()>;

/// Learns what share of the patches of its rows is done.
pub(super) type Advance<'a> = &'a mut dyn FnMut(&Tracer, f64);

/// Samples the patches of some rows and hands their cells to `take`, in parts. `lit`: rows whose undeflected light is
/// needed; other cells are kept only if light lands there. `room`: memory of lines. The cells, but not their order, are
/// the same for any `rows` and `room`.
///
/// # Errors
/// As [`Tracer::trace`]; errors of `take`.
pub(crate) fn sample_rows(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    (lit, room): (&Range<i64>, &Room),
    take: Take<'_>,
    advance: Advance<'_>,
) -> Result<()> {
    let places = PatchPlaces::new(view, rows.clone());
    if places.is_empty() && (rows.end <= lit.start || rows.start >= lit.end) {
        return Ok(());
    }
    let (mut blank, mut waiting) = (Vec::new(), Vec::new());
    let first_beamlet = view.lattice.beamlets.start;
    for block in blocks(&rows) {
        for beamlet in view.lattice.beamlets.clone() {
            for row in block.clone() {
                if places.is_touched(beamlet, row) {
                    waiting.push((beamlet, row));
                } else if lit.contains(&row) && view.lattice.direct.contains(&beamlet) {
                    blank.push((beamlet - first_beamlet, row));
                }
            }
        }
    }
    let all = waiting.len();
    let mut keep = |tracer: &mut Tracer, some: SampledCells| {
        advance(tracer, some.done as f64 / all as f64);
        blank.extend(some.empty);
        take(tracer, &some.cells)
    };
    sample_patches(view, tracer, (&waiting, &places), (lit, room), &mut keep)?;
    take_blank(view, tracer, (blank, lit), take)
}

/// Hands over cells without a sample at places (column, row) whose light is wanted in rows `lit`, in parts.
///
/// # Errors
/// Errors of `take`.
fn take_blank(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    (mut blank, lit): (Vec<(i64, i64)>, &Range<i64>),
    take: Take<'_>,
) -> Result<()> {
    let Lattice { direct, beamlets, .. } = view.lattice;
    blank.retain(|(column, row)| lit.contains(row) && direct.contains(&(column + beamlets.start)));
    let cell_rows = blank_cell_rows(view.lattice, blank);
    let mut parts = cell_rows.chunks(BLANK_AT_ONCE);
    parts.try_for_each(|part| take(tracer, &blank_cells(view.lattice, part)))
}

/// Cells of some patches.
pub(super) struct SampledCells {
    pub(super) cells: CellBatch,
    /// Places (column, row) of patches that miss the sample.
    empty: Vec<(i64, i64)>,
    /// Number of patches that are done.
    done: usize,
}

/// Hands over the cells of patches, in parts.
pub(super) fn sample_patches(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    (patches, of): (&[(i64, i64)], &PatchPlaces),
    (lit, room): (&Range<i64>, &Room),
    take: &mut dyn FnMut(&mut Tracer, SampledCells) -> Result<()>,
) -> Result<()> {
    let sampler = LineSampler::new(view);
    let emitter = Emitter::new(view, lit);
    let mut done = 0;
    let mut hand_over = |tracer: &mut Tracer, sampled: Sampled| {
        let (mut cells, empty) = emitter.cells(tracer, &sampled)?;
        cells.tally = sampled.tally;
        done += sampled.lines.len() + sampled.even.len();
        take(tracer, SampledCells { cells, empty, done })
    };
    sampler.sample(tracer, patches, of, room, &mut hand_over)
}

/// Rows whose rays go side by side.
fn blocks(rows: &Range<i64>) -> impl Iterator<Item = Range<i64>> {
    let end = rows.end;
    rows.clone()
        .step_by(numbers::narrow::<usize>(ROWS_TOGETHER))
        .map(move |first| first..(first + ROWS_TOGETHER).min(end))
}
