//! Cost of a run, from a sparse sample of the scene: patches spread over views, rows and columns are
//! sampled and illuminated as in a run, and represent the others.

use super::detection::detection_seconds;
use super::{ViewWork, bands};
use crate::run::RunEstimate;
use crate::run::simulation::Simulation;
use crate::sampling::{self, CellBatch, PATCHES_AT_ONCE, ProjectedBounds, RowsCost};
use crate::trace::Tracer;
use beamlet_core::cancel::Cancel;
use beamlet_core::random::GOLDEN;
use beamlet_core::{Result, numbers};
use beamlet_files::{self as stack, AuditedError};
use beamlet_model::optics::Optics;
use beamlet_model::scene::{Exposure, Scheme};
use std::collections::HashSet;
use std::ops::Range;
use std::time::Instant;

/// Rows of a view that are surveyed together: as many share lines at their borders in a run.
const ROWS: i64 = 4;
/// Mask steps that are illuminated; others cost as much each.
const STEPS: u32 = 128;
/// Largest number of looks.
const MOST_LOOKS: u32 = 24;
/// Least number of looks, whatever the time.
const LEAST_LOOKS: u32 = 10;
/// Seconds after which no further look is taken.
const SECONDS: f64 = 1.0;
/// Patches that the first look samples.
const FIRST_PATCHES: f64 = 64.0;
/// Fewest and most patches of a look.
const PATCHES: [f64; 2] = [16.0, 256.0];
/// Seconds for them.
const SECONDS_OF_A_LOOK: f64 = 0.15;
/// Blocks of rows of which patches are audited, and patches of each.
const AUDITED_BLOCKS: u32 = 8;
const AUDITED_PATCHES: f64 = 8.0;
/// Rows of the flat, or of random rays, that are timed.
const TIMED_ROWS: i64 = 8;
/// Times that the flat's are timed.
const TIMES: u32 = 3;
/// Random rays that are timed, about.
const TIMED_RAYS: f64 = 2e6;

/// Look at a view.
struct Look {
    /// Seconds that finding the shadows took.
    shadow_seconds: f64,
    /// Cost of all rows that a shadow reaches.
    cost: RowsCost,
}

impl Simulation {
    /// Estimates rays and time of a run without noise and output, from a part of the patches; it takes
    /// about a second, and does not depend on earlier estimates.
    ///
    /// # Errors
    /// As [`Simulation::run`], without errors of a sink.
    pub fn estimate(&self) -> Result<RunEstimate> {
        self.estimate_until(&Cancel::default())
    }

    /// As [`Simulation::estimate`]; [`beamlet_core::Error::Interrupted`] when `cancel` was set.
    ///
    /// # Errors
    ///
    /// As [`Simulation::estimate`].
    #[doc(hidden)]
    pub fn estimate_until(&self, cancel: &Cancel) -> Result<RunEstimate> {
        let begin = Instant::now();
        let views: Vec<Exposure> = stack::views(&self.scene)?.collect();
        let mut work = ViewWork::new(self, &views, cancel, self.alone)?;
        let fixed = self.prepared_in + begin.elapsed().as_secs_f64();
        let mut estimate = if self.wave.is_some() {
            work.wave_estimate()?
        } else if self.scene.sampling.scheme == Scheme::Random {
            work.random_estimate()?
        } else {
            work.cells_estimate()?
        };
        let steps = self.scene.mask_steps();
        let of_exposure = detection_seconds(&self.detector, steps, work.band, cancel)?;
        estimate.seconds +=
            fixed + (work.view_count() + self.scene.scan.flat_places().len() as f64) * of_exposure;
        Ok(estimate)
    }
}

impl ViewWork<'_> {
    fn lit_rows_of_all(&self) -> i64 {
        self.simulation.detector.optics().detector.pixels[1].into()
    }

    /// Mask steps that are illuminated.
    fn steps(&self) -> u32 {
        numbers::count(self.simulation.scene.mask_steps()).min(STEPS)
    }

    /// The others, for each of these.
    fn steps_left_out(&self) -> f64 {
        self.simulation.scene.scan.mask_offsets.len() as f64 / f64::from(self.steps()) - 1.0
    }

    /// Poses of the sample: one for each view, but in fly scans.
    pub(super) fn view_count(&self) -> f64 {
        self.simulation.scene.scan.poses() as f64
    }

    /// Sets the sums to the band with a row of the grid, and returns the band's rows there.
    pub(super) fn begin_band(&mut self, row: i64) -> Result<Range<i64>> {
        let rows = self.simulation.scene.detector.pixels[1];
        let grid = self.simulation.detector.grid();
        let mut lit = grid.lit_rows(&(0..rows.min(self.band)));
        for band in bands(rows, self.band) {
            let own = grid.lit_rows(&band);
            if i64::from(own.start) <= row {
                lit = own;
            }
        }
        self.clear_band(&lit, 0)?;
        Ok(i64::from(lit.start)..i64::from(lit.end))
    }

    fn cells_estimate(&mut self) -> Result<RunEstimate> {
        let blank = self.blank_seconds()?;
        let looks = self.looks()?;
        let views = self.view_count();
        let count = looks.len().max(1) as f64;
        let mean = |of: &dyn Fn(&Look) -> f64| looks.iter().map(of).sum::<f64>() / count;
        let rays = mean(&|look| look.cost.rays);
        let seconds = mean(&|look| look.shadow_seconds + look.cost.seconds);
        let of_looks =
            |of: &dyn Fn(&RowsCost) -> f64| looks.iter().map(|look| of(&look.cost)).sum::<f64>();
        let sampled = of_looks(&|cost| cost.sampled);
        let cells_per_patch =
            of_looks(&|cost| cost.cells) / of_looks(&|cost| cost.patches).max(1.0);
        let patches = mean(&|look| look.cost.patches);
        Ok(RunEstimate {
            rays_per_view: rays,
            rays: rays * views,
            lines: views * mean(&|look| look.cost.lines),
            seconds: views * seconds + (views + 1.0) * blank,
            cells_at_once: cells_per_patch * patches.min(PATCHES_AT_ONCE as f64),
            patches_sampled: sampled,
            sampling_error: self.audit()?,
        })
    }

    /// Measured error of sampling of some patches of recorded rows, spread over views and rows.
    fn audit(&mut self) -> Result<Option<AuditedError>> {
        // Sums of squared errors, in squared tolerances, and patches of each block.
        let mut blocks: Vec<[f64; 2]> = Vec::new();
        if self.simulation.sample.is_empty() {
            return Ok(None);
        }
        for number in 0..AUDITED_BLOCKS {
            let turn = (f64::from(number) * GOLDEN + 0.5).fract();
            let pose = numbers::whole::<u32>(turn * self.view_count());
            let projected_bounds = self.simulation.projected_bounds(pose);
            let all = self.rows_of(&projected_bounds);
            let [low, high] = [all.start.max(0), all.end.min(self.lit_rows_of_all())];
            let first = low + numbers::whole::<i64>(turn * (high - low).max(0) as f64);
            let rows = first..(first + ROWS).min(high);
            if rows.is_empty() {
                continue;
            }
            let band = self.begin_band(rows.start)?;
            let Self { tracer, simulation, .. } = self;
            let response = simulation.response(Exposure::Sample(simulation.view_of(pose)));
            let mut view = simulation.pose_context(pose, &projected_bounds, &response);
            view.budget.audit = 1.0;
            let chosen = (AUDITED_PATCHES, turn);
            let audited = sampling::count_patches(&view, tracer, rows, &band, chosen)?.audit.all();
            if audited.patches > 0 {
                blocks.push([audited.squares()[0], audited.patches as f64]);
            }
        }
        let sum = |of: &dyn Fn(&[f64; 2]) -> f64| blocks.iter().map(of).sum::<f64>();
        let (count, patches) = (blocks.len() as f64, sum(&|[_, patches]| *patches));
        let square = sum(&|[squares, _]| *squares) / patches;
        // Blocks differ by their patches, and by the places of rays.
        let apart = sum(&|[squares, patches]| (squares - square * patches).powi(2));
        let error = (apart * count / (count - 1.0)).sqrt() / patches;
        let tolerance = self.simulation.budget.tolerance;
        Ok((blocks.len() > 1)
            .then(|| AuditedError::of([square, error], numbers::whole(patches), tolerance)))
    }

    /// Looks at rows of views, spread over both.
    fn looks(&mut self) -> Result<Vec<Look>> {
        let mut looks = Vec::new();
        let mut seen = HashSet::new();
        if self.simulation.sample.is_empty() {
            return Ok(looks);
        }
        let begin = Instant::now();
        let mut patches = FIRST_PATCHES;
        for number in 0..MOST_LOOKS {
            if number >= LEAST_LOOKS && begin.elapsed().as_secs_f64() > SECONDS {
                break;
            }
            let view = (f64::from(number) * GOLDEN + 0.5).fract() * self.view_count();
            let view = numbers::whole::<u32>(view);
            let shadow = Instant::now();
            let projected_bounds = self.simulation.projected_bounds(view);
            let shadow_seconds = shadow.elapsed().as_secs_f64();
            let all = self.rows_of(&projected_bounds);
            // Rows beside the detector take few rays: they are looked at apart.
            let inner = all.start.max(0)..all.end.min(self.lit_rows_of_all());
            let inner = if inner.is_empty() { all.start..all.start } else { inner };
            let parts = [inner.clone(), all.start..inner.start, inner.end..all.end];
            let block_of = |part: &Range<i64>| {
                let blocks = (part.end - part.start + ROWS - 1) / ROWS;
                numbers::whole::<i64>(radical_inverse(number) * blocks as f64)
            };
            if all.is_empty() || !seen.insert((view, parts.each_ref().map(block_of))) {
                continue;
            }
            let start = (f64::from(number) * GOLDEN).fract();
            let mut cost = RowsCost::default();
            for part in parts.iter().filter(|part| !part.is_empty()) {
                let first = part.start + block_of(part) * ROWS;
                let rows = first..(first + ROWS).min(part.end);
                let share = (part.end - part.start) as f64 / (rows.end - rows.start) as f64;
                let of_rows = self.look(view, &projected_bounds, rows, (patches, start))?;
                cost = cost.and(&of_rows.times(share));
            }
            if cost.sampled > 0.0 {
                let each = (cost.spent / cost.sampled).max(1e-9);
                patches = (SECONDS_OF_A_LOOK / each).clamp(PATCHES[0], PATCHES[1]);
            }
            looks.push(Look { shadow_seconds, cost });
        }
        Ok(looks)
    }

    /// Rows of a view that shadows reach, as far as a run samples them.
    pub(super) fn rows_of(&self, projected_bounds: &[ProjectedBounds]) -> Range<i64> {
        let halo = self.simulation.lattice.halo;
        let top = projected_bounds
            .iter()
            .map(|s| numbers::whole::<i64>(s.rows[0].floor()))
            .min()
            .unwrap_or(0);
        let bottom = projected_bounds
            .iter()
            .map(|s| numbers::whole::<i64>(s.rows[1].floor()) + 1)
            .max()
            .unwrap_or(0);
        let top = top.max(-halo);
        top..bottom.min(self.lit_rows_of_all() + halo).max(top)
    }

    fn look(
        &mut self,
        pose: u32,
        projected_bounds: &[ProjectedBounds],
        rows: Range<i64>,
        chosen: (f64, f64),
    ) -> Result<RowsCost> {
        let band = self.begin_band(rows.start)?;
        let blur_rows = self.simulation.lattice.blur_rows;
        let lit = band.start - blur_rows..band.end + blur_rows;
        let steps = self.steps();
        let left_out = self.steps_left_out();
        let Self { cells, bars, lights, sums, tracer, simulation, .. } = self;
        let exposure = Exposure::Sample(simulation.view_of(pose));
        let response = simulation.response(exposure);
        let mut view = simulation.pose_context(pose, projected_bounds, &response);
        view.budget.audit = 0.0;
        let mut add = |tracer: &mut Tracer, cell_rows: &CellBatch| {
            let gathered = match &simulation.spectral {
                Some(spectral) => Some(spectral.lists(tracer, bars, cell_rows)?),
                None => None,
            };
            let lists = gathered.as_deref().unwrap_or(std::slice::from_ref(cell_rows));
            let begin = Instant::now();
            cells.add(lights.iter().zip(lists), sums, steps)?;
            Ok(left_out * begin.elapsed().as_secs_f64())
        };
        sampling::survey_rows(&view, tracer, rows, &lit, chosen, &mut add)
    }

    /// Seconds that the light of a view without a sample takes: the least of a few, since some rows
    /// stand for all and a pause of the machine would count as often.
    fn blank_seconds(&mut self) -> Result<f64> {
        let band = self.begin_band(0)?;
        let rows = band.start..band.end.min(band.start + TIMED_ROWS);
        let share = self.lit_rows_of_all() as f64 / (rows.end - rows.start).max(1) as f64;
        let mut least = f64::INFINITY;
        for _ in 0..TIMES {
            let begin = Instant::now();
            let mut cell_rows = sampling::empty_cell_rows(&self.simulation.lattice, rows.clone());
            let lists = match &self.simulation.spectral {
                Some(spectral) => {
                    cell_rows.keep_nothing(self.simulation.moment_words());
                    spectral.lists(&mut self.tracer, &mut self.bars, &cell_rows)?
                }
                None => vec![cell_rows],
            };
            let light = Instant::now();
            self.cells.add(self.lights.iter().zip(&lists), &self.sums, self.steps())?;
            let left_out = self.steps_left_out() * light.elapsed().as_secs_f64();
            let seconds = begin.elapsed().as_secs_f64() + left_out;
            least = least.min(seconds);
            if begin.elapsed().as_secs_f64() > SECONDS {
                break;
            }
        }
        Ok(least * share)
    }

    fn random_estimate(&mut self) -> Result<RunEstimate> {
        let all = self.lit_rows_of_all();
        let projected_bounds = self.simulation.projected_bounds(0);
        let middle = all / 2;
        self.begin_band(middle)?;
        let begin = Instant::now();
        let rows = middle..(middle + TIMED_ROWS).min(all);
        let timed = (rows.end - rows.start) as f64;
        // Fewer rays of each pixel where these are many.
        let optics = self.simulation.detector.optics();
        let mut sparse = optics.clone();
        let of_pixel = |optics: &Optics| f64::from(optics.sampling.rays.count());
        let most = TIMED_RAYS / (timed * f64::from(optics.detector.pixels[0]));
        while of_pixel(&sparse) > most.max(1.0) {
            sparse.sampling.rays = sparse.sampling.rays.halved();
        }
        self.random_rows(&sparse, Exposure::Sample(0), &projected_bounds, &rows)?;
        let share = timed / all as f64 * of_pixel(&sparse) / of_pixel(optics);
        let seconds = begin.elapsed().as_secs_f64() / share;
        let pixels = optics.detector.pixels.map(f64::from);
        let rays = pixels[0] * pixels[1] * f64::from(self.simulation.scene.sampling.rays.count());
        let views = self.view_count();
        Ok(RunEstimate {
            rays_per_view: rays,
            rays: rays * views,
            seconds: seconds * (views + 1.0),
            ..RunEstimate::default()
        })
    }
}

/// Van der Corput's sequence in base 2: evenly spread over [0, 1) from the first numbers on.
fn radical_inverse(number: u32) -> f64 {
    f64::from(number.reverse_bits()) / 2_f64.powi(32)
}
