//! Sums of light of a band of rows: 64-bit fixed point on the device, f32 on the host.

use beamlet_core::numbers::single;
use beamlet_core::{Error, Result, reserve};
use beamlet_gpu::{Buffer, Device, Download, Memory, Upload};
use ndarray::Array3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Sums read and converted at a time.
const PART: usize = 1 << 20;

/// Sums of a band, `[step][row][column]`, and behind the last step the sums of light that is the same at
/// every step.
#[derive(Debug)]
pub struct PixelSums {
    /// Two words per pixel and step.
    pub buffer: Buffer,
    device: Arc<Device>,
    shape: [usize; 3],
}

impl PixelSums {
    /// Room for a band.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub(crate) fn new(
        device: &Arc<Device>,
        steps: usize,
        rows: usize,
        columns: usize,
    ) -> Result<Self> {
        let bytes = (steps as u64 + 1) * rows as u64 * columns as u64 * 8;
        let buffer = device.buffer("sums of light", bytes, Memory::Device)?;
        Ok(Self { buffer, device: device.clone(), shape: [steps, rows, columns] })
    }

    /// Pixels of a band.
    const fn frame(&self) -> usize {
        self.shape[1] * self.shape[2]
    }

    /// Sets all sums of a band of `rows` rows to zero, in the submission that takes `uploads` along.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn clear(&mut self, rows: &Range<u32>, uploads: &[Upload<'_>]) -> Result<()> {
        self.shape[1] = (rows.end - rows.start) as usize;
        let bytes = (self.shape[0] as u64 + 1) * self.frame() as u64 * 8;
        self.device.run_with(uploads, |r| r.fill(&self.buffer, 0, bytes, 0), &mut [])?;
        Ok(())
    }

    /// The sums as intensities, `[step][row][column]`.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn intensities(&self) -> Result<Array3<f32>> {
        let whole = |[low, high]: [u32; 2]| u64::from(high) << 32 | u64::from(low);
        let mut values = reserve::zeroed::<f32>(self.shape.iter().product(), "a band of a view")?;
        let mut every_step = vec![[0_u32; 2]; self.frame()];
        let behind = 8 * values.len() as u64;
        let mut words = reserve::zeroed::<[u32; 2]>(values.len().min(PART), "a part of a band")?;
        let mut first = 0;
        for part in values.chunks_mut(PART) {
            let words = &mut words[..part.len()];
            let part_of_step = if first == 0 { &mut every_step[..] } else { &mut [] };
            self.device.read(&mut [
                Download::new(&self.buffer, 8 * first as u64, words),
                Download::new(&self.buffer, behind, part_of_step),
            ])?;
            let every_step = |index: usize| whole(every_step[index % self.frame()]);
            part.par_iter_mut().zip(words).enumerate().for_each(|(index, (value, words))| {
                // Terms may be negative, in two's complement; a sum is so by rounding alone.
                let sum = whole(*words).wrapping_add(every_step(first + index));
                let sum = sum.cast_signed().max(0);
                let (high, low) = (sum >> 32, sum & 0xffff_ffff);
                *value = single(high as f64 + low as f64 / 4_294_967_296.0);
            });
            first += PART;
        }
        Array3::from_shape_vec(self.shape, values).map_err(|e| {
            Error::device("sums of light", format!("have the wrong shape: {e}"), "report this")
        })
    }
}
