//! What sampling some rows costs, from a part of their patches: these are refined as in a run, and
//! stand for the others.

use super::base_lattice::BaseLattice;
use super::narrow_components::NarrowComponents;
use super::refinement::Refiner;
use super::room::Room;
use super::rows::{lines, refined};
use super::view_context::ViewContext;
use crate::lines::PatchPlaces;
use crate::sampling::CellBatch;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use std::ops::Range;
use std::time::Instant;

/// A survey takes as much memory as a run without a limit.
const ROOM: Room = Room { rays_at_once: 1 << 17, limit: None, words: 0 };

/// Takes cells as [`super::rows::Take`] does, and returns the seconds that a run takes for them
/// beyond those that it took itself.
pub(crate) type TakePart<'a> = &'a mut dyn FnMut(&mut Tracer, &CellBatch) -> Result<f64>;

/// Cost of the patches of one kind.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct PatchCost {
    /// Patches of this kind.
    pub patches: f64,
    /// Patches among them that were refined.
    pub refined: f64,
    /// Rays of the refined ones beyond their base rays.
    pub rays: f64,
    /// Splits of the refined ones.
    pub splits: f64,
    /// Seconds that refining and illuminating them took.
    pub seconds: f64,
}

impl PatchCost {
    /// All patches of the kind for each that was refined.
    fn scale(&self) -> f64 {
        if self.refined > 0.0 { self.patches / self.refined } else { 0.0 }
    }
}

/// Cost of some rows of a view.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct RowsCost {
    /// Rows.
    pub rows: f64,
    /// Base rays, of these rows and one on either side.
    pub base_rays: f64,
    /// Seconds that those took.
    pub base_seconds: f64,
    /// Seconds that finding facets took; they depend little on the number of rows.
    pub facet_seconds: f64,
    /// Patches without and with a silhouette.
    pub kinds: [PatchCost; 2],
}

impl RowsCost {
    /// Rays of the rows, their base rays counted once.
    #[must_use]
    pub(crate) fn rays(&self) -> f64 {
        let own = self.rows / (self.rows + 2.0);
        own * self.base_rays + self.kinds.iter().map(|kind| kind.scale() * kind.rays).sum::<f64>()
    }

    /// Splits of the rows.
    #[must_use]
    pub(crate) fn splits(&self) -> f64 {
        self.kinds.iter().map(|kind| kind.scale() * kind.splits).sum()
    }

    /// Seconds of the rows, without what finding facets takes.
    #[must_use]
    pub(crate) fn seconds(&self) -> f64 {
        let own = self.rows / (self.rows + 2.0);
        let kinds = self.kinds.iter().map(|kind| kind.scale() * kind.seconds);
        own * self.base_seconds + kinds.sum::<f64>()
    }
}

/// Samples at most `most` patches of each kind (without and with a silhouette) of some rows, evenly
/// spread from the share `start` of their distance on, and hands
/// their cells to `take`.
///
/// # Errors
/// As [`Tracer::trace`]; errors of `take`.
pub(crate) fn survey_rows(
    view: &ViewContext<'_>,
    tracer: &mut Tracer,
    rows: Range<i64>,
    lit: &Range<i64>,
    (most, start): ([f64; 2], f64),
    take: TakePart<'_>,
) -> Result<RowsCost> {
    let begin = Instant::now();
    let before = tracer.rays_traced();
    let places = PatchPlaces::new(view, rows.start - 1..rows.end + 1);
    let base = BaseLattice::trace(view, tracer, &rows, &places, None)?;
    let mut cost = RowsCost {
        rows: (rows.end - rows.start) as f64,
        base_rays: (tracer.rays_traced() - before) as f64,
        base_seconds: begin.elapsed().as_secs_f64(),
        ..RowsCost::default()
    };
    let begin = Instant::now();
    let narrow = NarrowComponents::new(view, &rows, base.base);
    let refiner = Refiner::new(view, &base, narrow, lit);
    cost.facet_seconds = begin.elapsed().as_secs_f64();
    let mut kinds = [Vec::new(), Vec::new()];
    for beamlet in view.lattice.beamlets.clone() {
        for row in rows.clone() {
            if places.is_of_rays(beamlet, row) {
                kinds[1].push((beamlet, row));
            } else if places.of_lines(beamlet, row).is_some() {
                kinds[0].push((beamlet, row));
            }
        }
    }
    for (number, ((patches, most), kind)) in kinds.iter().zip(most).zip(&mut cost.kinds).enumerate()
    {
        let chosen = spread(patches, most, start);
        let begin = Instant::now();
        let before = tracer.rays_traced();
        let (mut splits, mut beyond) = (0, 0.0);
        let mut keep = |tracer: &mut Tracer, cells: CellBatch, _: Vec<(i64, i64)>| {
            splits += cells.splits;
            if !cells.cell_rows.is_empty() {
                beyond += take(tracer, &cells)?;
            }
            Ok(())
        };
        if number == 0 {
            lines(view, tracer, (&chosen, &places), (lit, &ROOM), &mut keep, &mut |_, _| {})?;
        } else {
            refined(view, &refiner, tracer, (&chosen, &ROOM), lit, &mut keep, &mut |_, _| {})?;
        }
        *kind = PatchCost {
            patches: patches.len() as f64,
            refined: chosen.len() as f64,
            rays: (tracer.rays_traced() - before) as f64,
            splits: splits as f64,
            seconds: begin.elapsed().as_secs_f64() + beyond,
        };
    }
    Ok(cost)
}

/// At most `most` of some patches, evenly spread.
pub(crate) fn spread(patches: &[(i64, i64)], most: f64, start: f64) -> Vec<(i64, i64)> {
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
    fn patches_that_are_refined_stand_for_the_others() {
        let kind = |patches, refined| PatchCost {
            patches,
            refined,
            rays: 10.0 * refined,
            splits: 2.0 * refined,
            seconds: 0.5 * refined,
        };
        let cost = RowsCost {
            rows: 4.0,
            base_rays: 600.0,
            base_seconds: 6.0,
            facet_seconds: 1.0,
            kinds: [kind(100.0, 20.0), kind(0.0, 0.0)],
        };
        let off = |got: f64, want: f64| (got - want).abs() > 1e-9;
        assert!(!off(cost.rays(), 400.0 + 1000.0) && !off(cost.splits(), 200.0));
        assert!(!off(cost.seconds(), 4.0 + 50.0), "{cost:?}");
    }

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
