//! Light of rows by waves.

use super::ViewWork;
use crate::run::RunEstimate;
use crate::sampling::ProjectedBounds;
use crate::wave::{CellPlaces, WaveView};
use beamlet_core::random::GOLDEN;
use beamlet_core::{Result, numbers};
use beamlet_model::scene::Exposure;
use std::ops::Range;
use std::time::Instant;

/// Rows of a view that are timed for an estimate.
const TIMED_ROWS: i64 = 2;
/// Most rows of all views that are timed, in turns of [`TIMED_ROWS`].
const LOOKS: u32 = 4;

impl ViewWork<'_> {
    /// Adds the light of lines in some rows; true where the scene wants waves. `own`: the rows are counted.
    pub(super) fn wave_rows(
        &mut self,
        view: Exposure,
        projected_bounds: &[ProjectedBounds],
        (rows, inner): (&Range<i64>, &Range<i64>),
        own: bool,
    ) -> Result<bool> {
        let (Some(wave), Some(plans)) = (&mut self.wave, &self.simulation.wave) else {
            return Ok(false);
        };
        if matches!(view, Exposure::Sample(_)) && !projected_bounds.is_empty() {
            let begin = Instant::now();
            let simulation = self.simulation;
            let blur_rows = simulation.lattice.blur_rows;
            let lit = rows.start.max(inner.start - blur_rows)..rows.end.min(inner.end + blur_rows);
            let of_view = WaveView {
                lattice: &plans.lattice,
                shadows: projected_bounds,
                pose: self.pose,
                list: self.response.0,
                tolerance: simulation.budget.light,
                max_rays: simulation.budget.max_rays,
                cells: CellPlaces {
                    lattice: &simulation.lattice,
                    optics: simulation.detector.optics(),
                    weights: &simulation.media.weights,
                },
            };
            let (tally, cells) = wave.add_rows(&mut self.tracer, &of_view, &lit)?;
            if own {
                self.tally = self.tally + tally;
            }
            self.seconds.trace += begin.elapsed().as_secs_f64();
            if cells.iter().any(|list| !list.cells.is_empty()) {
                self.has_grazing_light = true;
                let begin = Instant::now();
                let steps = numbers::count(simulation.scene.scan.mask_offsets.len());
                // Behind groups of energies each has its own light.
                let lights = &self.lights[self.lights.len() - cells.len()..];
                self.cells.add(lights.iter().zip(&cells), &self.sums, steps)?;
                self.seconds.illuminate += begin.elapsed().as_secs_f64();
            }
        }
        Ok(true)
    }

    /// Rays and time of a run by waves, from a few rows of its views.
    pub(super) fn wave_estimate(&mut self) -> Result<RunEstimate> {
        let views = self.view_count();
        let (mut rays, mut seconds) = (0.0, 0.0);
        for look in 0..LOOKS {
            let turn = (f64::from(look) * GOLDEN + 0.5).fract();
            let pose = numbers::whole::<u32>(turn * views);
            let projected_bounds = self.simulation.projected_bounds(pose);
            let all = self.rows_of(&projected_bounds);
            let first = all.start + numbers::whole::<i64>(turn * (all.end - all.start) as f64);
            let rows = first..(first + TIMED_ROWS).min(all.end);
            if rows.is_empty() {
                continue;
            }
            self.pose = pose;
            let view = Exposure::Sample(self.simulation.view_of(pose));
            let band = self.begin_band(rows.start)?;
            let before = self.tracer.rays_traced();
            let begin = Instant::now();
            self.wave_rows(view, &projected_bounds, (&rows, &band), false)?;
            let scale = (all.end - all.start) as f64 / (rows.end - rows.start) as f64;
            rays += scale * (self.tracer.rays_traced() - before) as f64 / f64::from(LOOKS);
            seconds += scale * begin.elapsed().as_secs_f64() / f64::from(LOOKS);
        }
        Ok(RunEstimate {
            rays_per_view: rays,
            rays: rays * views,
            seconds: seconds * views,
            ..RunEstimate::default()
        })
    }
}
