//! Light of a band of rows by lines: the flat of all beamlets, and in patches that the sample touches their own.

use super::kernels::WaveKernels;
use super::lines::{Lines, Patch};
use super::plan::WavePlans;
use super::rows::WaveView;
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result, reserve};
use beamlet_gpu::Device;
use ndarray::Array3;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Parts of the open beam that light is counted in.
const UNIT: f64 = 4_294_967_296.0;
/// Light of all beamlets without a sample, at a list of mask offsets.
#[derive(Debug)]
struct FlatLight {
    /// `[beamlet][step][pixel]` by the frequencies of lines of rays: light of lines is put in its place.
    beamlets: Vec<f32>,
    /// `[step][column]` of all apertures, in units.
    columns: Vec<i64>,
}

/// Sums of light of a band, in integers: they do not depend on the order of terms.
#[derive(Debug)]
pub(crate) struct WaveBand {
    pub(super) lines: Lines,
    /// Lines of half the spacing, for estimates.
    pub(super) finer: Lines,
    without_rays: Lines,
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
        plans: &WavePlans,
        kernels: &Arc<WaveKernels>,
        columns: u32,
    ) -> Result<Self> {
        Ok(Self {
            lines: Lines::new(device, &plans.rays, kernels)?,
            finer: Lines::new(device, &plans.finer, kernels)?,
            without_rays: Lines::new(device, &plans.flat, kernels)?,
            flats: HashMap::new(),
            sums: Vec::new(),
            shape: [plans.rays.offsets[0].len(), 0, columns as usize],
            first_row: 0,
        })
    }

    /// Begins a band with the light of its rows without a sample.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`].
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
        let all = self.without_rays.flat(list)?;
        let [steps, _, columns] = self.shape;
        let mut sums = vec![0_i64; steps * columns];
        let stride = self.lines.plan.most_pixels as usize;
        for (own, (first, count)) in all.chunks(steps * stride).zip(&self.lines.plan.pixels) {
            for (step, values) in own.chunks(stride).enumerate() {
                let from = step * columns + *first as usize;
                let pixels = &mut sums[from..from + *count as usize];
                pixels.iter_mut().zip(values).for_each(|(sum, value)| *sum += units(*value, 1.0));
            }
        }
        self.flats.insert(list, FlatLight { beamlets, columns: sums });
        Ok(())
    }

    /// Adds the light of a patch less its flat, blurred over rows.
    pub(super) fn add_patch(&mut self, view: &WaveView<'_>, patch: &Patch) {
        let [steps, rows, columns] = self.shape;
        let index = numbers::narrow::<usize>(patch.beamlet - self.lines.plan.beamlets.start);
        let (first, count) = self.lines.plan.pixels[index];
        let values = self.lines.values();
        let stride = self.lines.plan.most_pixels as usize;
        let flat = &self.flats[&view.list].beamlets[index * values..][..values];
        let reach = view.image.lattice.blur_rows;
        for (row, down) in (-reach..=reach).map(|down| (patch.row + down - self.first_row, down)) {
            let Some(row) = usize::try_from(row).ok().filter(|row| *row < rows) else { continue };
            let weights = patch.heights.weights(|ends| {
                view.image.lattice.linear_in_row(ends, self.lines.plan.row_shift, down)
            });
            for (line, share) in patch.heights.light().zip(weights) {
                for step in 0..steps {
                    let from = (step * rows + row) * columns + first as usize;
                    let pixels = &mut self.sums[from..from + count as usize];
                    let own = &line.light[step * stride..];
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
