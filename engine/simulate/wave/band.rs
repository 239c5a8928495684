//! Light of a band of rows by lines: the flat of all beamlets, and in patches that the sample touches their own.

use super::kernels::WaveKernels;
use super::lines::Lines;
use super::patch::{Limits, Patch};
use super::plan::WavePlan;
use crate::sampling::{Lattice, ProjectedBounds};
use crate::trace::Tracer;
use beamlet_core::numbers::{self, single};
use beamlet_core::tally::Tally;
use beamlet_core::{Error, Result, reserve};
use beamlet_gpu::Device;
use ndarray::Array3;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;

/// Parts of the open beam that light is counted in.
const UNIT: f64 = 4_294_967_296.0;
/// Patches whose heights are chosen together.
const PATCHES: usize = 1 << 12;
/// Most intervals of a patch before they are cut, besides those at its borders.
const MOST_PARTS: u32 = 25;
/// Share of the tolerance that an estimated error may take.
const TOLERATED: f64 = 0.45;

/// Light of all beamlets without a sample, at a list of mask offsets.
#[derive(Debug)]
struct FlatLight {
    /// `[beamlet][step][pixel]`.
    beamlets: Vec<f32>,
    /// `[step][column]`, in units.
    columns: Vec<i64>,
}

/// Pose of a sample at a list of mask offsets.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WaveView<'a> {
    /// Lattice of the beamlets.
    pub lattice: &'a Lattice,
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
}

/// Sums of light of a band, in integers: they do not depend on the order of terms.
#[derive(Debug)]
pub(crate) struct WaveBand {
    plan: Arc<WavePlan>,
    lines: Lines,
    flats: HashMap<usize, FlatLight>,
    /// `[step][row][column]`, in units.
    sums: Vec<i64>,
    shape: [usize; 3],
    first_row: i64,
}

impl WaveBand {
    /// Room for no band yet.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(crate) fn new(
        device: &Arc<Device>,
        plan: &Arc<WavePlan>,
        kernels: &Arc<WaveKernels>,
        columns: u32,
    ) -> Result<Self> {
        Ok(Self {
            plan: plan.clone(),
            lines: Lines::new(device, plan, kernels)?,
            flats: HashMap::new(),
            sums: Vec::new(),
            shape: [plan.offsets[0].len(), 0, columns as usize],
            first_row: 0,
        })
    }

    /// Begins a band with the light of its rows without a sample.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn begin(&mut self, rows: &Range<u32>, list: usize) -> Result<()> {
        self.know_flat(list)?;
        let (columns, count) = (self.shape[2], (rows.end - rows.start) as usize);
        self.shape[1] = count;
        self.first_row = rows.start.into();
        self.sums = reserve::zeroed(self.shape.iter().product(), "a band of a view")?;
        let flat = &self.flats[&list].columns;
        for (frame, of_step) in self.sums.chunks_mut(count * columns).zip(flat.chunks(columns)) {
            frame.chunks_mut(columns).for_each(|row| row.copy_from_slice(of_step));
        }
        Ok(())
    }

    /// Computes the light without a sample at a list of offsets, unless it is known.
    fn know_flat(&mut self, list: usize) -> Result<()> {
        if self.flats.contains_key(&list) {
            return Ok(());
        }
        let beamlets = self.lines.flat(list)?;
        let [steps, _, columns] = self.shape;
        let mut sums = vec![0_i64; steps * columns];
        let stride = self.plan.most_pixels as usize;
        for (own, (first, count)) in beamlets.chunks(steps * stride).zip(&self.plan.pixels) {
            for (step, values) in own.chunks(stride).enumerate() {
                let from = step * columns + *first as usize;
                let pixels = &mut sums[from..from + *count as usize];
                pixels.iter_mut().zip(values).for_each(|(sum, value)| *sum += units(*value, 1.0));
            }
        }
        self.flats.insert(list, FlatLight { beamlets, columns: sums });
        Ok(())
    }

    /// Puts the light of lines in the place of the flat in the patches of some rows that a shadow touches.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn add_rows(
        &mut self,
        tracer: &mut Tracer,
        view: &WaveView<'_>,
        rows: &Range<i64>,
    ) -> Result<Tally> {
        let touched = self.touched(view, rows);
        let each = self.plan.rays;
        let lines = numbers::length((view.max_rays / each).max(3).into());
        let limits = Limits { tolerance: view.tolerance, lines };
        let mut tally = Tally::default();
        for some in touched.chunks(PATCHES) {
            let parts = |height: f64| {
                let most = f64::from((view.max_rays / each).saturating_sub(2).clamp(1, MOST_PARTS));
                numbers::whole::<u32>((1.0 / height).ceil().clamp(1.0, most))
            };
            let patch = |([row, beamlet], height): &([i64; 2], f64)| {
                Patch::new(*beamlet, *row, parts(*height))
            };
            let mut patches: Vec<Patch> = some.iter().map(patch).collect();
            self.choose_heights(tracer, view, &mut patches, limits)?;
            for patch in &patches {
                self.add_patch(view, patch);
                tally = tally + tally_of(patch, each, view.tolerance);
            }
        }
        Ok(tally)
    }

    /// Rows and beamlets that shadows touch, in order, each with the height that hides no component, rows.
    fn touched(&self, view: &WaveView<'_>, rows: &Range<i64>) -> Vec<([i64; 2], f64)> {
        let mut found = BTreeMap::new();
        let all = &self.plan.beamlets;
        for shadow in view.shadows {
            let [own, beamlets] = shadow.patches(view.lattice);
            for row in own.start.max(rows.start)..own.end.min(rows.end) {
                // Lines reach over the borders of their beamlet.
                for beamlet in (beamlets.start - 1).max(all.start)..(beamlets.end + 1).min(all.end)
                {
                    let height = found.entry([row, beamlet]).or_insert(f64::INFINITY);
                    *height = shadow.height.min(*height);
                }
            }
        }
        found.into_iter().collect()
    }

    fn choose_heights(
        &mut self,
        tracer: &mut Tracer,
        view: &WaveView<'_>,
        patches: &mut [Patch],
        limits: Limits,
    ) -> Result<()> {
        let values = self.lines.values();
        let index = [view.pose, numbers::count(view.list)];
        loop {
            let wanted: Vec<_> = patches.iter().map(Patch::next_lines).collect();
            let all: Vec<_> = wanted.iter().flatten().copied().collect();
            if all.is_empty() {
                return Ok(());
            }
            let light = self.lines.light(tracer, view.lattice, &all, index)?;
            let mut rest = &light[..];
            for (patch, lines) in patches.iter_mut().zip(&wanted).filter(|(_, it)| !it.is_empty()) {
                let (own, after) = rest.split_at(lines.len() * values);
                patch.take(own, values, limits);
                rest = after;
            }
        }
    }

    /// Adds the light of a patch less its flat, blurred over rows.
    fn add_patch(&mut self, view: &WaveView<'_>, patch: &Patch) {
        let [steps, rows, columns] = self.shape;
        let index = numbers::narrow::<usize>(patch.beamlet - self.plan.beamlets.start);
        let (first, count) = self.plan.pixels[index];
        let values = self.lines.values();
        let stride = self.plan.most_pixels as usize;
        let flat = &self.flats[&view.list].beamlets[index * values..][..values];
        let reach = view.lattice.blur_rows;
        for (row, down) in (-reach..=reach).map(|down| (patch.row + down - self.first_row, down)) {
            let Some(row) = usize::try_from(row).ok().filter(|row| *row < rows) else { continue };
            for interval in &patch.intervals {
                let height = interval.height();
                let share =
                    height * view.lattice.share_of_row(interval.ends, self.plan.row_shift, down);
                for step in 0..steps {
                    let from = (step * rows + row) * columns + first as usize;
                    let pixels = &mut self.sums[from..from + count as usize];
                    let own = &interval.light[step * stride..];
                    let flat = &flat[step * stride..];
                    for ((sum, own), flat) in pixels.iter_mut().zip(own).zip(flat) {
                        *sum += units(*own, share) - units(*flat, share);
                    }
                }
            }
        }
    }

    /// The sums as intensities, `[step][row][column]`.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(crate) fn intensities(&self) -> Result<Array3<f32>> {
        let mut values = reserve::zeroed::<f32>(self.sums.len(), "a band of a view")?;
        let pairs = values.iter_mut().zip(&self.sums);
        pairs.for_each(|(value, sum)| *value = single(*sum as f64 / UNIT));
        Array3::from_shape_vec(self.shape, values).map_err(|e| {
            Error::device("sums of light", format!("have the wrong shape: {e}"), "report this")
        })
    }
}

/// A share of light in units.
fn units(light: f32, share: f64) -> i64 {
    numbers::whole((f64::from(light) * share * UNIT).round())
}

/// Counts of a patch.
fn tally_of(patch: &Patch, rays: u32, tolerance: f64) -> Tally {
    let error = patch.error();
    let rays = patch.intervals.len() as u64 * u64::from(rays);
    Tally {
        patches: 1,
        patch_rays: rays,
        most_patch_rays: rays,
        error_squares: numbers::whole((error * 1e9).powi(2)),
        worst_error: numbers::whole(error * 1e9),
        beyond_tolerance: u64::from(error > TOLERATED * tolerance),
        ..Tally::default()
    }
}
