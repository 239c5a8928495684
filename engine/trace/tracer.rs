//! The tracer: rays in, laws out, in batches, on either backend.

mod batch;
mod kernels;

use super::upload::DeviceSample;
use crate::Result;
use crate::gpu::interface::{ExactPush, Law, MATERIALS_IN_REGISTERS, Ray, TracePush};
use crate::gpu::{Buffer, Device, Kernel, LazyKernel};
use crate::run::{Backend, Tally};
use crate::scene::Transport;
use batch::{Batch, stride};
use kernels::OrderFree;
pub use kernels::TraceKernels;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Invocations per workgroup of all kernels here.
const GROUP: u32 = 64;
/// Counters of the device.
const TALLY: usize = 5;
/// Rays of a batch to begin with; batches adapt so that no dispatch is long.
const FIRST_BATCH: u32 = 1 << 16;
/// Most rays of a batch.
const LARGEST_BATCH: u32 = 1 << 19;
/// Dispatches longer than this are cut, well short of a desktop driver's time-out.
const LONG: Duration = Duration::from_millis(100);
/// Ordered walks at nodes of the spectrum that go together at most.
const WALKS: u32 = 1 << 14;
/// Unbalanced rays are tried again this far to the side, m: far below any accuracy wanted, far
/// above the rounding of coordinates that made an edge ambiguous.
const NUDGES: [f32; 5] = [0.0, 3e-10, -7e-10, 2.3e-9, -6e-9];

/// Bytes of a push constant struct.
pub fn push_bytes<T>() -> u32 {
    u32::try_from(size_of::<T>()).unwrap_or(u32::MAX)
}

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
    fixed_batch: Option<u32>,
    most: u32,
    counts: Counts,
}

/// What is asked of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Laws,
    Moments,
    Both,
}

#[derive(Debug, Default)]
struct Counts {
    rays: AtomicU64,
    exact: AtomicU64,
    retraced: AtomicU64,
    device: [AtomicU64; TALLY],
}

impl Tracer {
    /// A tracer; `fixed_batch` sets the rays of a dispatch, `most` bounds them where it does not
    /// (results do not depend on them).
    ///
    /// # Errors
    /// [`crate::Error::Memory`], or [`crate::Error::Device`] where the backend is not to be had.
    pub fn new(
        device: &Arc<Device>,
        kernels: &Arc<TraceKernels>,
        sample: &Arc<DeviceSample>,
        backend: Backend,
        transport: Transport,
        fixed_batch: Option<u32>,
        most: u32,
    ) -> Result<Self> {
        let most = most.clamp(1024, LARGEST_BATCH);
        let capacity = fixed_batch.unwrap_or(FIRST_BATCH.min(most)).clamp(1, LARGEST_BATCH);
        Ok(Self {
            device: device.clone(),
            kernels: kernels.clone(),
            sample: sample.clone(),
            few: sample.materials <= MATERIALS_IN_REGISTERS,
            backend,
            transport,
            node: None,
            batch: Batch::new(device, capacity, sample.materials)?,
            tally: device.upload("tally", &[0_u32; TALLY])?,
            fixed_batch,
            most,
            counts: Counts::default(),
        })
    }

    /// Makes the kernels that laws take, so that a run that cannot have them does not begin.
    ///
    /// # Errors
    /// [`crate::Error::Device`], [`crate::Error::Memory`].
    pub fn make_kernels(&self) -> Result<()> {
        let (trace, exact) = self.kernels.of(self.backend);
        self.order_free(trace).get()?;
        exact.get()?;
        Ok(())
    }

    const fn order_free<'k>(&self, trace: &'k OrderFree) -> &'k LazyKernel {
        if self.few { &trace.few } else { &trace.many }
    }

    /// Laws from now on are those of a node of the spectrum, or (`None`) at its mean constants.
    pub const fn set_node(&mut self, node: Option<usize>) {
        self.node = node;
    }

    /// Number of materials of the sample, the surroundings included.
    #[must_use]
    pub fn materials(&self) -> usize {
        self.sample.materials as usize
    }

    /// Backend in use.
    #[must_use]
    pub const fn backend(&self) -> Backend {
        self.backend
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

    /// Laws of the batch on the device, for kernels that use them there.
    #[must_use]
    pub const fn laws(&self) -> &Buffer {
        &self.batch.laws
    }

    /// Traces rays given by the host; one law per ray.
    ///
    /// # Errors
    /// [`crate::Error::Device`], [`crate::Error::Memory`].
    pub fn trace(&mut self, rays: &[Ray]) -> Result<Vec<Law>> {
        let mut laws = bytemuck::zeroed_vec(rays.len());
        self.each_batch(rays, &mut laws, Wanted::Laws, |_, _, _| Ok(()))?;
        Ok(laws)
    }

    /// Traces rays and keeps their moments, `[ray][word]` (see [`super::Moments`]).
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn trace_with_moments(&mut self, rays: &[Ray]) -> Result<(Vec<Law>, Vec<u32>)> {
        let mut laws = bytemuck::zeroed_vec(rays.len());
        let moments = self.read_moments(rays, &mut laws, Wanted::Both)?;
        Ok((laws, moments))
    }

    /// Moments of rays whose laws are known, `[ray][word]`: none is walked in order.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn trace_moments(&mut self, rays: &[Ray]) -> Result<Vec<u32>> {
        self.read_moments(rays, &mut [], Wanted::Moments)
    }

    /// Walks rays in order at each node of the spectrum, `[node][ray]`. Walks at many nodes go
    /// together.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn walk_at_nodes(&mut self, rays: &[Vec<Ray>]) -> Result<Vec<Vec<Law>>> {
        let all: Vec<(usize, Ray)> = rays
            .iter()
            .enumerate()
            .flat_map(|(node, of_node)| of_node.iter().map(move |ray| (node, *ray)))
            .collect();
        let mut laws: Vec<Vec<Law>> = rays.iter().map(|of| Vec::with_capacity(of.len())).collect();
        for some in all.chunks(WALKS.min(self.capacity()) as usize) {
            let walked = self.walk_together(some)?;
            for ((node, _), law) in some.iter().zip(walked) {
                laws[*node].push(law);
            }
        }
        Ok(laws)
    }

    /// Walks rays in order, each at its node; nodes ascend.
    fn walk_together(&mut self, rays: &[(usize, Ray)]) -> Result<Vec<Law>> {
        let (trace, exact) = self.kernels.of(self.backend);
        let exact = exact.get()?;
        let n = u32::try_from(rays.len()).unwrap_or(u32::MAX);
        self.batch.rays.write(0, &rays.iter().map(|(_, ray)| *ray).collect::<Vec<_>>())?;
        // The first order is the answer for walks that stay lost.
        self.pass(trace, false, n, false, 0.0, false)?;
        self.batch.unbalanced.write(0, &[0_u32])?;
        let mut first = 0;
        let dispatches: Vec<ExactPush> = rays
            .chunk_by(|a, b| a.0 == b.0)
            .map(|of_node| {
                let begin = first;
                first += u32::try_from(of_node.len()).unwrap_or(u32::MAX);
                let push = self.exact_push(&self.batch.exact, true, begin..first);
                ExactPush { sample_ref: self.sample.record(Some(of_node[0].0)), ..push }
            })
            .collect();
        self.device.run(|r| {
            for push in &dispatches {
                let groups = [(push.count - push.first).div_ceil(GROUP), 1, 1];
                r.dispatch(exact, bytemuck::bytes_of(push), groups);
            }
        })?;
        self.counts.rays.fetch_add(n.into(), Ordering::Relaxed);
        self.counts.exact.fetch_add(n.into(), Ordering::Relaxed);
        let lost = self.batch.unbalanced.read::<u32>(0, 1)?[0];
        let mut lost = self.batch.unbalanced.read::<u32>(4, lost as usize)?;
        lost.sort_unstable();
        for of_node in lost.chunk_by(|a, b| rays[*a as usize].0 == rays[*b as usize].0) {
            let count = u32::try_from(of_node.len()).unwrap_or(u32::MAX);
            self.batch.unbalanced.write(0, &[&[count], of_node].concat())?;
            self.node = Some(rays[of_node[0] as usize].0);
            let again = self.exact_again();
            self.node = None;
            again?;
        }
        self.batch.laws.read(0, rays.len())
    }

    fn exact_push(&self, list: &Buffer, all: bool, rays: Range<u32>) -> ExactPush {
        ExactPush {
            sample_ref: self.sample.record(self.node),
            rays: self.batch.rays.address(),
            laws: self.batch.laws.address(),
            list: list.address(),
            unbalanced: self.batch.unbalanced.address(),
            tally: self.tally.address(),
            count: rays.end,
            all: all.into(),
            first: rays.start,
            last: 0,
            nudge: 0.0,
        }
    }

    fn read_moments(&mut self, rays: &[Ray], laws: &mut [Law], wanted: Wanted) -> Result<Vec<u32>> {
        let words = stride(self.sample.materials);
        let mut moments = vec![0_u32; rays.len() * words];
        self.each_batch(rays, laws, wanted, |batch, first, n| {
            batch.moments.read_into(0, &mut moments[first * words..(first + n) * words])
        })?;
        Ok(moments)
    }

    fn each_batch(
        &mut self,
        rays: &[Ray],
        laws: &mut [Law],
        wanted: Wanted,
        mut after: impl FnMut(&Batch, usize, usize) -> Result<()>,
    ) -> Result<()> {
        let mut first = 0;
        while first < rays.len() {
            let n = (rays.len() - first).min(self.batch.capacity as usize);
            self.batch.rays.write(0, &rays[first..first + n])?;
            let time = self.trace_batch(u32::try_from(n).unwrap_or(u32::MAX), wanted)?;
            if wanted != Wanted::Moments {
                self.batch.laws.read_into(0, &mut laws[first..first + n])?;
            }
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
        let next = if time > LONG && capacity > 1024 {
            capacity / 2
        } else if time < LONG / 4 && capacity < self.most {
            capacity * 2
        } else {
            return Ok(());
        };
        self.batch = Batch::new(&self.device, next, self.sample.materials)?;
        Ok(())
    }

    /// Traces the first `n` rays of the batch where they are; the laws stay on the device.
    ///
    /// # Errors
    /// [`crate::Error::Device`].
    pub fn trace_on_device(&self, n: u32) -> Result<Duration> {
        self.trace_batch(n, Wanted::Laws)
    }

    fn trace_batch(&self, n: u32, wanted: Wanted) -> Result<Duration> {
        let moments = wanted != Wanted::Laws;
        let (trace, exact) = self.kernels.of(self.backend);
        let mut time = self.pass(trace, moments, n, false, 0.0, false)?;
        self.counts.rays.fetch_add(u64::from(n), Ordering::Relaxed);
        // Whatever the driver's search or the rounding at an edge lost is traced again by the
        // software BVH, at last a hair beside.
        let mut unbalanced = self.batch.unbalanced.read::<u32>(0, 1)?[0];
        for (i, nudge) in NUDGES.into_iter().enumerate() {
            if unbalanced == 0 {
                break;
            }
            if i == 0 && self.backend == Backend::Bvh {
                continue;
            }
            self.counts.retraced.fetch_add(u64::from(unbalanced), Ordering::Relaxed);
            let last = i + 1 == NUDGES.len();
            time += self.pass(&self.kernels.trace_bvh, moments, unbalanced, true, nudge, last)?;
            unbalanced = if last { 0 } else { self.batch.unbalanced.read::<u32>(0, 1)?[0] };
        }
        let all = self.transport == Transport::Exact;
        let flagged = if all { n } else { self.batch.exact.read::<u32>(0, 1)?[0] };
        let ordered = wanted != Wanted::Moments && self.transport != Transport::FirstOrder;
        if flagged > 0 && ordered {
            self.counts.exact.fetch_add(u64::from(flagged), Ordering::Relaxed);
            time += self.exact_pass(exact.get()?, flagged, &self.batch.exact, all, 0.0, false)?;
            time += self.exact_again()?;
        }
        Ok(time)
    }

    fn pass(
        &self,
        trace: &OrderFree,
        moments: bool,
        n: u32,
        listed: bool,
        nudge: f32,
        last: bool,
    ) -> Result<Duration> {
        let b = &self.batch;
        let kernel = self.order_free(trace).get()?;
        // Many materials are summed in memory, whether anybody asks for the moments or not.
        let keep = moments || !self.few;
        let push = TracePush {
            sample_ref: self.sample.record(self.node),
            rays: b.rays.address(),
            moments: if keep { b.moments.address() } else { 0 },
            laws: b.laws.address(),
            exact: b.exact.address(),
            unbalanced: b.unbalanced.address(),
            list: b.list.address(),
            tally: self.tally.address(),
            count: n,
            materials: self.sample.materials,
            listed: listed.into(),
            last: last.into(),
            nudge,
        };
        self.device.run(|r| {
            if listed {
                r.copy(&b.unbalanced, 0, &b.list, 0, (u64::from(n) + 1) * 4);
            } else {
                r.fill(&b.exact, 0, 4, 0);
            }
            r.barrier();
            r.fill(&b.unbalanced, 0, 4, 0);
            r.barrier();
            r.dispatch(kernel, bytemuck::bytes_of(&push), [n.div_ceil(trace.rays), 1, 1]);
        })
    }

    /// Tries again the ordered walks that lost a crossing: a bend at an edge can move the ray
    /// past the facet it would leave by.
    fn exact_again(&self) -> Result<Duration> {
        let b = &self.batch;
        let mut time = Duration::ZERO;
        for (i, nudge) in NUDGES.into_iter().enumerate() {
            let lost = b.unbalanced.read::<u32>(0, 1)?[0];
            if lost == 0 {
                break;
            }
            if i == 0 && self.backend == Backend::Bvh {
                continue;
            }
            self.counts.retraced.fetch_add(u64::from(lost), Ordering::Relaxed);
            self.device.run(|r| r.copy(&b.unbalanced, 0, &b.list, 0, (u64::from(lost) + 1) * 4))?;
            let kernel = self.kernels.exact_bvh.get()?;
            let last = i + 1 == NUDGES.len();
            time += self.exact_pass(kernel, lost, &b.list, false, nudge, last)?;
        }
        Ok(time)
    }

    /// Ordered walks search once per crossing: they go in small dispatches.
    fn exact_pass(
        &self,
        kernel: &Kernel,
        n: u32,
        list: &Buffer,
        all: bool,
        nudge: f32,
        last: bool,
    ) -> Result<Duration> {
        let mut time = Duration::ZERO;
        self.batch.unbalanced.write(0, &[0_u32])?;
        let mut first = 0;
        let mut size = 4096;
        while first < n {
            let rays = first..n.min(first + size);
            let push = ExactPush { last: last.into(), nudge, ..self.exact_push(list, all, rays) };
            let groups = (push.count - first).div_ceil(GROUP);
            let took = self.device.run(|r| {
                r.dispatch(kernel, bytemuck::bytes_of(&push), [groups, 1, 1]);
            })?;
            first += size;
            time += took;
            if took > LONG {
                size = (size / 2).max(GROUP);
            } else if took < LONG / 4 {
                size = (size * 2).min(LARGEST_BATCH);
            }
        }
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
    /// [`crate::Error::Device`].
    pub fn tally(&self) -> Result<Tally> {
        // Device counters are 32 bits wide: move them to the host before they could overflow.
        let device: Vec<u32> = self.tally.read(0, TALLY)?;
        self.tally.write(0, &[0_u32; TALLY])?;
        let mut sums = [0_u64; TALLY];
        for ((sum, kept), new) in sums.iter_mut().zip(&self.counts.device).zip(device) {
            *sum = kept.fetch_add(new.into(), Ordering::Relaxed) + u64::from(new);
        }
        Ok(Tally {
            rays: self.counts.rays.load(Ordering::Relaxed),
            exact: self.counts.exact.load(Ordering::Relaxed),
            retraced: self.counts.retraced.load(Ordering::Relaxed),
            unbalanced: sums[0],
            dropped: sums[1],
            reflected: sums[2],
            not_finite: sums[3],
            unordered: sums[4],
            ..Tally::default()
        })
    }
}
