//! Refines the patches of some rows on the device.

use super::buffers::{Buffers, CELL, RECTANGLE, Sizes};
use super::group::{Group, Touched};
use super::kernels::RefineKernels;
use super::tables::{self, Tables};
use crate::sampling::{PatchCost, RowsCost, ViewContext, spread};
use crate::trace::{QUEUE_COUNT, Tracer};
use beamlet_core::numbers::{self, single};
use beamlet_core::tally::Tally;
use beamlet_core::{Error, Result};
use beamlet_gpu::{Buffer, Device, DeviceKind, Download, Recorder, Upload};
use beamlet_interface::{
    HEAD_BASE, HEAD_CELLS, HEAD_EXACT, HEAD_FAR, HEAD_LEFT, HEAD_LISTED, HEAD_LOST, HEAD_NEAR,
    HEAD_PHASE, HEAD_RAYS, HEAD_RECTANGLES, HEAD_ROOM, HEAD_WORDS, PHASE_DONE, PHASE_FULL,
    REPORT_BEYOND, REPORT_LANDED_OFF, REPORT_MOST, REPORT_PATCHES, REPORT_RAYS, REPORT_SQUARES,
    REPORT_WORDS, REPORT_WORST, RefineParams, TALLY_COUNTERS,
};
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Turns of a submission.
const TURNS: u32 = 16;
/// Work of the first submission, rays and rectangles; least and most.
const WORK: [u32; 3] = [1 << 15, 1 << 12, 1 << 28];
/// Submissions are to take about as long.
const TIME: Duration = Duration::from_millis(250);
/// Part of the budget of a patch that the sum of its errors may take, and the same of a patch with one mask step:
/// errors of several do not all have the same sign.
const SHARE: [f64; 2] = [0.45, 0.2];
/// Part of the budget of the displacement.
const DISPLACEMENT_SHARE: f64 = 0.45;
/// Least width of a rectangle, m: coordinates in f32 are as coarse across a detector; and as a share of the period.
const LEAST_WIDTH: f64 = 2e-9;
const LEAST_SHARE: f64 = 2e-5;
/// Least height of a rectangle, rows.
const LEAST_HEIGHT: f32 = 1.0 / 8192.0;
/// Steps of f32 coordinates beside a rectangle, share of the period and of a row.
const BESIDE: f32 = 2.4e-7;
/// Rectangles that there is room for where memory has no limit, and least.
const RECTANGLES: [u64; 2] = [1 << 21, 1 << 14];
/// Cells that are lit at once, and least.
const CELLS: [u64; 2] = [1 << 18, 1 << 12];
/// Rectangles of a group after refinement over those before, as long as none is known.
const GROWTH: f64 = 8.0;
/// Rectangles of the next group over what the last one says.
const SPARE: f64 = 1.5;
/// Most patches of rows that stand for the others when a run is estimated.
const SURVEYED: f64 = 2048.0;
/// Standard deviations that a blur reaches.
const BLURS: f64 = 6.5;

/// Memory of the refinement on the device, bytes; `None` without a limit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RefineRoom(pub(crate) Option<[u64; 2]>);

impl RefineRoom {
    fn rectangles(self) -> u32 {
        let most = self.0.map_or(RECTANGLES[0], |[_, left]| left * 3 / 4 / RECTANGLE);
        numbers::low_word(most.clamp(RECTANGLES[1], RECTANGLES[0]))
    }

    fn cells(self) -> u32 {
        let most = self.0.map_or(CELLS[0], |[_, left]| left / 4 / CELL);
        numbers::low_word(most.clamp(CELLS[1], CELLS[0]))
    }

    /// Room to begin with for this many base rectangles.
    fn first(self, base: u64) -> u32 {
        let wanted = numbers::whole::<u64>(base as f64 * GROWTH).next_power_of_two();
        numbers::low_word(wanted.clamp(RECTANGLES[1], self.rectangles().into()))
    }

    /// More room: as far as groups of patches have it, or for a single patch as far as memory has it.
    fn more(self, places: u32, single: bool) -> Option<u32> {
        let next = places.checked_mul(2)?;
        let bytes = u64::from(next) * RECTANGLE;
        let fits = self.0.is_none_or(|[_, left]| bytes <= left * 3 / 4);
        (next <= self.rectangles() || (single && fits)).then_some(next)
    }
}

/// Cells that are on the device.
#[derive(Debug, Clone)]
pub(crate) struct MadeCells<'b> {
    pub(crate) parts: &'b Buffer,
    pub(crate) cell_rows: &'b Buffer,
    pub(crate) cells: &'b Buffer,
    /// Parts whose light lands near, from the first on.
    pub(crate) near: u32,
    /// Parts whose light lands farther off.
    pub(crate) far: Range<u32>,
}

/// Takes cells as they are made.
pub(crate) type Light<'a> = &'a mut dyn FnMut(&MadeCells<'_>) -> Result<()>;

/// Counts of refinement, besides light.
#[derive(Debug, Default)]
pub(crate) struct Refined {
    pub(crate) tally: Tally,
    /// Cells whose light lands too far off to follow.
    pub(crate) landed_off: u64,
}

/// How a group ended.
enum Outcome {
    Done(Refined),
    /// There was no room for all of its rectangles.
    Full,
}

/// Refines patches on the device.
#[derive(Debug)]
pub(crate) struct DeviceRefiner {
    device: Arc<Device>,
    kernels: Arc<RefineKernels>,
    buffers: Option<Buffers>,
    /// With the list of mask offsets that they are for.
    tables: Option<(usize, Tables)>,
    /// Work of a submission.
    work: u32,
    /// Rectangles over base rectangles, of the groups so far.
    growth: f64,
}

impl DeviceRefiner {
    pub(crate) fn new(device: &Arc<Device>, kernels: &Arc<RefineKernels>) -> Self {
        let is_cpu = device.description().kind == DeviceKind::Cpu;
        Self {
            device: device.clone(),
            kernels: kernels.clone(),
            buffers: None,
            tables: None,
            work: if is_cpu { WORK[0] } else { WORK[0] << 6 },
            growth: GROWTH,
        }
    }

    /// Refines the patches of rows that a shadow touches, and hands their cells to `light`. `list`: index of the
    /// mask offsets of the view; `lit`: rows whose light is wanted. Returns the beamlets and rows that no
    /// shadow touches, too.
    ///
    /// # Errors
    /// As [`Tracer::trace`]; [`Error::Memory`] where one patch has no room; errors of `light`.
    pub(crate) fn refine(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (list, room): (usize, RefineRoom),
        (rows, lit): (&Range<i64>, &Range<i64>),
        light: Light<'_>,
        advance: &mut dyn FnMut(&Tracer, f64),
    ) -> Result<(Refined, Vec<(i64, i64)>)> {
        if self.tables.as_ref().is_none_or(|(known, _)| *known != list) {
            self.tables = Some((list, Tables::new(&self.device, view)?));
        }
        let touched = Touched::new(view, rows);
        let patches = touched.of_rows(rows);
        let all = self.patches(view, tracer, (&touched, room), (&patches, lit), light, advance)?;
        let direct = &view.lattice.direct;
        let places = rows
            .clone()
            .filter(|row| lit.contains(row))
            .flat_map(|row| direct.clone().map(move |beamlet| (beamlet, row)));
        let first = view.lattice.beamlets.start;
        let missed =
            places.filter(|at| !touched.has(at)).map(|(beamlet, row)| (beamlet - first, row));
        Ok((all, missed.collect()))
    }

    /// Refines some patches of rows, evenly spread from the share `start` of their distance on, and returns what all
    /// of them cost; `light` returns the seconds that a run takes for cells beyond those that it took.
    ///
    /// # Errors
    /// As [`Self::refine`].
    pub(crate) fn survey(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        room: RefineRoom,
        (rows, lit, start): (&Range<i64>, &Range<i64>, f64),
        light: &mut dyn FnMut(&MadeCells<'_>) -> Result<f64>,
    ) -> Result<RowsCost> {
        if self.tables.as_ref().is_none_or(|(known, _)| *known != 0) {
            self.tables = Some((0, Tables::new(&self.device, view)?));
        }
        let touched = Touched::new(view, rows);
        let patches = touched.of_rows(rows);
        let chosen = spread(&patches, SURVEYED, start);
        let base: u64 = patches.iter().map(|at| u64::from(touched.base_of(at))).sum();
        let (begin, before) = (Instant::now(), tracer.rays_traced());
        let mut beyond = 0.0;
        let mut take = |made: &MadeCells<'_>| {
            beyond += light(made)?;
            Ok(())
        };
        let (from, some) = ((&touched, room), (&chosen[..], lit));
        self.patches(view, tracer, from, some, &mut take, &mut |_, _| {})?;
        let traced = (tracer.rays_traced() - before) as f64;
        let own: u64 = chosen.iter().map(|at| u64::from(touched.base_of(at))).sum();
        let rows = (rows.end - rows.start) as f64;
        let kind = PatchCost {
            patches: patches.len() as f64,
            refined: chosen.len() as f64,
            rays: traced - own as f64,
            splits: 0.0,
            seconds: begin.elapsed().as_secs_f64() + beyond,
        };
        // Base rays count with a row on either side.
        let base_rays = base as f64 * (rows + 2.0) / rows.max(1.0);
        let kinds = [kind, PatchCost::default()];
        Ok(RowsCost { rows, base_rays, base_seconds: 0.0, facet_seconds: 0.0, kinds })
    }

    /// Refines patches in groups that there is room for.
    fn patches(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (touched, room): (&Touched, RefineRoom),
        (patches, lit): (&[(i64, i64)], &Range<i64>),
        light: Light<'_>,
        advance: &mut dyn FnMut(&Tracer, f64),
    ) -> Result<Refined> {
        let mut all = Refined::default();
        let mut rest = patches;
        let mut most = usize::MAX;
        let base = patches.iter().map(|at| u64::from(touched.base_of(at))).sum();
        let mut places = room.first(base).max(self.buffers.as_ref().map_or(0, |it| it.sizes.room));
        while !rest.is_empty() {
            let budget = f64::from(places) / self.growth;
            let mut base = 0.0;
            let fits = |at: &&(i64, i64)| {
                base += f64::from(touched.base_of(at));
                base <= budget
            };
            let count = rest.iter().take_while(fits).count().clamp(1, most);
            let (some, after) = rest.split_at(count.min(rest.len()));
            let group = touched.group(view, some, lit);
            match self.group(view, tracer, (&group, places, room), (lit, light))? {
                Outcome::Done(refined) => {
                    all.tally = all.tally + refined.tally;
                    all.landed_off += refined.landed_off;
                    rest = after;
                    most = usize::MAX;
                    let done = patches.len() - rest.len();
                    advance(tracer, done as f64 / patches.len() as f64);
                }
                Outcome::Full => match room.more(places, some.len() == 1) {
                    Some(more) => places = more,
                    None if some.len() > 1 => most = some.len() / 2,
                    None => return Err(too_small(some[0], places, room)),
                },
            }
        }
        Ok(all)
    }

    /// Refines a group of patches.
    fn group(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (group, places, room): (&Group, u32, RefineRoom),
        (lit, light): (&Range<i64>, Light<'_>),
    ) -> Result<Outcome> {
        if group.all_base > places {
            return Ok(Outcome::Full);
        }
        let steps = numbers::count(view.response.steps());
        let rows = tables::rows(view, group.rows());
        let sums = Sizes::sums_of_patch(steps) * group.patches.len() as u64;
        let sizes = Sizes {
            room: places,
            cells: room.cells(),
            patches: numbers::count(group.patches.len()),
            rows: numbers::count(rows.len()),
            sums,
        };
        let buffers = Buffers::fit(&self.device, self.buffers.take(), sizes)?;
        let kernels = self.kernels.clone();
        let stages = kernels.made()?;
        let made = tracer.made_rays()?;
        let Some((_, tables)) = &self.tables else { return Ok(Outcome::Full) };
        let params = [RefineParams {
            patch_count: group.own,
            all_patches: numbers::count(group.patches.len()),
            own_base: group.own_base,
            all_base: group.all_base,
            rays_of_group: made.rays_of_group,
            queue_count: QUEUE_COUNT,
            steps,
            first_row: group.rows().start,
            wanted: [lit.start, lit.end].map(numbers::narrow::<i32>),
            ..params_of(view, tables, buffers.params(tracer))
        }];
        let mut head = [0_u32; HEAD_WORDS as usize];
        head[HEAD_RECTANGLES as usize] = group.all_base;
        head[HEAD_LISTED as usize] = group.own_base;
        head[HEAD_RAYS as usize] = group.own_base;
        let mut told = [0_u32; REPORT_WORDS as usize];
        let mut tally = [0_u32; TALLY_COUNTERS];
        let mut is_first = true;
        loop {
            tracer.cancel().check()?;
            head[HEAD_ROOM as usize] = self.work;
            for word in [HEAD_NEAR, HEAD_FAR, HEAD_CELLS] {
                head[word as usize] = 0;
            }
            let sent = head;
            let mut uploads = vec![Upload::new(&buffers.head, 0, &sent)];
            if is_first {
                uploads.push(Upload::new(&buffers.params, 0, &params));
                uploads.push(Upload::new(&buffers.patches, 0, &group.patches));
                uploads.push(Upload::new(&buffers.rows, 0, &rows));
            }
            let record = |r: &mut Recorder<'_>| {
                if is_first {
                    r.fill(&buffers.sums, 0, 4 * sums, 0);
                    r.fill(&buffers.told, 0, u64::from(REPORT_WORDS) * 4, 0);
                    r.fill(tracer.queues(), 0, tracer.queues().len(), 0);
                }
                for _ in 0..TURNS {
                    let params = buffers.params.address();
                    stages.record_turn(r, (params, &buffers.head), tracer, &made);
                }
            };
            let mut downloads = [
                Download::new(&buffers.head, 0, &mut head),
                Download::new(&buffers.told, 0, &mut told),
                tracer.read_tally(&mut tally),
            ];
            let time = self.device.run_with(&uploads, record, &mut downloads)?;
            is_first = false;
            self.adapt(time, self.work - head[HEAD_ROOM as usize]);
            let at = |word: u32| head[word as usize];
            if at(HEAD_NEAR) + at(HEAD_FAR) > 0 {
                light(&MadeCells {
                    parts: &buffers.parts,
                    cell_rows: &buffers.cell_rows,
                    cells: &buffers.cells,
                    near: at(HEAD_NEAR),
                    far: sizes.cells..sizes.cells + at(HEAD_FAR),
                })?;
            }
            match at(HEAD_PHASE) {
                PHASE_FULL | PHASE_DONE => break,
                _ => {}
            }
        }
        let at = |word: u32| head[word as usize];
        let is_full = at(HEAD_PHASE) == PHASE_FULL;
        let rays = if is_full { at(HEAD_BASE) } else { at(HEAD_RAYS) };
        tracer.count_made(&tally, [rays, at(HEAD_EXACT), at(HEAD_LEFT) + at(HEAD_LOST)]);
        let growth = f64::from(at(HEAD_RECTANGLES)) / f64::from(group.own_base.max(1));
        self.growth = if is_full {
            2.0 * self.growth.max(growth)
        } else {
            0.5 * (self.growth + SPARE * growth)
        };
        self.buffers = Some(buffers);
        Ok(if is_full { Outcome::Full } else { Outcome::Done(refined(&told, at(HEAD_RAYS))) })
    }

    /// More work for the next submission after a short one that did all of its work, less after a long one.
    fn adapt(&mut self, time: Duration, done: u32) {
        if time > TIME {
            self.work = (self.work / 2).max(WORK[1]);
        } else if time < TIME / 3 && done > self.work / 2 {
            self.work = (self.work * 2).min(WORK[2]);
        }
    }
}

fn too_small((beamlet, row): (i64, i64), places: u32, room: RefineRoom) -> Error {
    let [limit, left] = room.0.unwrap_or([u64::MAX; 2]);
    let needed = (2 * u64::from(places) * RECTANGLE).saturating_mul(4) / 3;
    Error::Memory {
        purpose: format!("refining beamlet {beamlet}, row {row} ({places} rectangles),"),
        needed: (limit - left).saturating_add(needed),
        available: Some(limit),
        remedy: "raise the memory limit or sampling.tolerance, or lower sampling.max_rays".into(),
    }
}

/// Counts of a group.
fn refined(told: &[u32; REPORT_WORDS as usize], rays: u32) -> Refined {
    let at = |word: u32| u64::from(told[word as usize]);
    let pair = |word: u32| at(word) | at(word + 1) << 32;
    let base = pair(REPORT_RAYS).min(rays.into());
    Refined {
        tally: Tally {
            patches: at(REPORT_PATCHES),
            patch_rays: base,
            most_patch_rays: at(REPORT_MOST),
            error_squares: pair(REPORT_SQUARES),
            worst_error: at(REPORT_WORST),
            beyond_tolerance: at(REPORT_BEYOND),
            ..Tally::default()
        },
        landed_off: at(REPORT_LANDED_OFF),
    }
}

/// Parameters that follow from the set-up.
fn params_of(view: &ViewContext<'_>, tables: &Tables, of: RefineParams) -> RefineParams {
    let (optics, lattice, response) = (view.optics, view.lattice, view.response);
    let (detector, budget) = (&optics.detector, &view.budget);
    let period = single(lattice.period);
    let share = if response.steps() == 1 { SHARE[1] } else { SHARE[0] };
    let least = (LEAST_SHARE * lattice.period).min(LEAST_WIDTH);
    let recorded = view.recorded_rows();
    let at_analyser = optics.analyser / detector.distance;
    let half = 0.5 * detector.extent(0) * at_analyser + BLURS * f64::from(response.blur);
    RefineParams {
        columns: tables.columns.address(),
        openings: tables.openings.address(),
        opening_count: tables.opening_count,
        windows: tables.windows.address(),
        window_count: tables.window_count,
        pose: view.pose,
        max_rays: budget.max_rays,
        recorded: [recorded.start, recorded.end].map(numbers::narrow::<i32>),
        halo: lattice.halo as f32,
        period,
        inverse_plane: single(1.0 / lattice.plane),
        rotation: single(optics.rotation),
        row_slope: single(-detector.row_slope()),
        magnification: response.magnification,
        analyser: single(optics.analyser),
        half_width: single(half + optics.analyser_pixel()),
        gap: single(optics.gap()),
        ratio: single(at_analyser),
        row_pitch: single(detector.pitch[1]),
        row_height: single(detector.pitch_at(1, lattice.plane)),
        row_blur: single(lattice.row_blur()),
        weight: response.weight,
        leak: response.leak,
        steepest: single(response.steepest()),
        light_budget: single(share * budget.light),
        displacement_budget: match budget.displacement.is_finite() {
            true => single(DISPLACEMENT_SHARE * budget.displacement),
            false => 0.0,
        },
        open_width: tables.open_width,
        least: [single(least), LEAST_HEIGHT],
        beside: [BESIDE * period, BESIDE],
        reported: single(1e9 * share * budget.light / budget.by_grid),
        tolerance: numbers::whole::<u32>(1e9 * budget.tolerance),
        ..of
    }
}
