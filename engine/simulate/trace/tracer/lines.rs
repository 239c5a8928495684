//! Moments of rays that stay on the device.

use super::{Tracer, Wanted};
use beamlet_core::{Result, numbers, reserve};
use beamlet_gpu::{Buffer, Download, Upload};
use beamlet_interface::{FLAG_GRAZING, KIND_SCATTERING, MOMENTS_FLAGS, MOMENTS_HEAD, Ray};
use std::sync::atomic::Ordering;

impl Tracer {
    /// Traces at most a batch of rays and leaves their moments in [`Self::moments`]; `take` uses them before
    /// the next batch. Indices of the rays that cross a surface near grazing, in order.
    ///
    /// # Errors
    /// As [`Tracer::trace`]; errors of `take`.
    pub(crate) fn with_moments_on_device(
        &mut self,
        rays: &[Ray],
        take: impl FnOnce(&Self) -> Result<()>,
    ) -> Result<Vec<usize>> {
        self.cancel.check()?;
        let count = numbers::count(rays.len());
        let uploads = [Upload::new(&self.batch.rays, 0, rays)];
        let job = self.job(count, Wanted::Moments, true)?;
        let (time, flagged) = self.run_job(&job, (&uploads, &|_| ()), (&mut [], &mut []))?;
        self.counts.rays.fetch_add(count.into(), Ordering::Relaxed);
        take(self)?;
        let flagged = if flagged > 0 { self.flagged(rays.len())? } else { Vec::new() };
        self.adapt(rays.len(), time);
        Ok(flagged)
    }

    /// Moments of the rays, `[ray][MOMENTS_HEAD + word]`.
    pub(crate) const fn moments(&self) -> &Buffer {
        &self.batch.moments
    }

    /// Rays near grazing among the first of the batch, by their moments: of one queue each backend has a part.
    fn flagged(&self, count: usize) -> Result<Vec<usize>> {
        let stride = self.moment_stride() as usize;
        let mut words = reserve::zeroed::<u32>(count * stride, "moments of rays")?;
        self.device.read(&mut [Download::new(&self.batch.moments, 0, &mut words)])?;
        let flags = words.chunks_exact(stride).map(|ray| ray[MOMENTS_FLAGS]);
        let flagged = flags.enumerate().filter(|(_, flags)| flags & FLAG_GRAZING != 0);
        Ok(flagged.map(|(index, _)| index).collect())
    }

    /// Words of the moments of a ray that hold scattering, the last ones.
    pub(crate) fn scattering_words(&self) -> u32 {
        if self.sample.kinds & KIND_SCATTERING != 0 { self.sample.materials } else { 0 }
    }

    /// Words of the moments of a ray with their head.
    pub(crate) fn moment_stride(&self) -> u32 {
        numbers::count(MOMENTS_HEAD + self.moment_words())
    }
}
