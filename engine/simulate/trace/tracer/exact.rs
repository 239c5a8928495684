//! Exact transport: several attempts, and lists of crossings as long as each ray needs.

use super::{RAY_OFFSETS, Tracer};
use beamlet_core::Result;
use beamlet_core::numbers::count;
use beamlet_gpu::{Backend, Buffer, Kernel, Pace};
use beamlet_interface::{ExactPush, GROUP, LONGEST_LIST, Ray, RayResult};
use rayon::prelude::*;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Rays at nodes of the spectrum that are traced exactly together at most.
const AT_NODES: u32 = 1 << 15;
/// Crossings that lists of rays that are traced exactly hold at first.
const SHORT_LIST: u32 = 64;
/// Crossings that all lists hold together.
pub(super) const LISTED: u32 = 1 << 21;

/// Rays of the batch that are traced exactly.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExactRays<'a> {
    pub(crate) list: &'a Buffer,
    pub(crate) rays: u32,
    pub(crate) all: bool,
    /// The list names the first of each run of equal rays.
    pub(crate) runs: bool,
}

impl Tracer {
    /// Traces rays exactly at each node of the spectrum, `[node][ray]`. A ray that is given at
    /// several nodes is searched for its crossings once.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn walk_at_nodes(&mut self, rays: &[Vec<Ray>]) -> Result<Vec<Vec<RayResult>>> {
        let each = |(node, of_node): (usize, &Vec<Ray>)| {
            (0..of_node.len()).map(move |place| (node, place)).collect::<Vec<_>>()
        };
        let mut all: Vec<(usize, usize)> = rays.iter().enumerate().flat_map(each).collect();
        let ray = |(node, place): (usize, usize)| rays[node][place];
        // Equal rays side by side, neighbours in x near one another.
        let order = |r: Ray| (r.pose, r.z.to_bits(), r.x.to_bits(), r.slope_x.to_bits());
        all.par_sort_by_key(|&at| (order(ray(at)), at));
        let mut results: Vec<Vec<RayResult>> =
            rays.iter().map(|of| bytemuck::zeroed_vec(of.len())).collect();
        for some in all.chunks(AT_NODES.min(self.capacity()) as usize) {
            self.cancel.check()?;
            let listed: Vec<(usize, Ray)> = some.iter().map(|&at| (at.0, ray(at))).collect();
            for (&(node, place), result) in some.iter().zip(self.trace_at_nodes(&listed)?) {
                results[node][place] = result;
            }
        }
        Ok(results)
    }

    /// Traces rays exactly, each at its node; equal rays are adjacent.
    fn trace_at_nodes(&self, rays: &[(usize, Ray)]) -> Result<Vec<RayResult>> {
        let walks = self.walks(self.backend);
        let n = count(rays.len());
        let constants = |node: usize| count((node + 1) * self.sample.materials as usize);
        self.batch.rays.write(0, &rays.iter().map(|(_, ray)| *ray).collect::<Vec<_>>())?;
        self.batch.nodes.write(0, &rays.iter().map(|(n, _)| constants(*n)).collect::<Vec<_>>())?;
        // The first order is the answer for rays that cannot be followed.
        self.pass(walks.order_free(false), false, n, false, 0.0, false)?;
        let mut list = vec![0];
        let mut end = 0;
        for run in rays.chunk_by(|a, b| a.1 == b.1) {
            list.push(end);
            end += count(run.len());
        }
        let runs = count(list.len() - 1);
        list[0] = runs;
        list.push(end);
        self.batch.exact.write(0, &list)?;
        let exact_rays = ExactRays { list: &self.batch.exact, rays: runs, all: false, runs: true };
        self.exact_pass(walks.exact.get()?, exact_rays, true, 0.0, false)?;
        self.exact_again(true)?;
        self.counts.rays.fetch_add(n.into(), Ordering::Relaxed);
        self.counts.exact.fetch_add(n.into(), Ordering::Relaxed);
        self.batch.results.read(0, rays.len())
    }

    /// Tries again the rays that could not be followed exactly: a bend at an edge, or a new
    /// search there, can lose a crossing.
    pub(super) fn exact_again(&self, at_nodes: bool) -> Result<Duration> {
        let b = &self.batch;
        let mut time = Duration::ZERO;
        for (i, ray_offset) in RAY_OFFSETS.into_iter().enumerate() {
            let lost = b.unbalanced.read::<u32>(0, 1)?[0];
            if lost == 0 {
                break;
            }
            if i == 0 && self.backend == Backend::Bvh {
                continue;
            }
            self.counts.retraced.fetch_add(u64::from(lost), Ordering::Relaxed);
            self.device.run(|r| r.copy(&b.unbalanced, 0, &b.list, 0, (u64::from(lost) + 1) * 4))?;
            let kernel = self.walks(Backend::Bvh).exact.get()?;
            let last = i + 1 == RAY_OFFSETS.len();
            let exact_rays = ExactRays { list: &b.list, rays: lost, all: false, runs: false };
            time += self.exact_pass(kernel, exact_rays, at_nodes, ray_offset, last)?;
        }
        Ok(time)
    }

    /// Traces rays exactly: first all with short lists of crossings, then rays with more crossings with
    /// longer and longer ones, in batches that fit the memory.
    pub(super) fn exact_pass(
        &self,
        kernel: &Kernel,
        exact_rays: ExactRays<'_>,
        at_nodes: bool,
        ray_offset: f32,
        last: bool,
    ) -> Result<Duration> {
        let b = &self.batch;
        let mut push = ExactPush {
            sample_ref: self.sample.record(self.node),
            rays: b.rays.address(),
            results: b.results.address(),
            list: exact_rays.list.address(),
            unbalanced: b.unbalanced.address(),
            longer: b.longer.address(),
            lists: self.lists.address(),
            nodes: if at_nodes { b.nodes.address() } else { 0 },
            tally: self.tally.address(),
            count: exact_rays.rays,
            all: exact_rays.all.into(),
            runs: exact_rays.runs.into(),
            first: 0,
            last: last.into(),
            ray_offset,
            capacity: SHORT_LIST,
            stride: GROUP,
        };
        b.unbalanced.write(0, &[0_u32])?;
        let mut time = Duration::ZERO;
        while push.count > 0 {
            self.cancel.check()?;
            b.longer.write(0, &[0_u32])?;
            time += self.exact_dispatches(kernel, push)?;
            let longer = b.longer.read::<u32>(0, 1)?[0];
            if longer == 0 {
                break;
            }
            self.device
                .run(|r| r.copy(&b.longer, 0, &b.long_list, 0, (u64::from(longer) + 1) * 4))?;
            push.list = b.long_list.address();
            push.count = longer;
            (push.all, push.runs) = (0, 0);
            push.capacity = (push.capacity * 8).min(LONGEST_LIST);
        }
        Ok(time)
    }

    /// Dispatches of the rays of a push, short ones.
    fn exact_dispatches(&self, kernel: &Kernel, push: ExactPush) -> Result<Duration> {
        let room = LISTED / push.capacity;
        let most = if room < GROUP { room } else { room / GROUP * GROUP };
        let stride = most.min(GROUP);
        let mut time = Duration::ZERO;
        let mut pace = Pace::new(most.min(4096), stride, most);
        let mut first = 0;
        while first < push.count {
            let count = push.count.min(first + pace.size());
            let push = ExactPush { first, count, stride, ..push };
            let groups = [(count - first).div_ceil(GROUP), 1, 1];
            let took =
                self.device.run(|r| r.dispatch(kernel, bytemuck::bytes_of(&push), groups))?;
            first = count;
            time += took;
            pace.adapt(took);
        }
        Ok(time)
    }
}
