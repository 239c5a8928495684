//! The random scheme: rays made, traced and illuminated on the device.

use super::fill::items_each;
use super::fit::GrowingBuffer;
use super::light::{ApertureEdges, IlluminationBuffer};
use super::sums::PixelSums;
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Device, Kernel, LazyKernel, Pace, Recorder, Upload, push_bytes};
use beamlet_interface::{GROUP, Pixel, RANDOM_STEPS, RandomLightPush, RandomRaysPush};
use beamlet_model::optics::Optics;
use beamlet_model::scene::RandomRays;
use std::sync::Arc;

/// Most rays of an invocation of the light.
const RAYS_EACH: u32 = 16;
/// Most rays of a dispatch that traces none.
const MOST_EMPTY: u32 = 1 << 21;
/// Mask steps of a dispatch: long ones would block a screen.
const STEPS_TOGETHER: u32 = 16 * RANDOM_STEPS;

/// Kernels of the random scheme, each made when it is first wanted.
#[derive(Debug)]
pub(crate) struct RandomKernels {
    rays: LazyKernel,
    light: LazyKernel,
    /// For masks whose walls are slanted or whose bars have several layers.
    light_walls: LazyKernel,
    /// For masks whose apertures end along z.
    light_heights: LazyKernel,
}

impl RandomKernels {
    /// Kernels of a device.
    #[must_use]
    pub(crate) fn new(device: &Arc<Device>) -> Self {
        let (rays, light) = (push_bytes::<RandomRaysPush>(), push_bytes::<RandomLightPush>());
        Self {
            rays: LazyKernel::new(device, "random_rays", rays),
            light: LazyKernel::new(device, "random_light", light),
            light_walls: LazyKernel::new(device, "random_light_walls", light),
            light_heights: LazyKernel::new(device, "random_light_heights", light),
        }
    }

    /// Those of a run whose masks have these edges.
    pub(crate) const fn all(&self, edges: ApertureEdges) -> [&LazyKernel; 2] {
        let light = match edges {
            ApertureEdges::Straight => &self.light,
            ApertureEdges::Walls => &self.light_walls,
            ApertureEdges::Heights => &self.light_heights,
        };
        [&self.rays, light]
    }
}

/// Pixels whose rays one call casts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RandomBatch<'a> {
    /// Pixels, inside the detector or beside it.
    pub pixels: &'a [Pixel],
    /// Index of the pose among the poses of all views.
    pub pose: u32,
    /// All rays of these pixels miss the sample.
    pub empty: bool,
}

/// Casts random rays and adds their light to sums.
#[derive(Debug)]
pub(crate) struct RandomIlluminator {
    device: Arc<Device>,
    kernels: Arc<RandomKernels>,
    pixels: GrowingBuffer,
    seed: [u32; 2],
    /// As in [`RandomLightPush`].
    rays_per_pixel: [u32; 2],
    /// Rays of a pixel.
    rays: u32,
    steps: u32,
    /// Rays times steps of a submission that traces none.
    pace: Pace,
}

impl RandomIlluminator {
    /// An illuminator for the rays and mask steps of a scene.
    pub(crate) fn new(device: &Arc<Device>, kernels: &Arc<RandomKernels>, optics: &Optics) -> Self {
        let (seed, rays) = (optics.sampling.seed, optics.sampling.rays);
        Self {
            device: device.clone(),
            kernels: kernels.clone(),
            pixels: GrowingBuffer::new(device, "pixels"),
            seed: [numbers::low_word(seed), numbers::high_word(seed)],
            rays_per_pixel: match rays {
                RandomRays::Count(count) => [count, 0],
                RandomRays::Grid(grid) => grid,
            },
            rays: rays.count(),
            steps: numbers::count(optics.mask_steps()),
            pace: Pace::new(1 << 20, 1 << 16, 1 << 30),
        }
    }

    /// Casts the rays of pixels and adds their light to the sums.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], [`beamlet_core::Error::Device`];
    /// [`beamlet_core::Error::Interrupted`].
    pub(crate) fn add(
        &mut self,
        tracer: &mut Tracer,
        light: &IlluminationBuffer,
        sums: &PixelSums,
        job: RandomBatch<'_>,
    ) -> Result<()> {
        let kernels = self.kernels.clone();
        let [rays_kernel, light_kernel] = kernels.all(light.edges());
        let (rays_kernel, light_kernel) = (rays_kernel.get()?, light_kernel.get()?);
        let buffer = self.pixels.fit::<Pixel>(job.pixels.len())?;
        // The first submission takes all pixels along.
        let mut uploads = &[Upload::new(&buffer, 0, job.pixels)][..];
        let template = RandomLightPush {
            light_ref: light.address(),
            results: tracer.results().address(),
            sums: sums.buffer.address(),
            seed: self.seed,
            rays_per_pixel: self.rays_per_pixel,
            pose: job.pose,
            empty: job.empty.into(),
            steps: self.steps,
            ..bytemuck::Zeroable::zeroed()
        };
        let mut traced = None;
        let mut first_pixel = 0;
        while first_pixel < job.pixels.len() {
            let capacity = match job.empty {
                true => (self.pace.size() / self.steps).clamp(1, MOST_EMPTY),
                false => tracer.capacity(),
            };
            let left = numbers::at_most(job.pixels.len() - first_pixel);
            let pixel_count = left.min(capacity / self.rays.min(capacity));
            let pixels = buffer.address() + (first_pixel * size_of::<Pixel>()) as u64;
            let mut first_ray = 0;
            while first_ray < self.rays {
                tracer.cancel().check()?;
                let batch = (self.rays - first_ray).min(capacity / pixel_count);
                let push = RandomLightPush { pixels, pixel_count, first_ray, batch, ..template };
                if job.empty {
                    let time = self.device.run_with(
                        uploads,
                        |r| self.light(r, light_kernel, &push),
                        &mut [],
                    )?;
                    if pixel_count * batch > capacity / 2 {
                        self.pace.adapt(time);
                    }
                } else {
                    // The light of the batch before and new rays need nothing of each other.
                    let rays = self.rays_of(&push, tracer);
                    let begin = |r: &mut Recorder<'_>| {
                        if let Some(before) = &traced {
                            self.light(r, light_kernel, before);
                        }
                        let groups = (pixel_count * batch).div_ceil(GROUP);
                        r.dispatch(rays_kernel, bytemuck::bytes_of(&rays), [groups, 1, 1]);
                    };
                    tracer.trace_on_device(pixel_count * batch, uploads, begin)?;
                    traced = Some(push);
                }
                uploads = &[];
                first_ray += batch;
            }
            first_pixel += pixel_count as usize;
        }
        if let Some(before) = &traced {
            self.device.run(|r| self.light(r, light_kernel, before))?;
        }
        Ok(())
    }

    /// The rays of a batch, to be made.
    fn rays_of(&self, light: &RandomLightPush, tracer: &Tracer) -> RandomRaysPush {
        RandomRaysPush {
            light_ref: light.light_ref,
            pixels: light.pixels,
            rays: tracer.rays().address(),
            seed: light.seed,
            rays_per_pixel: light.rays_per_pixel,
            first_ray: light.first_ray,
            batch: light.batch,
            pixel_count: light.pixel_count,
            pose: light.pose,
        }
    }

    /// Records the light of a batch that was traced or is empty.
    fn light(&self, r: &mut Recorder<'_>, kernel: &Kernel, push: &RandomLightPush) {
        let mut push = *push;
        let rays = u64::from(push.pixel_count) * u64::from(push.batch);
        let items = rays * u64::from(push.steps.div_ceil(RANDOM_STEPS));
        let kind = self.device.description().kind;
        push.shares = push.batch.div_ceil(items_each(kind, items, RAYS_EACH));
        let groups = (push.pixel_count * push.shares).div_ceil(GROUP);
        while push.first_step < push.steps {
            let steps = (push.steps - push.first_step).min(STEPS_TOGETHER);
            let groups = [groups, steps.div_ceil(RANDOM_STEPS), 1];
            r.dispatch(kernel, bytemuck::bytes_of(&push), groups);
            push.first_step += steps;
        }
    }
}
