//! Patches of rows that the sample touches: heights of their lines, and estimates of their errors.

use super::band::WaveBand;
use super::cells::CellPlaces;
use super::lines::Patch;
use crate::lines::{Features, Heights, LEAST_OF_RAYS, Limits, LinePlace, SampleImage, Uneven};
use crate::sampling::{CellBatch, ProjectedBounds, SAFETY};
use crate::trace::Tracer;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use std::collections::BTreeMap;
use std::ops::Range;

/// Patches whose heights are chosen together.
const PATCHES: usize = 1 << 12;
/// Share of the tolerance that the heights of the lines of a patch take: the rest is the spacing's.
const BY_HEIGHTS: f64 = 0.4;
/// Patches of a row of which one is traced with half the spacing.
const SPARSE: usize = 16;
/// Error of a spacing over the change by half of it: errors grow as the power 2.3 of the spacing.
const PER_CHANGE: f64 = 1.25;

/// Pose of a sample at a list of mask offsets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WaveView<'a> {
    /// Sample in the image from the source, with the lattice of the beamlets.
    pub image: &'a SampleImage<'a>,
    /// Shadows of its components.
    pub shadows: &'a [ProjectedBounds],
    /// Index of the pose among the poses of all views.
    pub pose: u32,
    /// Index of the list of mask offsets.
    pub list: usize,
    /// Error of light, share of open beam.
    pub tolerance: f64,
    /// Most rays of a patch.
    pub max_rays: u32,
    /// Cells of light near grazing.
    pub cells: CellPlaces<'a>,
}

/// Patch that a shadow touches.
#[derive(Debug, Clone)]
struct Touched {
    row: i64,
    beamlet: i64,
    /// Components in the row.
    features: Features,
    /// Number of patches whose spacing this one is an estimate for; 0 for none.
    counts_for: f64,
}

impl WaveBand {
    /// Puts the light of lines in the place of the flat in the patches of some rows that a shadow touches; cells of
    /// light near grazing, by energy.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn add_rows(
        &mut self,
        tracer: &mut Tracer,
        view: &WaveView<'_>,
        rows: &Range<i64>,
    ) -> Result<(Tally, Vec<CellBatch>)> {
        let touched = self.touched(view, rows);
        let most = numbers::whole::<u32>(f64::from(view.max_rays / self.lines.plan.rays)).max(3);
        let limits = Limits {
            error: BY_HEIGHTS * view.tolerance,
            lines: most as usize,
            reach: 0.0,
            uneven: Uneven::Never,
            least: LEAST_OF_RAYS,
            thin: BY_HEIGHTS * view.tolerance,
            beside: LEAST_OF_RAYS,
        };
        let mut tally = Tally::default();
        let mut cells = vec![CellBatch::default(); self.lines.plan.energies as usize];
        for some in touched.chunks(PATCHES) {
            let patch = |it: &Touched| Patch {
                beamlet: it.beamlet,
                row: it.row,
                heights: Heights::new(&it.features, limits),
            };
            let mut patches: Vec<Patch> = some.iter().map(patch).collect();
            self.choose_heights(tracer, view, &mut patches)?;
            let changes = self.spacing_errors(tracer, view, some, &patches)?;
            for ((patch, at), change) in patches.iter().zip(some).zip(changes) {
                self.add_patch(view, patch);
                let errors = [patch.heights.error(), change];
                let of_patch =
                    tally_of(patch, errors, at.counts_for, self.lines.plan.rays, view.tolerance);
                let of_rays = view.cells.add(&mut cells, view.image.lattice, patch);
                let grazing_light = numbers::whole((of_rays * 1e9).round());
                tally = tally + Tally { grazing_light, ..of_patch };
            }
        }
        tally.landed_off += cells.iter().map(|list| list.landed_off).sum::<u64>();
        Ok((tally, cells))
    }

    /// Patches that shadows touch, in order.
    fn touched(&self, view: &WaveView<'_>, rows: &Range<i64>) -> Vec<Touched> {
        let mut found: BTreeMap<i64, BTreeMap<i64, Features>> = BTreeMap::new();
        let all = &self.lines.plan.beamlets;
        let mut is_selected = vec![false; view.shadows.len()];
        for (shadow, is_selected) in view.shadows.iter().zip(&mut is_selected) {
            let [own, beamlets] = shadow.patches(view.image.lattice);
            // Lines reach over the borders of their beamlet.
            let near = (beamlets.start - 1).max(all.start)..(beamlets.end + 1).min(all.end);
            for row in own.start.max(rows.start)..own.end.min(rows.end) {
                let of_row = found.entry(row).or_default();
                for beamlet in near.clone() {
                    let features = of_row.entry(beamlet).or_default();
                    features.add_body(shadow, row);
                    *is_selected |= features.varies;
                }
            }
        }
        let of = |beamlet: i64, row: i64| found.get(&row).and_then(|of_row| of_row.get(&beamlet));
        let is_wanted = |beamlet, row| of(beamlet, row).is_some_and(|it| it.varies);
        for it in view.image.changes(rows.clone(), &is_selected, &is_wanted) {
            let features = found.get_mut(&it.row).and_then(|of_row| of_row.get_mut(&it.beamlet));
            features.into_iter().for_each(|features| features.add(it.change, it.row));
        }
        found.values_mut().flat_map(BTreeMap::values_mut).for_each(Features::join_creases);
        found.into_iter().flat_map(|(row, of_row)| in_row(row, of_row)).collect()
    }

    /// Errors of the spacing in the patches that are estimates, by lines of half of it; 0 for others.
    fn spacing_errors(
        &mut self,
        tracer: &mut Tracer,
        view: &WaveView<'_>,
        touched: &[Touched],
        patches: &[Patch],
    ) -> Result<Vec<f64>> {
        let chosen: Vec<usize> =
            (0..touched.len()).filter(|at| touched[*at].counts_for > 0.0).collect();
        let line = |at: &usize| patches[*at].line(patches[*at].heights.middle().0);
        let lines: Vec<LinePlace> = chosen.iter().map(line).collect();
        let index = [view.pose, numbers::count(view.list)];
        let all = self.finer.light(tracer, view.image.lattice, &lines, index)?;
        let mut errors = vec![0.0; touched.len()];
        for (at, finer) in chosen.iter().zip(all) {
            let (_, own) = patches[*at].heights.middle();
            let pairs = own.into_iter().flat_map(|own| own.light.iter().zip(&finer.light));
            let change = pairs.map(|(own, finer)| f64::from(own - finer).abs());
            errors[*at] = PER_CHANGE * change.fold(0.0, f64::max);
        }
        Ok(errors)
    }

    /// Adds lines to patches until their light is within the limits. Rows side by side share the line at their border.
    fn choose_heights(
        &mut self,
        tracer: &mut Tracer,
        view: &WaveView<'_>,
        patches: &mut [Patch],
    ) -> Result<()> {
        let index = [view.pose, numbers::count(view.list)];
        loop {
            let of_patch = |patch: &Patch| -> Vec<LinePlace> {
                patch.heights.wanted().map(|z| patch.line(z)).collect()
            };
            let wanted: Vec<Vec<LinePlace>> = patches.iter().map(of_patch).collect();
            let lines = LinePlace::distinct(wanted.concat());
            if lines.is_empty() {
                return Ok(());
            }
            let light = self.lines.light(tracer, view.image.lattice, &lines, index)?;
            for (patch, own) in patches.iter_mut().zip(wanted).filter(|(_, own)| !own.is_empty()) {
                let line = |place: &LinePlace| Some(light[place.index(&lines)?].clone());
                patch.heights.add(own.iter().filter_map(line));
            }
        }
    }
}

/// Patches of a row, with the number of them that each of a few counts for: which ones depends on the row alone.
fn in_row(row: i64, beamlets: BTreeMap<i64, Features>) -> Vec<Touched> {
    let count = beamlets.len();
    // A shadow beside all beamlets leaves a row of none.
    let every = SPARSE.min(count).max(1);
    let first = numbers::whole::<usize>((5 * row).rem_euclid(every as i64) as f64);
    let chosen = (count - first).div_ceil(every);
    let patch = |(index, (beamlet, features)): (usize, (i64, Features))| {
        let is_chosen = index % every == first;
        let counts_for = if is_chosen { count as f64 / chosen as f64 } else { 0.0 };
        Touched { row, beamlet, features, counts_for }
    };
    beamlets.into_iter().enumerate().map(patch).collect()
}

/// Counts of a patch. `errors`: by the heights of its lines and by their spacing, the second of `counts_for`
/// patches.
fn tally_of(
    patch: &Patch,
    [heights, spacing]: [f64; 2],
    counts_for: f64,
    rays: u32,
    tolerance: f64,
) -> Tally {
    let squares = heights * heights + counts_for * spacing * spacing;
    let error = heights.hypot(spacing);
    let rays = patch.heights.count() as u64 * u64::from(rays);
    Tally {
        patches: 1,
        patch_rays: rays,
        most_patch_rays: rays,
        error_squares: numbers::whole(squares * 1e18),
        worst_error: numbers::whole(error * 1e9),
        beyond_tolerance: u64::from(error > SAFETY * tolerance),
        ..Tally::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chosen patches count for all of a row, whatever their number; a row may have none.
    #[test]
    fn chosen_patches_count_for_all_of_a_row() {
        for count in [0, 1, 2, 7, 40_i64] {
            for row in -3..3 {
                let of_row =
                    in_row(row, (0..count).map(|beamlet| (beamlet, Features::default())).collect());
                let all: f64 = of_row.iter().map(|it| it.counts_for).sum();
                assert!((all - count as f64).abs() < 1e-9, "{count} {row}: {all}");
            }
        }
    }
}
