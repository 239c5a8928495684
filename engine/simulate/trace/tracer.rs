//! The tracer: rays in, results out, in batches, on either backend.

mod batch;
mod exact;
mod job;
mod kernels;
mod lines;
mod pass;
mod queues;

use super::upload::DeviceSample;
use batch::Batch;
pub(crate) use batch::RAY_BYTES;
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers, reserve};
use beamlet_gpu::{Backend, Buffer, Device, LazyKernel, Memory, Pace, Recorder, Upload};
use beamlet_interface::{
    Crossing, KIND_ROUGH, MATERIALS_IN_REGISTERS, MOMENTS_HEAD, Ray, RayResult, TALLY_COUNTERS,
    TALLY_DROPPED, TALLY_NEGATIVE, TALLY_NOT_FINITE, TALLY_REFLECTED, TALLY_RETRACED,
    TALLY_UNBALANCED, TALLY_UNORDERED,
};
use beamlet_model::scene::Transport;
use exact::{ExactRays, LISTED};
pub use kernels::TraceKernels;
use kernels::{OrderFree, Walks};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Rays of a batch to begin with; batches adapt so that no dispatch is long.
pub(crate) const FIRST_BATCH: u32 = 1 << 16;
/// As [`FIRST_BATCH`], where all rays are traced exactly, which takes longer.
const FIRST_EXACT_BATCH: u32 = 1 << 13;
/// Fewest rays of a batch that adapts.
const SMALLEST_BATCH: u32 = 1024;
/// Most rays of a batch.
pub(crate) const LARGEST_BATCH: u32 = 1 << 19;
/// Bytes of lists of crossings.
pub(crate) const LISTS_BYTES: u64 = LISTED as u64 * size_of::<Crossing>() as u64;

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
    /// Rays of a batch, at most those that its buffers hold: dispatches are neither short nor long.
    pace: Pace,
    tally: Buffer,
    /// Crossings of the rays that are traced exactly.
    lists: Buffer,
    counts: DeviceCounts,
    /// Counts of rays that give no light.
    left_out: Tally,
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

impl DeviceCounts {
    /// Takes the counters of the device, which are 32 bits wide and begin anew where they are full.
    fn take(&self, now: &[u32; TALLY_COUNTERS]) {
        for (sum, now) in self.device.iter().zip(now) {
            let before = numbers::low_word(sum.load(Ordering::Relaxed));
            sum.fetch_add(now.wrapping_sub(before).into(), Ordering::Relaxed);
        }
    }
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
        let first = match transport {
            Transport::Exact => FIRST_EXACT_BATCH,
            Transport::Auto | Transport::FirstOrder | Transport::Wave => FIRST_BATCH,
        };
        let pace = match fixed_batch.map(|rays| rays.clamp(1, LARGEST_BATCH)) {
            Some(rays) => Pace::new(rays, rays, rays),
            None => Pace::new(first.min(most), SMALLEST_BATCH, most),
        };
        let capacity = fixed_batch.map_or(most, |_| pace.size());
        Ok(Self {
            device: device.clone(),
            kernels: kernels.clone(),
            sample: sample.clone(),
            few: sample.materials <= MATERIALS_IN_REGISTERS,
            backend,
            transport,
            node: None,
            pace,
            batch: Batch::new(device, capacity, MOMENTS_HEAD + sample.moment_words())?,
            tally: device.upload("tally", &[0_u32; TALLY_COUNTERS])?,
            lists: device.buffer("crossings of exact rays", LISTS_BYTES, Memory::Device)?,
            counts: DeviceCounts::default(),
            left_out: Tally::default(),
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
    pub(crate) fn wanted_kernels(&self) -> Vec<&LazyKernel> {
        let walks = self.walks(self.backend);
        let mut kernels = vec![self.order_free(walks.order_free(true), false)];
        kernels.extend(self.exact_rays(ExactRays::All(0)).map(|_| &walks.exact));
        if walks.leaves_rays() {
            kernels.push(self.order_free(walks.order_free(false), false));
        }
        kernels
    }

    fn walks(&self, backend: Backend) -> &Walks {
        self.kernels.of(backend, self.sample.kinds)
    }

    /// `moments`: moments of the rays are needed.
    fn order_free<'k>(&self, trace: &'k OrderFree, moments: bool) -> &'k LazyKernel {
        let is_rough = self.sample.kinds & KIND_ROUGH != 0;
        if self.few && !(moments && is_rough) { &trace.few } else { &trace.many }
    }

    /// Later results belong to a node of the spectrum, or (`None`) to its mean constants.
    pub const fn set_node(&mut self, node: Option<usize>) {
        self.node = node;
    }

    /// Words of the moments of a ray, without their head.
    #[must_use]
    pub(crate) fn moment_words(&self) -> usize {
        self.sample.moment_words()
    }

    /// Most rays that one batch on the device takes now.
    #[must_use]
    pub const fn capacity(&self) -> u32 {
        self.pace.size()
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
        self.each_batch(rays, &mut results, &mut [], Wanted::RayResults)?;
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
        self.each_batch(rays, results, &mut moments, wanted)?;
        Ok(moments)
    }

    fn each_batch(
        &mut self,
        rays: &[Ray],
        results: &mut [RayResult],
        moments: &mut [u32],
        wanted: Wanted,
    ) -> Result<()> {
        let words = MOMENTS_HEAD + self.moment_words();
        let mut first = 0;
        while first < rays.len() {
            self.cancel.check()?;
            let n = (rays.len() - first).min(self.pace.size() as usize);
            let results = match wanted {
                Wanted::Moments => &mut [],
                Wanted::RayResults | Wanted::Both => &mut results[first..first + n],
            };
            let moments = match wanted {
                Wanted::RayResults => &mut [],
                Wanted::Moments | Wanted::Both => &mut moments[first * words..(first + n) * words],
            };
            let uploads = [Upload::new(&self.batch.rays, 0, &rays[first..first + n])];
            let count = numbers::count(n);
            let job = self.job(count, wanted, true)?;
            let (time, _) = self.run_job(&job, (&uploads, &|_| ()), (results, moments))?;
            self.counts.rays.fetch_add(count.into(), Ordering::Relaxed);
            first += n;
            self.adapt(n, time);
        }
        Ok(())
    }

    /// Grows or shrinks batches by the time of a full one.
    fn adapt(&mut self, n: usize, time: Duration) {
        if n >= self.pace.size() as usize {
            self.pace.adapt(time);
        }
    }

    /// Traces the first `n` rays of the batch where they are, after uploads, in the submission that `begin`
    /// records commands for; the results stay on the device.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`].
    pub fn trace_on_device(
        &self,
        n: u32,
        uploads: &[Upload<'_>],
        begin: impl Fn(&mut Recorder<'_>),
    ) -> Result<Duration> {
        let begin = |r: &mut Recorder<'_>| {
            begin(r);
            r.barrier();
        };
        // Random rays draw normals at every rough surface.
        let job = self.job(n, Wanted::RayResults, false)?;
        let (time, _) = self.run_job(&job, (uploads, &begin), (&mut [], &mut []))?;
        self.counts.rays.fetch_add(n.into(), Ordering::Relaxed);
        Ok(time)
    }

    /// Rays traced so far.
    #[must_use]
    pub fn rays_traced(&self) -> u64 {
        self.counts.rays.load(Ordering::Relaxed)
    }

    /// Traces rays that the counts leave out: they give no light.
    ///
    /// # Errors
    /// Those of `work`.
    pub(crate) fn leave_out<T>(&mut self, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let before = self.all();
        let done = work(self)?;
        self.left_out = self.left_out + self.all().since(before);
        Ok(done)
    }

    /// Counts so far.
    pub fn tally(&self) -> Tally {
        self.all().since(self.left_out)
    }

    /// Counts of all rays so far.
    fn all(&self) -> Tally {
        let sums = self.counts.device.each_ref().map(|sum| sum.load(Ordering::Relaxed));
        Tally {
            rays: self.counts.rays.load(Ordering::Relaxed),
            exact: self.counts.exact.load(Ordering::Relaxed),
            retraced: self.counts.retraced.load(Ordering::Relaxed) + sums[TALLY_RETRACED],
            unbalanced: sums[TALLY_UNBALANCED],
            dropped: sums[TALLY_DROPPED],
            reflected: sums[TALLY_REFLECTED],
            not_finite: sums[TALLY_NOT_FINITE],
            unordered: sums[TALLY_UNORDERED],
            negative: sums[TALLY_NEGATIVE],
            ..Tally::default()
        }
    }
}
