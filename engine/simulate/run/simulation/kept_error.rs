//! Error of stored cells in another set-up: rows of some views are sampled again, and their light is
//! compared with the light of the stored cells.

use super::Simulation;
use super::work::ViewWork;
use crate::moments::StoredSource;
use crate::run::Control;
use crate::sampling::{Lattice, ProjectedBounds, projected_bounds, touches_pixel};
use beamlet_core::{Error, Result, numbers};
use beamlet_files::{RunFile, SamplingSummary, layout};
use beamlet_model::scene::Exposure;
use ndarray::Array3;
use std::ops::Range;

/// Views that are looked at, at most.
const MOST_VIEWS: u32 = 2;
/// Rows of a view that stand for those between its first and its last, at most.
const INNER_ROWS: u32 = 6;
/// Fractional part of the golden ratio: its multiples spread evenly over [0, 1).
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// A single pixel may err by this many tolerances, as in a new simulation (docs/developers/validation.md).
const SINGLE: f64 = 5.0;

/// Differences of values, each pixel by the step where it is largest.
#[derive(Debug, Default)]
struct Differences {
    pixels: u64,
    beyond: u64,
    weight: f64,
    squares: f64,
    worst: f64,
    /// Rows of all views that were compared, and rows of the shadow in all views.
    rows: [f64; 2],
}

impl Differences {
    fn take(&mut self, difference: f64, weight: f64, tolerance: f64) {
        self.pixels += 1;
        self.beyond += u64::from(difference > tolerance);
        self.weight += weight;
        self.squares += weight * difference * difference;
        self.worst = self.worst.max(difference);
    }

    /// Warns where the sample is seen in rows that were not compared: cells that the borders of pixels cut
    /// err most at corners and ends of bodies, which lie in few rows.
    fn warn_of_other_rows(&self) {
        let [compared, all] = self.rows;
        if compared < all {
            log::warn!(
                "stored cells were compared with a new simulation in {compared:.0} of about {all:.0} rows with the sample: single pixels in others may differ by more, at corners and ends of bodies by percents of open beam"
            );
        }
    }

    fn summary(&self, tolerance: f64) -> Option<SamplingSummary> {
        (self.pixels > 0).then(|| {
            let rms = (self.squares / self.weight).sqrt();
            SamplingSummary::of_kept(self.pixels, [rms, self.worst], self.beyond, tolerance)
        })
    }
}

impl Simulation {
    /// Error of the values of this scene from stored cells: by a new simulation of some rows if the scene
    /// needs finer cells than the run, else the estimate of the run. `None`: unknown.
    ///
    /// # Errors
    /// [`Error::Scene`] where that is beyond the tolerance; as [`Simulation::run`].
    pub(super) fn kept_error(&self, control: &Control<'_>) -> Result<Option<SamplingSummary>> {
        let Some(stored) = &self.stored else { return Ok(None) };
        let Some(finer) = &stored.finer else {
            let record = stored.run().join(layout::RUN);
            return Ok(RunFile::read(&record).ok().and_then(|file| file.record.sampling));
        };
        if self.scene.objects.is_empty() {
            return Ok(None);
        }
        let tolerance = self.scene.sampling.tolerances().light;
        let differences = self.differences(stored, control)?;
        let Some(found) = differences.summary(tolerance) else { return Ok(None) };
        if found.rms_error <= tolerance && found.worst_error <= SINGLE * tolerance {
            differences.warn_of_other_rows();
            return Ok(Some(found));
        }
        let (rms, worst) = (found.rms_error, found.worst_error);
        Err(Error::scene(
            &*finer.key,
            format!(
                "{}, for which stored cells differ from a new simulation by {rms:.1e} of open beam (rms), {worst:.1e} in single pixels",
                finer.found
            ),
            format!(
                "up to sampling.tolerance, {tolerance:.1e} (rms), and {SINGLE} times that in single pixels; the run has {}: simulate this scene instead",
                finer.of_run
            ),
        ))
    }

    /// Values from stored cells against a new simulation, in rows of some views.
    fn differences(&self, stored: &StoredSource, control: &Control<'_>) -> Result<Differences> {
        let mut own = Control::default().with_cancel(control.cancel.clone());
        let mut scene = (*self.scene).clone();
        // Its own error is at most the error of the run's cells in the run's set-up.
        scene.sampling.tolerance =
            Some(scene.sampling.tolerances().light.min(stored.base_tolerance()));
        let fresh = Self::new(&self.simulator, &scene, &mut own)?;
        let count = numbers::count(self.scene.scan.views());
        let looks = count.min(MOST_VIEWS);
        let views: Vec<u32> = (0..looks)
            .map(|look| match looks < count {
                true => {
                    numbers::whole::<u32>((f64::from(look) * GOLDEN).fract() * f64::from(count))
                }
                false => look,
            })
            .collect();
        let exposures: Vec<Exposure> = views.iter().map(|view| Exposure::Sample(*view)).collect();
        let mut works = [
            ViewWork::new(self, &exposures, &own.cancel, self.alone)?,
            ViewWork::new(&fresh, &exposures, &own.cancel, fresh.alone)?,
        ];
        let pixels = beamlet_model::optics::Optics::of(&self.scene);
        let lattice = Lattice::of(&pixels, fresh.media.strongest());
        let mut differences = Differences::default();
        let of_views = f64::from(count) / f64::from(looks);
        for view in views {
            let shadow = fresh.projected_bounds(view);
            let motion = self.scene.view(view as usize).motion;
            let seen = projected_bounds(&fresh.sample, &lattice, &motion);
            for (row, weight) in rows_of(&seen, self.scene.detector.pixels[1]) {
                differences.rows[0] += 1.0;
                differences.rows[1] += weight * of_views;
                let mut values = Vec::new();
                for (work, bounds) in works.iter_mut().zip([&[][..], &shadow]) {
                    values.push(work.row(view, bounds, row, &mut own)?);
                }
                self.compare(&values, (&lattice, &seen, row), weight, &mut differences);
            }
        }
        Ok(differences)
    }

    /// Takes the pixels of a row that the sample touches.
    fn compare(
        &self,
        values: &[Array3<f32>],
        (lattice, seen, row): (&Lattice, &[ProjectedBounds], u32),
        weight: f64,
        differences: &mut Differences,
    ) {
        let [kept, fresh] = values else { return };
        let tolerance = self.scene.sampling.tolerances().light;
        for column in 0..self.scene.detector.pixels[0] {
            if !touches_pixel(seen, lattice, [column.into(), row.into()]) {
                continue;
            }
            let steps = 0..kept.shape()[0];
            let at = |step: usize| [step, 0, column as usize];
            let apart = steps.map(|step| f64::from((kept[at(step)] - fresh[at(step)]).abs()));
            differences.take(apart.fold(0.0, f64::max), weight, tolerance);
        }
    }
}

/// Rows of the detector in a shadow, each with the number of rows that it stands for: the first, the
/// last, and some between.
fn rows_of(seen: &[ProjectedBounds], rows: u32) -> Vec<(u32, f64)> {
    let top = seen.iter().map(|it| it.rows[0]).fold(f64::INFINITY, f64::min);
    let bottom = seen.iter().map(|it| it.rows[1]).fold(f64::NEG_INFINITY, f64::max);
    let last_row = f64::from(rows) - 1.0;
    let inside = |row: f64| numbers::whole::<u32>(row.floor().clamp(0.0, last_row));
    if seen.is_empty() || bottom < 0.0 || top > f64::from(rows) {
        return Vec::new();
    }
    let all: Range<u32> = inside(top)..inside(bottom) + 1;
    let count = all.end - all.start;
    if count <= INNER_ROWS + 2 {
        return all.map(|row| (row, 1.0)).collect();
    }
    let inner = f64::from(count - 2);
    let each = inner / f64::from(INNER_ROWS);
    let between = (0..INNER_ROWS).map(|index| {
        // At no even distance: rows of the run that kept the cells are even.
        let at = (f64::from(index) + (f64::from(index) * GOLDEN + 0.5).fract()) * each;
        (all.start + 1 + numbers::whole::<u32>(at), each)
    });
    [(all.start, 1.0), (all.end - 1, 1.0)].into_iter().chain(between).collect()
}
