//! Exact transport: several attempts, and lists of crossings as long as each ray needs.

use super::job::Job;
use super::kernels::Walks;
use super::pass::Rays;
use super::queues::{LEVELS, Queues};
use super::{Tracer, Wanted};
use beamlet_core::Result;
use beamlet_core::numbers::count;
use beamlet_gpu::{Backend, Kernel, Recorder, Upload};
use beamlet_interface::{
    ATTEMPTS, ExactPush, GROUP, LONGEST_LIST, NO_QUEUE, QUEUE_EXACT, QUEUE_LONGER, QUEUE_LOST, Ray,
    RayResult,
};
use beamlet_model::scene::Transport;
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Rays at nodes of the spectrum that are traced exactly together at most.
const AT_NODES: u32 = 1 << 15;
/// Crossings that lists of rays that are traced exactly hold at first.
const SHORT_LIST: u32 = 64;
/// Crossings that all lists hold together.
pub(crate) const LISTED: u32 = 1 << 21;

const _: () = assert!(list_of(LEVELS - 1) == LONGEST_LIST && list_of(LEVELS - 2) < LONGEST_LIST);

/// Crossings of a list of a pass.
const fn list_of(level: usize) -> u32 {
    let capacity = SHORT_LIST << (3 * level);
    if capacity < LONGEST_LIST { capacity } else { LONGEST_LIST }
}

/// Rays of the batch that are traced exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExactRays {
    /// This many from the first on.
    All(u32),
    /// The first rays of this many runs of equal ones, each at the energy of its node.
    Runs(u32),
    /// Those of a queue.
    Queued(u32),
}

/// An exact walk over rays, ready to be recorded.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExactWalk<'k> {
    pub(super) kernel: &'k Kernel,
    pub(super) rays: ExactRays,
    /// Each ray has the constants of its node.
    pub(super) at_nodes: bool,
    /// It leaves rays that take another attempt to another walk.
    pub(super) leaves: bool,
    /// First of its queues of longer lists.
    pub(super) longer: u32,
}

impl Tracer {
    /// Traces rays exactly at each node of the spectrum, `[node][ray]`. A ray that is given at
    /// several nodes is searched for its crossings once.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub fn walk_at_nodes(&self, rays: &[Vec<Ray>]) -> Result<Vec<Vec<RayResult>>> {
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
        let mut list = Vec::new();
        let mut end = 0;
        for run in rays.chunk_by(|a, b| a.1 == b.1) {
            list.push(end);
            end += count(run.len());
        }
        let runs = count(list.len());
        list.push(end);
        let mut results = bytemuck::zeroed_vec(rays.len());
        let uploads = [
            Upload::new(&self.batch.rays, 0, &traced),
            Upload::new(&self.batch.nodes, 0, &nodes),
            Upload::new(self.batch.runs(), 0, &list),
        ];
        // The first order is the answer for rays that cannot be followed: it is not tried again.
        let wanted = Wanted::RayResults;
        let first = self.pass(walks.order_free(false), Rays::First(n), wanted, true)?;
        let exact = self.walk(walks, ExactRays::Runs(runs))?;
        let job =
            Job { passes: vec![first], walks: vec![exact], later: None, again: false, wanted };
        self.run_job(&job, (&uploads, &|_| ()), (&mut results, &mut []))?;
        self.counts.rays.fetch_add(n.into(), Ordering::Relaxed);
        self.counts.exact.fetch_add(n.into(), Ordering::Relaxed);
        Ok(results)
    }

    /// The exact walk of a backend over rays.
    pub(super) fn walk<'k>(&self, walks: &'k Walks, rays: ExactRays) -> Result<ExactWalk<'k>> {
        Ok(ExactWalk {
            kernel: walks.exact.get()?,
            rays,
            at_nodes: matches!(rays, ExactRays::Runs(_)),
            leaves: self.backend != Backend::Bvh,
            longer: QUEUE_LONGER,
        })
    }

    /// Rays of the batch that are traced exactly, where `all` of them may be.
    pub(super) const fn exact_rays(&self, all: ExactRays) -> Option<ExactRays> {
        match self.transport {
            Transport::FirstOrder | Transport::Wave => None,
            Transport::Exact => Some(all),
            Transport::Auto => Some(ExactRays::Queued(QUEUE_EXACT)),
        }
    }

    /// The walk of the software BVH over rays that another exact walk loses.
    pub(super) fn lost_walk(&self) -> Result<ExactWalk<'_>> {
        Ok(ExactWalk {
            kernel: self.walks(Backend::Bvh).exact.get()?,
            rays: ExactRays::Queued(QUEUE_LOST),
            at_nodes: false,
            leaves: false,
            longer: QUEUE_LONGER + count(LEVELS),
        })
    }

    /// Records an exact walk: first of all its rays with short lists of crossings, then of rays with more
    /// crossings with longer and longer ones, of which fewer fit the memory.
    pub(super) fn record_walk(&self, r: &mut Recorder<'_>, walk: &ExactWalk<'_>) {
        let b = &self.batch;
        let (queue, count, indices) = match walk.rays {
            ExactRays::All(n) => (NO_QUEUE, n, &b.exact),
            ExactRays::Runs(n) => (NO_QUEUE, n, b.runs()),
            ExactRays::Queued(QUEUE_LOST) => (QUEUE_LOST, 0, &b.lost),
            ExactRays::Queued(queue) => (queue, 0, &b.exact),
        };
        let mut push = ExactPush {
            sample_ref: self.sample.record(self.node),
            rays: b.rays.address(),
            results: b.results.address(),
            queues: b.queues.address(),
            indices: indices.address(),
            lost: b.lost.address(),
            longer: 0,
            lists: self.lists.address(),
            nodes: if walk.at_nodes { b.nodes.address() } else { 0 },
            tally: self.tally.address(),
            queue,
            count,
            all: matches!(walk.rays, ExactRays::All(_)).into(),
            runs: matches!(walk.rays, ExactRays::Runs(_)).into(),
            longer_queue: walk.longer,
            attempts: if walk.leaves { 1 } else { ATTEMPTS },
            capacity: SHORT_LIST,
            stride: GROUP,
            room: LISTED / SHORT_LIST,
        };
        for level in 0..LEVELS {
            let longer = &b.longer[level % 2];
            push.longer = longer.address();
            push.capacity = list_of(level);
            push.room = LISTED / push.capacity;
            push.stride = push.room.min(GROUP);
            r.barrier();
            let bytes = bytemuck::bytes_of(&push);
            if push.queue == NO_QUEUE {
                let groups = push.count.min(push.room).div_ceil(GROUP);
                r.dispatch(walk.kernel, bytes, [groups, 1, 1]);
            } else {
                let at = Queues::groups_at(push.queue);
                r.dispatch_indirect(walk.kernel, bytes, &b.queues, at);
            }
            (push.all, push.runs) = (0, 0);
            push.queue = push.longer_queue;
            push.longer_queue += 1;
            push.indices = longer.address();
        }
    }
}
