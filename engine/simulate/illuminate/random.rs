//! The random scheme: rays made, traced and illuminated on the device.

use super::light::IlluminationBuffer;
use super::sums::PixelSums;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Device, LazyKernel, Memory, Recorder, Upload, push_bytes};
use beamlet_interface::{GROUP, Pixel, RandomLightPush, RandomRaysPush};
use beamlet_model::optics::Optics;
use beamlet_model::scene::RandomRays;
use std::sync::Arc;

/// Kernels of the random scheme, each made when it is first wanted.
#[derive(Debug)]
pub(crate) struct RandomKernels {
    rays: LazyKernel,
    light: LazyKernel,
}

impl RandomKernels {
    /// Kernels of a device.
    #[must_use]
    pub(crate) fn new(device: &Arc<Device>) -> Self {
        let (rays, light) = (push_bytes::<RandomRaysPush>(), push_bytes::<RandomLightPush>());
        Self {
            rays: LazyKernel::new(device, "random_rays", rays),
            light: LazyKernel::new(device, "random_light", light),
        }
    }

    /// All of them.
    pub(crate) const fn all(&self) -> [&LazyKernel; 2] {
        [&self.rays, &self.light]
    }
}

/// Rays that one call casts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RandomBatch<'a> {
    /// Pixels, inside the detector or beside it.
    pub pixels: &'a [Pixel],
    /// Index of the pose among the poses of all views.
    pub pose: u32,
    /// All rays of these pixels miss the sample.
    pub empty: bool,
}

/// Casts the random rays of the pixels and adds their light to the sums.
///
/// # Errors
/// [`beamlet_core::Error::Memory`], [`beamlet_core::Error::Device`].
pub(crate) fn illuminate_random(
    device: &Arc<Device>,
    kernels: &RandomKernels,
    optics: &Optics,
    tracer: &mut Tracer,
    light: &IlluminationBuffer,
    sums: &PixelSums,
    job: RandomBatch<'_>,
) -> Result<()> {
    let (rays_kernel, light_kernel) = (kernels.rays.get()?, kernels.light.get()?);
    let all = optics.sampling.rays.count();
    let rays_per_pixel = match optics.sampling.rays {
        RandomRays::Count(count) => [count, 0],
        RandomRays::Grid(grid) => grid,
    };
    let seed = [numbers::low_word(optics.sampling.seed), numbers::high_word(optics.sampling.seed)];
    let steps = numbers::count(optics.mask_steps());
    let capacity = tracer.capacity();
    let at_once = (capacity / all.min(capacity)).max(1);
    let most = job.pixels.len().min(at_once as usize);
    let buffer = device.buffer("pixels", (most * size_of::<Pixel>()) as u64, Memory::Device)?;
    for pixels in job.pixels.chunks(at_once as usize) {
        // The first submission takes them along.
        let mut uploads = &[Upload::new(&buffer, 0, pixels)][..];
        let pixel_count = numbers::count(pixels.len());
        let mut first_ray = 0;
        while first_ray < all {
            tracer.cancel().check()?;
            let batch = (all - first_ray).min(capacity / pixel_count);
            if !job.empty {
                let push = RandomRaysPush {
                    light_ref: light.address(),
                    pixels: buffer.address(),
                    rays: tracer.rays().address(),
                    seed,
                    rays_per_pixel,
                    first_ray,
                    batch,
                    pixel_count,
                    pose: job.pose,
                };
                let groups = (pixel_count * batch).div_ceil(GROUP);
                let record = |r: &mut Recorder<'_>| {
                    r.dispatch(rays_kernel, bytemuck::bytes_of(&push), [groups, 1, 1]);
                };
                device.run_with(uploads, record, &mut [])?;
                uploads = &[];
                tracer.trace_on_device(pixel_count * batch)?;
            }
            let mut push = RandomLightPush {
                light_ref: light.address(),
                pixels: buffer.address(),
                results: tracer.results().address(),
                sums: sums.buffer.address(),
                seed,
                rays_per_pixel,
                first_ray,
                batch,
                pixel_count,
                pose: job.pose,
                empty: job.empty.into(),
                first_step: 0,
            };
            let record = |r: &mut Recorder<'_>| {
                while push.first_step < steps {
                    // A few steps at a time keep dispatches short; each has sums of its own.
                    let n = (steps - push.first_step).min(16);
                    let groups = [pixel_count.div_ceil(GROUP), n, 1];
                    r.dispatch(light_kernel, bytemuck::bytes_of(&push), groups);
                    push.first_step += n;
                }
            };
            device.run_with(uploads, record, &mut [])?;
            uploads = &[];
            first_ray += batch;
        }
    }
    Ok(())
}
