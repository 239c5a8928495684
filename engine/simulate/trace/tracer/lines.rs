//! Moments of rays that stay on the device.

use super::{Tracer, Wanted};
use beamlet_core::{Result, numbers};
use beamlet_gpu::Upload;
use beamlet_interface::{MOMENTS_HEAD, Ray};
use std::sync::atomic::Ordering;

impl Tracer {
    /// Traces at most a batch of rays and leaves their moments in [`Self::moments`]; `take` uses them before the
    /// batch may change its size.
    ///
    /// # Errors
    /// As [`Tracer::trace`]; errors of `take`.
    pub(crate) fn with_moments_on_device(
        &mut self,
        rays: &[Ray],
        take: impl FnOnce(&Self) -> Result<()>,
    ) -> Result<()> {
        self.cancel.check()?;
        let count = numbers::count(rays.len());
        let uploads = [Upload::new(&self.batch.rays, 0, rays)];
        let job = self.job(count, Wanted::Moments, true)?;
        let time = self.run_job(&job, (&uploads, &|_| ()), (&mut [], &mut []))?;
        self.counts.rays.fetch_add(count.into(), Ordering::Relaxed);
        take(self)?;
        self.adapt(rays.len(), time)
    }

    /// Words of the moments of a ray with their head.
    pub(crate) fn moment_stride(&self) -> u32 {
        numbers::count(MOMENTS_HEAD + self.moment_words())
    }
}
