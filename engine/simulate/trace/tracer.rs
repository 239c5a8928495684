//! The tracer: rays in, results out, in batches, on either backend.

mod batch;
mod exact;
mod kernels;
mod pass;

use super::upload::DeviceSample;
use batch::Batch;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers, reserve};
use beamlet_gpu::{Backend, Buffer, Device, LazyKernel, Memory, Pace, Upload};
use beamlet_interface::{
    Crossing, MATERIALS_IN_REGISTERS, MOMENTS_HEAD, Ray, RayResult, TALLY_COUNTERS, TALLY_DROPPED,
    TALLY_NEGATIVE, TALLY_NOT_FINITE, TALLY_REFLECTED, TALLY_UNBALANCED, TALLY_UNORDERED,
};
use beamlet_model::scene::Transport;
use exact::{ExactPass, ExactRays, LISTED};
pub use kernels::TraceKernels;
use kernels::{OrderFree, Walks};
use pass::{Found, Pass};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

/// Rays of a batch to begin with; batches adapt so that no dispatch is long.
const FIRST_BATCH: u32 = 1 << 16;
/// Fewest rays of a batch that adapts.
const SMALLEST_BATCH: u32 = 1024;
/// Most rays of a batch.
const LARGEST_BATCH: u32 = 1 << 19;
/// Unbalanced rays are tried again this far to the side, m: far below any accuracy wanted, far
/// above the rounding of coordinates that made an edge ambiguous.
const RAY_OFFSETS: [f32; 5] = [0.0, 3e-10, -7e-10, 2.3e-9, -6e-9];

/// Traces rays through a sample on the device.
#[derive(Debug)]
pub struct Tracer {
    device: Arc<Device>,
    kernels: Arc<TraceKernels>,
    sample: Arc<DeviceSample>,
    /// Sums of all its materials fit in registers.
    few: bool,
    backend: Backend,
    transport: Transport,
    node: Option<usize>,
    batch: Batch,
    tally: Buffer,
    /// Crossings of the rays that are traced exactly.
    lists: Buffer,
    fixed_batch: Option<u32>,
    most: u32,
    counts: DeviceCounts,
    /// The batch before was done with one pass.
    settled: AtomicBool,
    cancel: Cancel,
}

/// Request to the tracer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    RayResults,
    Moments,
    Both,
}

#[derive(Debug, Default)]
struct DeviceCounts {
    rays: AtomicU64,
    exact: AtomicU64,
    retraced: AtomicU64,
    device: [AtomicU64; TALLY_COUNTERS],
}

impl Tracer {
    /// A tracer; `fixed_batch` sets the rays of a dispatch, `most` bounds them where it does not
    /// (results do not depend on them).
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], or [`beamlet_core::Error::Device`] where the backend is not to be had.
    pub fn new(
        device: &Arc<Device>,
        kernels: &Arc<TraceKernels>,
        sample: &Arc<DeviceSample>,
        backend: Backend,
        transport: Transport,
        fixed_batch: Option<u32>,
        most: u32,
    ) -> Result<Self> {
        let most = most.clamp(SMALLEST_BATCH, LARGEST_BATCH);
        let capacity = fixed_batch.unwrap_or(FIRST_BATCH.min(most)).clamp(1, LARGEST_BATCH);
        Ok(Self {
            device: device.clone(),
            kernels: kernels.clone(),
            sample: sample.clone(),
            few: sample.materials <= MATERIALS_IN_REGISTERS,
            backend,
            transport,
            node: None,
            batch: Batch::new(device, capacity, MOMENTS_HEAD + sample.moment_words())?,
            tally: device.upload("tally", &[0_u32; TALLY_COUNTERS])?,
            lists: device.buffer(
                "crossings of exact rays",
                u64::from(LISTED) * size_of::<Crossing>() as u64,
                Memory::Device,
            )?,
            fixed_batch,
            most,
            counts: DeviceCounts::default(),
            settled: AtomicBool::new(true),
            cancel: Cancel::default(),
        })
    }

    /// Sets what ends tracing, between two dispatches.
    pub(crate) fn set_cancel(&mut self, cancel: Cancel) {
        self.cancel = cancel;
    }

    /// Flag that ends tracing.
    pub(crate) const fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// The kernels that results take: a run that cannot have them does not begin.
    pub(crate) fn wanted_kernels(&self) -> [&LazyKernel; 2] {
        let walks = self.walks(self.backend);
        [self.order_free(walks.order_free(true), false), &walks.exact]
    }

    fn walks(&self, backend: Backend) -> &Walks {
        self.kernels.of(backend, self.sample.kinds)
    }

    /// `moments`: moments of the rays are needed.
    fn order_free<'k>(&self, trace: &'k OrderFree, moments: bool) -> &'k LazyKernel {
        if self.few && !(moments && self.sample.is_rough()) { &trace.few } else { &trace.many }
    }

    /// Later results belong to a node of the spectrum, or (`None`) to its mean constants.
    pub const fn set_node(&mut self, node: Option<usize>) {
        self.node = node;
    }

    /// Number of materials of the sample, the surroundings included.
    #[must_use]
    pub fn materials(&self) -> usize {
        self.sample.materials as usize
    }

    /// Words of the moments of a ray, without their head.
    #[must_use]
    pub(crate) fn moment_words(&self) -> usize {
        self.sample.moment_words()
    }

    /// Most rays that one batch on the device takes now.
    #[must_use]
    pub const fn capacity(&self) -> u32 {
        self.batch.capacity
    }

    /// Rays of the batch on the device, for kernels that make them there.
    #[must_use]
    pub const fn rays(&self) -> &Buffer {
        &self.batch.rays
    }

    /// Results of the batch on the device, for kernels that use them there.
    #[must_use]
    pub const fn results(&self) -> &Buffer {
        &self.batch.results
    }

    /// Traces rays given by the host; one result per ray.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`], [`beamlet_core::Error::Memory`].
    pub fn trace(&mut self, rays: &[Ray]) -> Result<Vec<RayResult>> {
        let mut results = bytemuck::zeroed_vec(rays.len());
        self.each_batch(rays, &mut results, Wanted::RayResults, |_, _, _| Ok(()))?;
        Ok(results)
    }

    /// Traces rays and keeps their moments, `[ray][word]` (see [`super::Moments`]).
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn trace_with_moments(&mut self, rays: &[Ray]) -> Result<(Vec<RayResult>, Vec<u32>)> {
        let mut results = bytemuck::zeroed_vec(rays.len());
        let moments = self.read_moments(rays, &mut results, Wanted::Both)?;
        Ok((results, moments))
    }

    /// Moments of rays whose results are known, `[ray][word]`: none is traced exactly.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn trace_moments(&mut self, rays: &[Ray]) -> Result<Vec<u32>> {
        self.read_moments(rays, &mut [], Wanted::Moments)
    }

    fn read_moments(
        &mut self,
        rays: &[Ray],
        results: &mut [RayResult],
        wanted: Wanted,
    ) -> Result<Vec<u32>> {
        let words = MOMENTS_HEAD + self.moment_words();
        let mut moments = reserve::zeroed::<u32>(rays.len() * words, "moments of rays")?;
        self.each_batch(rays, results, wanted, |batch, first, n| {
            batch.moments.read_into(0, &mut moments[first * words..(first + n) * words])
        })?;
        Ok(moments)
    }

    fn each_batch(
        &mut self,
        rays: &[Ray],
        results: &mut [RayResult],
        wanted: Wanted,
        mut after: impl FnMut(&Batch, usize, usize) -> Result<()>,
    ) -> Result<()> {
        let mut first = 0;
        while first < rays.len() {
            self.cancel.check()?;
            let n = (rays.len() - first).min(self.batch.capacity as usize);
            let results = match wanted {
                Wanted::Moments => &mut [],
                Wanted::RayResults | Wanted::Both => &mut results[first..first + n],
            };
            let rays = &rays[first..first + n];
            let time = self.trace_batch(numbers::count(n), rays, wanted, true, results)?;
            after(&self.batch, first, n)?;
            first += n;
            self.adapt(n, time)?;
        }
        Ok(())
    }

    /// Grows or shrinks batches towards dispatches that are neither short nor long.
    fn adapt(&mut self, n: usize, time: Duration) -> Result<()> {
        let capacity = self.batch.capacity;
        if self.fixed_batch.is_some() || n < capacity as usize {
            return Ok(());
        }
        let mut pace = Pace::new(capacity, SMALLEST_BATCH.min(capacity), self.most);
        pace.adapt(time);
        if pace.size() != capacity {
            self.batch = Batch::new(&self.device, pace.size(), MOMENTS_HEAD + self.moment_words())?;
        }
        Ok(())
    }

    /// Traces the first `n` rays of the batch where they are; the results stay on the device.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`].
    pub fn trace_on_device(&self, n: u32) -> Result<Duration> {
        // Random rays draw normals at every rough surface.
        self.trace_batch(n, &[], Wanted::RayResults, false, &mut [])
    }

    /// Traces `n` rays: these, or without any those that are on the device; `bundled`: as bundles, where
    /// the device walks these. Results go to `results`, and without room for them stay on the device.
    fn trace_batch(
        &self,
        n: u32,
        rays: &[Ray],
        wanted: Wanted,
        bundled: bool,
        results: &mut [RayResult],
    ) -> Result<Duration> {
        let moments = wanted != Wanted::RayResults;
        let may_be_exact = wanted != Wanted::Moments && self.transport != Transport::FirstOrder;
        let is_flagged = may_be_exact && self.transport != Transport::Exact;
        let mut found = Found { unbalanced: 0, exact: is_flagged.then_some(0) };
        // Results come along where the batch before was done with one pass.
        let early = self.settled.load(Ordering::Relaxed);
        let early_results = if early { &mut *results } else { &mut [] };
        let walks = self.walks(self.backend);
        let software = self.walks(Backend::Bvh).order_free(false);
        let first = Pass { moments, n, listed: false, ray_offset: 0.0, last: false };
        let uploads = [Upload::new(&self.batch.rays, 0, rays)];
        let order_free = walks.order_free(bundled);
        let mut time = self.pass(order_free, first, &uploads, (&mut found, early_results))?;
        let mut settled = true;
        let leaves_rays = bundled && walks.leaves_rays();
        self.counts.rays.fetch_add(u64::from(n), Ordering::Relaxed);
        // Whatever the driver's search or the rounding at an edge lost is traced again by the
        // software BVH, at last a hair beside.
        for (i, ray_offset) in RAY_OFFSETS.into_iter().enumerate() {
            let unbalanced = found.unbalanced;
            if unbalanced == 0 {
                break;
            }
            if i > 0 || self.backend != Backend::Bvh {
                self.counts.retraced.fetch_add(u64::from(unbalanced), Ordering::Relaxed);
            } else if !leaves_rays {
                continue;
            }
            let last = i + 1 == RAY_OFFSETS.len();
            settled = false;
            let again = Pass { moments, n: unbalanced, listed: true, ray_offset, last };
            time += self.pass(software, again, &[], (&mut found, &mut []))?;
        }
        let all = self.transport == Transport::Exact;
        let flagged = if all { n } else { found.exact.unwrap_or(0) };
        if flagged > 0 && may_be_exact {
            self.counts.exact.fetch_add(u64::from(flagged), Ordering::Relaxed);
            let list = &self.batch.exact;
            let exact_rays = ExactRays { list, rays: flagged, all, runs: false };
            let exact = ExactPass {
                exact_rays,
                again: false,
                at_nodes: false,
                ray_offset: 0.0,
                last: false,
            };
            let (took, lost) = self.exact_pass(walks.exact.get()?, exact, Vec::new())?;
            time += took + self.exact_again(lost, false)?;
            settled = false;
        }
        if !(early && settled) {
            self.batch.results.read_into(0, results)?;
        }
        self.settled.store(settled, Ordering::Relaxed);
        Ok(time)
    }

    /// Rays traced so far.
    #[must_use]
    pub fn rays_traced(&self) -> u64 {
        self.counts.rays.load(Ordering::Relaxed)
    }

    /// Counts so far.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`].
    pub fn tally(&self) -> Result<Tally> {
        // Device counters are 32 bits wide: move them to the host before they could overflow.
        let device: Vec<u32> = self.tally.read(0, TALLY_COUNTERS)?;
        self.tally.write(0, &[0_u32; TALLY_COUNTERS])?;
        let mut sums = [0_u64; TALLY_COUNTERS];
        for ((sum, kept), new) in sums.iter_mut().zip(&self.counts.device).zip(device) {
            *sum = kept.fetch_add(new.into(), Ordering::Relaxed) + u64::from(new);
        }
        Ok(Tally {
            rays: self.counts.rays.load(Ordering::Relaxed),
            exact: self.counts.exact.load(Ordering::Relaxed),
            retraced: self.counts.retraced.load(Ordering::Relaxed),
            unbalanced: sums[TALLY_UNBALANCED],
            dropped: sums[TALLY_DROPPED],
            reflected: sums[TALLY_REFLECTED],
            not_finite: sums[TALLY_NOT_FINITE],
            unordered: sums[TALLY_UNORDERED],
            negative: sums[TALLY_NEGATIVE],
            ..Tally::default()
        })
    }
}
