//! Cells of some rows of a view: base rays, refinement of each patch, and the resulting cells.

use super::base_lattice::{BaseLattice, ROWS_TOGETHER};
use super::cell_batch::{CellBatch, blank_cell_rows, empty_cell};
use super::cell_moments::CellMoments;
use super::emission::Emitter;
use super::error_budget::tally_of;
use super::lattice::Lattice;
use super::narrow_components::NarrowComponents;
use super::patch::Patch;
use super::refinement::{Refined, Refiner};
use super::room::{Group, Room};
use super::view_context::ViewContext;
use crate::lines::{LineSampler, PatchPlaces};
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use std::ops::Range;

/// Leaves of a patch that memory is reckoned for.
const LEAVES_OF_A_PATCH: usize = 256;
/// Patches whose lines are chosen together.
const LINE_PATCHES: usize = 1 << 10;
/// Cell rows without a sample that are handed over at once.
const BLANK_AT_ONCE: usize = 1 << 12;

/// Takes cell rows as they are ready; may trace with the tracer that it is lent.
pub(crate) type Take<'a> = &'a mut dyn FnMut(&mut Tracer, &CellBatch) -> Result<()>;

/// Learns what share of the patches of its rows is done.
pub(super) type Advance<'a> = &'a mut dyn FnMut(&Tracer, f64);

/// Samples the patches of some rows and hands their cells to `take`, in parts. `lit`: rows whose
/// undeflected light is needed; other cells are kept only if light lands there. `room`: memory of
/// refinement. `known`: base rays of rows of this view that were sampled before; the base rays
/// of these rows replace them. The cells, but not their order, are the same for any `rows` and `room`.
///
/// # Errors
/// As [`Tracer::trace`]; errors of `take`.
pub(crate) fn sample_rows(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    (lit, known): (&Range<i64>, &mut Option<BaseLattice>),
    room: &Room,
    take: Take<'_>,
    advance: Advance<'_>,
) -> Result<()> {
    let places = PatchPlaces::new(view, rows.start - 1..rows.end + 1);
    let base = BaseLattice::trace(view, tracer, &rows, &places, known.take().as_ref())?;
    let base = &*known.insert(base);
    if places.is_empty() && (rows.end <= lit.start || rows.start >= lit.end) {
        return Ok(());
    }
    let mut blank = Vec::new();
    let (mut waiting, mut of_lines) = (Vec::new(), Vec::new());
    let first_beamlet = view.lattice.beamlets.start;
    for block in blocks(&rows) {
        for beamlet in view.lattice.beamlets.clone() {
            for row in block.clone() {
                let direct = lit.contains(&row) && view.lattice.direct.contains(&beamlet);
                if places.is_of_rays(beamlet, row) {
                    waiting.push((beamlet, row));
                } else if places.of_lines(beamlet, row).is_some() {
                    of_lines.push((beamlet, row));
                } else if direct {
                    blank.push((beamlet - first_beamlet, row));
                }
            }
        }
    }
    let all = waiting.len() + of_lines.len();
    let mut keep = |tracer: &mut Tracer, cells: CellBatch, empty: Vec<(i64, i64)>| {
        blank.extend(empty);
        take(tracer, &cells)
    };
    let mut done = |tracer: &Tracer, done: usize| advance(tracer, done as f64 / all as f64);
    lines(view, tracer, (&of_lines, &places), (lit, room), &mut keep, &mut done)?;
    let refiner = (!waiting.is_empty())
        .then(|| Refiner::new(view, base, NarrowComponents::new(view, &rows, base.base), lit));
    let mut before = of_lines.len();
    for chunk in waiting.chunks((room.rays_at_once / LEAVES_OF_A_PATCH).max(1)) {
        let mut part = |tracer: &Tracer, done: usize| {
            advance(tracer, (before + done) as f64 / all as f64);
        };
        let Some(refiner) = &refiner else { break };
        refined(view, refiner, tracer, (chunk, room), lit, &mut keep, &mut part)?;
        before += chunk.len();
    }
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
    let cell = empty_cell(view.lattice);
    let words = view.recording.as_ref().map_or(0, |recording| recording.words());
    let none = CellMoments { ends: vec![0.0; 2 * words], ..CellMoments::default() };
    for cell_rows in blank_cell_rows(view.lattice, blank).chunks(BLANK_AT_ONCE) {
        let mut part = CellBatch::default();
        cell_rows.iter().for_each(|cell_row| part.push(*cell_row, &[cell], &none));
        take(tracer, &part)?;
    }
    Ok(())
}

/// Receives the cells of some patches, and the places (column, row) of patches that miss the sample.
pub(super) type TakeRefined<'a> =
    &'a mut dyn FnMut(&mut Tracer, CellBatch, Vec<(i64, i64)>) -> Result<()>;

/// Hands over the cells of patches of lines, in parts. `advance` gets how many are done.
pub(super) fn lines(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    (patches, of): (&[(i64, i64)], &PatchPlaces),
    (lit, room): (&Range<i64>, &Room),
    take: TakeRefined<'_>,
    advance: &mut dyn FnMut(&Tracer, usize),
) -> Result<()> {
    let sampler = LineSampler::new(view);
    let emitter = Emitter::new(view, lit);
    let mut done = 0;
    let mut waiting: Vec<&[(i64, i64)]> = patches.chunks(LINE_PATCHES).rev().collect();
    while let Some(some) = waiting.pop() {
        let Some((patches, tally)) = sampler.sample(tracer, some, of, room.bytes_of_lines())?
        else {
            if let [at] = *some {
                return Err(room.too_small(at, "lines", 2 * room.bytes_of_lines()));
            }
            // Work that is lost comes to the same.
            let (first, other) = some.split_at(some.len() / 2);
            waiting.extend([other, first]);
            continue;
        };
        let (mut cells, empty) = emitter.cells_of_lines(tracer, &patches)?;
        cells.tally = tally;
        cells.balance();
        done += some.len();
        advance(tracer, done);
        take(tracer, cells, empty)?;
    }
    Ok(())
}

/// Refines patches and hands their cells over, in parts. Where the patches would hold more than there
/// is room for together, one half waits for the other. `advance` gets how many are done.
pub(super) fn refined(
    view: &ViewContext<'_>,
    refiner: &Refiner<'_>,
    tracer: &mut Tracer,
    (patches, room): (&[(i64, i64)], &Room),
    lit: &Range<i64>,
    take: TakeRefined<'_>,
    advance: &mut dyn FnMut(&Tracer, usize),
) -> Result<()> {
    let emitter = Emitter::new(view, lit);
    let mut groups = vec![Group::Begun(refiner.begin_all(tracer, patches)?)];
    let mut finished = 0;
    while let Some(group) = groups.pop() {
        let mut group = match group {
            Group::Begun(work) => work,
            Group::Waiting(patches) => refiner.begin_all(tracer, &patches)?,
        };
        let others = finished + groups.iter().map(Group::done).sum::<usize>();
        let mut part = |tracer: &Tracer, done: usize| advance(tracer, others + done);
        let waiting: u64 = groups.iter().map(Group::bytes).sum();
        let bytes = room.bytes().saturating_sub(waiting);
        let refined = refiner.refine(tracer, &mut group, (room.rectangles(), bytes), &mut part)?;
        if refined != Refined::Done {
            match (refined, &group[..]) {
                // Their work is lost: it is done again, and comes to the same.
                (Refined::Full(_), _) if waiting > 0 => groups.iter_mut().for_each(Group::let_go),
                (Refined::Full(bytes), [one]) => {
                    return Err(room.too_small(
                        (one.patch.beamlet, one.patch.row),
                        "rectangles",
                        bytes,
                    ));
                }
                _ => groups.push(Group::Begun(group.split_off(group.len() / 2))),
            }
            groups.push(Group::Begun(group));
            continue;
        }
        finished += group.len();
        let patches: Vec<&Patch> = group.iter().map(|work| &work.patch).collect();
        let (mut cells, empty) = emitter.cells(tracer, &refiner.estimator, &patches)?;
        for work in &group {
            cells.splits += u64::from(work.patch.splits);
            cells.tally = cells.tally + tally_of(work.errors, work.rays, &view.budget);
        }
        // Cells may take as much again.
        drop(patches);
        drop(group);
        cells.balance();
        take(tracer, cells, empty)?;
    }
    Ok(())
}

/// Rows whose rays go side by side.
fn blocks(rows: &Range<i64>) -> impl Iterator<Item = Range<i64>> {
    let end = rows.end;
    rows.clone()
        .step_by(numbers::narrow::<usize>(ROWS_TOGETHER))
        .map(move |first| first..(first + ROWS_TOGETHER).min(end))
}
