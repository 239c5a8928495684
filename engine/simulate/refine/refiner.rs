//! Refines the patches of some rows on the device.

use super::buffers::{Buffers, Sizes};
use super::group::{Group, Touched};
use super::group_run::{GroupInputs, GroupRun, MadeCells, Refined};
use super::kernels::{CellMaker, RefineKernels};
use super::params;
use super::room::{GROWTH, RefineRoom};
use super::spectrum::Spectrum;
use super::tables::Tables;
use crate::illuminate::EnergyBinning;
use crate::sampling::{PatchCost, RowsCost, ViewContext, spread};
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Device, DeviceKind, Pace};
use beamlet_interface::RefinedLeaf;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Work of the first submission, rays and rectangles; least and most.
const WORK: [u32; 3] = [1 << 15, 1 << 12, 1 << 28];
/// Longer submissions are cut: a stop acts between two.
const LONG: Duration = Duration::from_millis(250);
/// Rectangles of the next group over what the last one says.
const SPARE: f64 = 1.5;
/// Most patches of some rows that an estimate of a run refines.
const SURVEYED: f64 = 2048.0;

/// Taker of the results of refinement, by the maker of the cells.
pub(crate) enum Take<'a> {
    /// Takes cells of the device as they are made.
    Cells(&'a mut dyn FnMut(&MadeCells<'_>) -> Result<()>),
    /// Takes all rectangles of a group of patches, in any order; the host makes the cells.
    Leaves(&'a mut dyn FnMut(&mut Tracer, Vec<RefinedLeaf>) -> Result<()>),
}

/// Refines patches on the device.
#[derive(Debug)]
pub(crate) struct DeviceRefiner<'s> {
    device: Arc<Device>,
    kernels: Arc<RefineKernels>,
    maker: CellMaker,
    buffers: Option<Buffers>,
    /// Tables, and the index of the mask offsets that they are for.
    tables: Option<(usize, Tables)>,
    /// Energies, under a spectrum.
    spectrum: Option<Spectrum<'s>>,
    /// Work of a submission.
    work: Pace,
    /// Rectangles over base rectangles, of the groups so far.
    growth: f64,
}

impl<'s> DeviceRefiner<'s> {
    /// A refiner; `energies`: of a spectrum whose cells the device makes.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`].
    pub(crate) fn new(
        device: &Arc<Device>,
        kernels: &Arc<RefineKernels>,
        (maker, energies): (CellMaker, Option<&'s EnergyBinning>),
    ) -> Result<Self> {
        let is_cpu = device.description().kind == DeviceKind::Cpu;
        Ok(Self {
            device: device.clone(),
            kernels: kernels.clone(),
            maker,
            buffers: None,
            tables: None,
            spectrum: energies
                .filter(|_| maker == CellMaker::Spectrum)
                .map(|energies| Spectrum::new(device, energies))
                .transpose()?,
            work: Pace::new(WORK[0] << if is_cpu { 0 } else { 6 }, WORK[1], WORK[2])
                .with_long(LONG),
            growth: GROWTH,
        })
    }

    /// Maker of the cells.
    pub(crate) const fn maker(&self) -> CellMaker {
        self.maker
    }

    /// Refines the patches of rows that a shadow touches, and hands the results to `take`. `list`: index of the
    /// mask offsets of the view; `lit`: rows whose light is wanted. Returns the beamlets and rows that no
    /// shadow touches, too.
    ///
    /// # Errors
    /// As [`Tracer::trace`]; [`beamlet_core::Error::Memory`] where one patch has no room; errors of `take`.
    pub(crate) fn refine(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (list, room): (usize, RefineRoom),
        (rows, lit): (&Range<i64>, &Range<i64>),
        take: &mut Take<'_>,
        advance: &mut dyn FnMut(&Tracer, f64),
    ) -> Result<(Refined, Vec<(i64, i64)>)> {
        self.take_tables(view, list)?;
        let touched = Touched::new(view, rows);
        let patches = touched.of_rows(rows);
        let all = self.patches(view, tracer, (&touched, room), (&patches, lit), take, advance)?;
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

    /// Refines some patches of rows, evenly spread from the share `start` of their distance on, and returns the cost
    /// of all.
    ///
    /// # Errors
    /// As [`Self::refine`].
    pub(crate) fn survey(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (list, room): (usize, RefineRoom),
        (rows, lit, start): (&Range<i64>, &Range<i64>, f64),
        take: &mut Take<'_>,
    ) -> Result<RowsCost> {
        self.take_tables(view, list)?;
        let touched = Touched::new(view, rows);
        let patches = touched.of_rows(rows);
        let chosen = spread(&patches, SURVEYED, start);
        let base: u64 = patches.iter().map(|at| u64::from(touched.base_of(at))).sum();
        let (begin, before) = (Instant::now(), tracer.rays_traced());
        let (from, some) = ((&touched, room), (&chosen[..], lit));
        self.patches(view, tracer, from, some, take, &mut |_, _| {})?;
        let traced = (tracer.rays_traced() - before) as f64;
        let own: u64 = chosen.iter().map(|at| u64::from(touched.base_of(at))).sum();
        let rows = (rows.end - rows.start) as f64;
        let kind = PatchCost {
            patches: patches.len() as f64,
            refined: chosen.len() as f64,
            rays: traced - own as f64,
            splits: 0.0,
            seconds: begin.elapsed().as_secs_f64(),
        };
        // Base rays count with a row on either side.
        let base_rays = base as f64 * (rows + 2.0) / rows.max(1.0);
        let kinds = [kind, PatchCost::default()];
        Ok(RowsCost { rows, base_rays, base_seconds: 0.0, facet_seconds: 0.0, kinds })
    }

    /// Has the tables of a view with these mask offsets.
    fn take_tables(&mut self, view: &ViewContext<'_>, list: usize) -> Result<()> {
        if self.tables.as_ref().is_none_or(|(known, _)| *known != list) {
            self.tables = Some((list, Tables::new(&self.device, view)?));
        }
        Ok(())
    }

    /// Refines patches in groups that there is room for.
    fn patches(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (touched, room): (&Touched, RefineRoom),
        (patches, lit): (&[(i64, i64)], &Range<i64>),
        take: &mut Take<'_>,
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
            match self.group(view, tracer, (&group, places, room), (lit, take))? {
                Some(refined) => {
                    all.tally = all.tally + refined.tally;
                    all.landed_off += refined.landed_off;
                    rest = after;
                    most = usize::MAX;
                    let done = patches.len() - rest.len();
                    advance(tracer, done as f64 / patches.len() as f64);
                }
                None => match room.more(places, some.len() == 1) {
                    Some(more) => places = more,
                    None if some.len() > 1 => most = some.len() / 2,
                    None => return Err(room.too_small(some[0], places)),
                },
            }
        }
        Ok(all)
    }

    /// Refines a group of patches; nothing where there is no room for all of its rectangles.
    fn group(
        &mut self,
        view: &ViewContext<'_>,
        tracer: &mut Tracer,
        (group, places, room): (&Group, u32, RefineRoom),
        (lit, take): (&Range<i64>, &mut Take<'_>),
    ) -> Result<Option<Refined>> {
        let Some((_, tables)) = self.tables.as_ref().filter(|_| group.all_base <= places) else {
            return Ok(None);
        };
        let rows = tables.rows(view, group.rows());
        let sums = params::sums_of(view, group);
        let sizes = Sizes {
            room: places,
            cells: room.cells(),
            patches: numbers::count(group.patches.len()),
            rows: numbers::count(rows.len()),
            walls: numbers::count(group.walls.len()),
            sums,
            spectrum: self.spectrum.as_ref().map(Spectrum::sizes),
            leaves: self.maker == CellMaker::Host,
        };
        let buffers = Buffers::fit(&self.device, self.buffers.take(), sizes)?;
        let kernels = self.kernels.clone();
        if let Some(spectrum) = &mut self.spectrum {
            spectrum.take(&self.device, (&buffers, tracer), group)?;
        }
        let spectrum = self.spectrum.as_ref();
        let stages = kernels.made(self.maker)?;
        let made = tracer.made_rays(spectrum.is_some())?;
        let of = (tables, &buffers, &*tracer);
        let energies = spectrum.map_or(0, Spectrum::address);
        let params = [params::of_group(view, of, (group, lit), (made.rays_of_group, energies))];
        let merged = buffers.sizes.merged_bytes(group.patches.len());
        let inputs = GroupInputs { group, params, rows, sums, merged };
        let mut run = GroupRun::new(&buffers, spectrum, group);
        let mut leaves = Vec::new();
        while !run.is_over() {
            tracer.cancel().check()?;
            let with = (&stages, &*tracer, &made);
            let (time, done) = run.submit(&self.device, &inputs, with, self.work.size())?;
            // One that ended for want of work says little.
            if done > self.work.size() / 2 || time > LONG {
                self.work.adapt(time);
            }
            let Take::Cells(light) = &mut *take else {
                run.add_leaves(&self.device, &mut leaves)?;
                continue;
            };
            let repeated = run.repeated(&self.device)?;
            let again = match spectrum.filter(|_| !repeated.is_empty()) {
                Some(spectrum) => spectrum.repeat(tracer, view.pose, &repeated)?,
                None => Vec::new(),
            };
            run.cells(again).map_or(Ok(()), |cells| light(&cells))?;
        }
        let refined = run.finish(tracer);
        let growth = f64::from(run.rectangles()) / f64::from(group.own_base.max(1));
        let is_full = run.is_full();
        if let Some(spectrum) = &mut self.spectrum {
            spectrum.is_sent();
        }
        self.growth = match is_full {
            true => 2.0 * self.growth.max(growth),
            false => 0.5 * (self.growth + SPARE * growth),
        };
        self.buffers = Some(buffers);
        if let Take::Leaves(take) = take
            && !is_full
        {
            take(tracer, leaves)?;
        }
        Ok((!is_full).then_some(refined))
    }
}
