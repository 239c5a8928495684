//! What sampling some rows costs, from a part of their patches: these are sampled as in a run, and stand for the
//! others.

use super::room::Room;
use super::rows::{SampledCells, sample_patches};
use super::view_context::ViewContext;
use crate::lines::PatchPlaces;
use crate::sampling::CellBatch;
use crate::trace::Tracer;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use std::ops::Range;
use std::time::Instant;

/// Patches of many bodies that are sampled for each of few: they take far longer.
const CROWDED: f64 = 0.25;

/// Takes cells as [`super::rows::Take`] does, and returns the seconds that a run takes for them
/// beyond those that it took itself.
pub(crate) type TakePart<'a> = &'a mut dyn FnMut(&mut Tracer, &CellBatch) -> Result<f64>;

/// Cost of the patches of some rows of a view, reckoned from those that were sampled.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct RowsCost {
    /// Patches that shadows touch.
    pub patches: f64,
    /// Their rays, lines and cells.
    pub rays: f64,
    pub lines: f64,
    pub cells: f64,
    /// Seconds that sampling and illuminating them takes.
    pub seconds: f64,
    /// Patches that were sampled, and seconds that these took.
    pub sampled: f64,
    pub spent: f64,
}

impl RowsCost {
    /// The cost of some times as many rows like these.
    pub(crate) fn times(self, share: f64) -> Self {
        let Self { patches, rays, lines, cells, seconds, .. } = self;
        let [patches, rays, lines, cells, seconds] =
            [patches, rays, lines, cells, seconds].map(|it| share * it);
        Self { patches, rays, lines, cells, seconds, ..self }
    }

    /// The cost of both.
    pub(crate) fn and(self, other: &Self) -> Self {
        Self {
            patches: self.patches + other.patches,
            rays: self.rays + other.rays,
            lines: self.lines + other.lines,
            cells: self.cells + other.cells,
            seconds: self.seconds + other.seconds,
            sampled: self.sampled + other.sampled,
            spent: self.spent + other.spent,
        }
    }
}

/// Samples at most `most` patches of few bodies of some rows and fewer of many bodies, evenly spread from the share `start`
/// of their distance on, and hands their cells to `take`.
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
    let places = PatchPlaces::new(view, rows.clone());
    let kinds: (Vec<_>, Vec<_>) =
        touched(view, rows, &places).partition(|(beamlet, row)| !places.is_crowded(*beamlet, *row));
    let mut cost = RowsCost::default();
    let kinds = [(kinds.0, most), (kinds.1, CROWDED * most)];
    for (patches, most) in kinds.into_iter().filter(|(patches, _)| !patches.is_empty()) {
        let begin = Instant::now();
        let before = tracer.rays_traced();
        let chosen = spread(&patches, most, start);
        let (mut lines, mut cells, mut beyond) = (0, 0, 0.0);
        let mut keep = |tracer: &mut Tracer, SampledCells { cells: batch, .. }: SampledCells| {
            lines += batch.tally.lines;
            cells += batch.cells.len();
            if !batch.cell_rows.is_empty() {
                beyond += take(tracer, &batch)?;
            }
            Ok(())
        };
        let lit = (lit, &Room::default());
        sample_patches(view, tracer, (&chosen, &places), lit, &mut keep)?;
        let spent = begin.elapsed().as_secs_f64() + beyond;
        let scale = patches.len() as f64 / chosen.len() as f64;
        cost.patches += patches.len() as f64;
        cost.rays += scale * (tracer.rays_traced() - before) as f64;
        cost.lines += scale * lines as f64;
        cost.cells += scale * cells as f64;
        cost.seconds += scale * spent;
        cost.sampled += chosen.len() as f64;
        cost.spent += spent;
    }
    Ok(cost)
}

/// Counts of at most `most` patches of some rows, spread as in [`survey_rows`]: of an audit, where the budget of `view` has
/// one.
///
/// # Errors
/// As [`Tracer::trace`].
pub(crate) fn count_patches(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    lit: &Range<i64>,
    (most, start): (f64, f64),
) -> Result<Tally> {
    let places = PatchPlaces::new(view, rows.clone());
    let touched: Vec<_> = touched(view, rows, &places).collect();
    let mut tally = Tally::default();
    let mut add = |_: &mut Tracer, some: SampledCells| {
        tally = tally + some.cells.tally;
        Ok(())
    };
    let chosen = spread(&touched, most, start);
    sample_patches(view, tracer, (&chosen, &places), (lit, &Room::default()), &mut add)?;
    Ok(tally)
}

/// Patches of some rows that shadows touch, by row: patches that are spread over the list are spread over its rows.
fn touched(
    view: &ViewContext<'_>,
    rows: Range<i64>,
    places: &PatchPlaces,
) -> impl Iterator<Item = (i64, i64)> {
    let of_row = |row: i64| view.lattice.beamlets.clone().map(move |beamlet| (beamlet, row));
    rows.flat_map(of_row).filter(|(beamlet, row)| places.is_touched(*beamlet, *row))
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
