//! Exact transport: several attempts, and lists of crossings as long as each ray needs.

use super::pass::{Found, Pass};
use super::{RAY_OFFSETS, Tracer};
use beamlet_core::Result;
use beamlet_core::numbers::count;
use beamlet_gpu::{Backend, Buffer, Download, Kernel, Pace, Recorder, Upload};
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

/// Commands before a dispatch.
type Commands<'a> = &'a dyn Fn(&mut Recorder<'_>);

/// A pass of exact transport.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExactPass<'a> {
    pub(super) exact_rays: ExactRays<'a>,
    /// They are the lost ones of the pass before, which become the list first.
    pub(super) again: bool,
    /// Each ray has the constants of its node.
    pub(super) at_nodes: bool,
    pub(super) ray_offset: f32,
    pub(super) last: bool,
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
        let traced: Vec<Ray> = rays.iter().map(|(_, ray)| *ray).collect();
        let nodes: Vec<u32> = rays.iter().map(|(n, _)| constants(*n)).collect();
        let uploads =
            [Upload::new(&self.batch.rays, 0, &traced), Upload::new(&self.batch.nodes, 0, &nodes)];
        // The first order is the answer for rays that cannot be followed.
        let first = Pass { moments: false, n, listed: false, ray_offset: 0.0, last: false };
        let mut found = Found { unbalanced: 0, exact: None };
        self.pass(walks.order_free(false), first, &uploads, (&mut found, &mut []))?;
        let mut list = vec![0];
        let mut end = 0;
        for run in rays.chunk_by(|a, b| a.1 == b.1) {
            list.push(end);
            end += count(run.len());
        }
        let runs = count(list.len() - 1);
        list[0] = runs;
        list.push(end);
        let exact_rays = ExactRays { list: &self.batch.exact, rays: runs, all: false, runs: true };
        let pass =
            ExactPass { exact_rays, again: false, at_nodes: true, ray_offset: 0.0, last: false };
        let uploads = vec![Upload::new(&self.batch.exact, 0, &list)];
        let (_, lost) = self.exact_pass(walks.exact.get()?, pass, uploads)?;
        self.exact_again(lost, true)?;
        self.counts.rays.fetch_add(n.into(), Ordering::Relaxed);
        self.counts.exact.fetch_add(n.into(), Ordering::Relaxed);
        self.batch.results.read(0, rays.len())
    }

    /// Tries again the `lost` rays that could not be followed exactly: a bend at an edge, or a new
    /// search there, can lose a crossing.
    pub(super) fn exact_again(&self, mut lost: u32, at_nodes: bool) -> Result<Duration> {
        let b = &self.batch;
        let mut time = Duration::ZERO;
        for (i, ray_offset) in RAY_OFFSETS.into_iter().enumerate() {
            if lost == 0 {
                break;
            }
            if i == 0 && self.backend == Backend::Bvh {
                continue;
            }
            self.counts.retraced.fetch_add(u64::from(lost), Ordering::Relaxed);
            let kernel = self.walks(Backend::Bvh).exact.get()?;
            let last = i + 1 == RAY_OFFSETS.len();
            let exact_rays = ExactRays { list: &b.list, rays: lost, all: false, runs: false };
            let pass = ExactPass { exact_rays, again: true, at_nodes, ray_offset, last };
            let (took, still) = self.exact_pass(kernel, pass, Vec::new())?;
            time += took;
            lost = still;
        }
        Ok(time)
    }

    /// Traces rays exactly, after `uploads`: first all with short lists of crossings, then rays with more
    /// crossings with longer and longer ones, in batches that fit the memory. Returns the time, and the
    /// number of rays that could not be followed.
    pub(super) fn exact_pass<'b>(
        &'b self,
        kernel: &Kernel,
        pass: ExactPass<'_>,
        mut uploads: Vec<Upload<'b>>,
    ) -> Result<(Duration, u32)> {
        let b = &self.batch;
        let ExactPass { exact_rays, again, at_nodes, ray_offset, last } = pass;
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
        let mut time = Duration::ZERO;
        let (mut lost, mut longer) = (0, 0);
        if !again {
            uploads.push(Upload::new(&b.unbalanced, 0, &[0_u32]));
            uploads.push(Upload::new(&b.longer, 0, &[0_u32]));
        }
        while push.count > 0 {
            self.cancel.check()?;
            // Lists of the round before become the lists of this round, and begin anew.
            let is_first = push.capacity == SHORT_LIST;
            let begin = |r: &mut Recorder<'_>| {
                let bytes = (u64::from(push.count) + 1) * 4;
                match (is_first, again) {
                    (false, _) => r.copy(&b.longer, 0, &b.long_list, 0, bytes),
                    (true, true) => r.copy(&b.unbalanced, 0, &b.list, 0, bytes),
                    (true, false) => return,
                }
                r.barrier();
                if is_first {
                    r.fill(&b.unbalanced, 0, 4, 0);
                }
                r.fill(&b.longer, 0, 4, 0);
                r.barrier();
            };
            let counts = [&mut lost, &mut longer];
            time += self.exact_dispatches(kernel, push, (&uploads, &begin), counts)?;
            uploads.clear();
            if longer == 0 {
                break;
            }
            push.list = b.long_list.address();
            push.count = longer;
            (push.all, push.runs) = (0, 0);
            push.capacity = (push.capacity * 8).min(LONGEST_LIST);
        }
        Ok((time, lost))
    }

    /// Dispatches of the rays of a push, short ones: the first after uploads and commands, the last gives
    /// the numbers of lost rays and of rays with more crossings than a list holds.
    fn exact_dispatches(
        &self,
        kernel: &Kernel,
        push: ExactPush,
        (uploads, begin): (&[Upload<'_>], Commands<'_>),
        [lost, longer]: [&mut u32; 2],
    ) -> Result<Duration> {
        let b = &self.batch;
        let room = LISTED / push.capacity;
        let most = if room < GROUP { room } else { room / GROUP * GROUP };
        let stride = most.min(GROUP);
        let mut time = Duration::ZERO;
        let mut pace = Pace::new(most.min(4096), stride, most);
        let all = push.count;
        let mut first = 0;
        while first < all {
            let count = all.min(first + pace.size());
            let push = ExactPush { first, count, stride, ..push };
            let groups = [(count - first).div_ceil(GROUP), 1, 1];
            let record = |r: &mut Recorder<'_>| {
                if first == 0 {
                    begin(r);
                }
                r.dispatch(kernel, bytemuck::bytes_of(&push), groups);
            };
            let uploads = if first == 0 { uploads } else { &[] };
            let mut counts = [
                Download::new(&b.unbalanced, 0, std::slice::from_mut(&mut *lost)),
                Download::new(&b.longer, 0, std::slice::from_mut(&mut *longer)),
            ];
            let is_last = count == all;
            let counts = if is_last { &mut counts[..] } else { &mut [] };
            let took = self.device.run_with(uploads, record, counts)?;
            first = count;
            time += took;
            pace.adapt(took);
        }
        Ok(time)
    }
}
