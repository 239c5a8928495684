//! All passes over the rays of a batch, in one submission.

use super::exact::{ExactRays, ExactWalk};
use super::pass::{Pass, Rays};
use super::queues::{LEVELS, Queues};
use super::{Tracer, Wanted};
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Backend, Download, Recorder, Upload};
use beamlet_interface::{QUEUE_EXACT, QUEUE_LEFT, QUEUE_LOST, RayResult, TALLY_COUNTERS};
use beamlet_model::scene::Transport;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Commands before a job, with the barrier that the job needs behind them.
pub(super) type Commands<'a> = &'a dyn Fn(&mut Recorder<'_>);

/// Passes over a batch, one after another.
#[derive(Debug)]
pub(super) struct Job<'k> {
    pub(super) passes: Vec<Pass<'k>>,
    pub(super) walks: Vec<ExactWalk<'k>>,
    /// A walk of all rays, which comes after the last pass of first order: that may be in a second submission.
    pub(super) later: Option<ExactWalk<'k>>,
    /// The software BVH traces rays again that the driver's search leaves.
    pub(super) again: bool,
    pub(super) wanted: Wanted,
}

impl Tracer {
    /// A job for the first `n` rays; `bundled`: as bundles, where the device walks these.
    pub(super) fn job(&self, n: u32, wanted: Wanted, bundled: bool) -> Result<Job<'_>> {
        let walks = self.walks(self.backend);
        let again = self.backend != Backend::Bvh;
        let leaves = bundled && walks.leaves_rays();
        let first =
            self.pass(walks.order_free(bundled), Rays::First(n), wanted, leaves || again)?;
        let mut passes = vec![first];
        if leaves {
            passes.push(self.pass(walks.order_free(false), Rays::Left, wanted, false)?);
        }
        let exact = match wanted {
            Wanted::Moments => None,
            Wanted::RayResults | Wanted::Both => self.exact_rays(ExactRays::All(n)),
        };
        let walk = exact.map(|rays| self.walk(walks, rays)).transpose()?;
        let (later, walk) =
            if again && self.transport == Transport::Exact { (walk, None) } else { (None, walk) };
        Ok(Job { passes, walks: walk.into_iter().collect(), later, again, wanted })
    }

    /// Runs a job after uploads and commands; results and moments as far as there is room for them. Its time, and
    /// the number of rays that are flagged to be traced exactly.
    pub(super) fn run_job<'k>(
        &'k self,
        job: &Job<'k>,
        uploads_and_begin: (&[Upload<'_>], Commands<'_>),
        (results, moments): (&mut [RayResult], &mut [u32]),
    ) -> Result<(Duration, u32)> {
        let (mut time, queues) =
            self.submit_job(job, uploads_and_begin, Queues::EMPTY, (&mut *results, &mut *moments))?;
        let mut exact = queues.rays(QUEUE_EXACT);
        // Rays that the driver's search loses are traced again by the software BVH.
        if self.backend != Backend::Bvh {
            let left = job.again && queues.rays(QUEUE_LEFT) > 0;
            let lost = queues.rays(QUEUE_LOST) > 0;
            if left || lost || job.later.is_some() {
                let (again, before) = self.job_again(job, left, queues)?;
                let (took, queues) =
                    self.submit_job(&again, (&[], &|_| ()), before, (results, moments))?;
                time += took;
                exact += queues.rays(QUEUE_EXACT);
                let retraced = before.rays(QUEUE_LEFT) + queues.rays(QUEUE_LOST);
                self.counts.retraced.fetch_add(retraced.into(), Ordering::Relaxed);
            }
        }
        for walk in job.walks.iter().chain(&job.later) {
            let rays = match walk.rays {
                ExactRays::All(rays) => rays,
                ExactRays::Queued(_) => exact,
                ExactRays::Runs(_) => 0,
            };
            self.counts.exact.fetch_add(rays.into(), Ordering::Relaxed);
        }
        Ok((time, exact))
    }

    /// A job for the rays that the driver's search left or lost, and its queues at the start.
    fn job_again<'k>(
        &'k self,
        job: &Job<'k>,
        left: bool,
        queues: Queues,
    ) -> Result<(Job<'k>, Queues)> {
        let software = self.walks(Backend::Bvh);
        let mut again = Job {
            passes: Vec::new(),
            walks: job.later.into_iter().collect(),
            later: None,
            again: false,
            wanted: job.wanted,
        };
        let mut keep = vec![QUEUE_LOST];
        if left {
            keep.push(QUEUE_LEFT);
            let pass = self.pass(software.order_free(false), Rays::Left, job.wanted, false)?;
            again.passes.push(pass);
            again.walks.extend(&job.walks);
        }
        if let Some(walk) = job.walks.iter().chain(&job.later).next() {
            again.walks.push(ExactWalk { at_nodes: walk.at_nodes, ..self.lost_walk()? });
        }
        Ok((again, queues.only(&keep)))
    }

    /// One submission: `queues` go to the device, and come back as they ended.
    fn submit_job(
        &self,
        job: &Job<'_>,
        (uploads, begin): (&[Upload<'_>], Commands<'_>),
        before: Queues,
        (results, moments): (&mut [RayResult], &mut [u32]),
    ) -> Result<(Duration, Queues)> {
        let b = &self.batch;
        let mut after = before;
        let mut tally = [0; TALLY_COUNTERS];
        let mut uploads = uploads.to_vec();
        let before = [before];
        uploads.push(Upload::new(&b.queues, 0, &before));
        let record = |r: &mut Recorder<'_>| {
            begin(r);
            job.passes.iter().for_each(|pass| self.record_pass(r, pass));
            job.walks.iter().for_each(|walk| self.record_walk(r, walk));
        };
        let mut downloads = [
            Download::new(&b.queues, 0, std::slice::from_mut(&mut after)),
            Download::new(&self.tally, 0, &mut tally),
            Download::new(&b.results, 0, results),
            Download::new(&b.moments, 0, moments),
        ];
        let time = self.device.run_with(&uploads, record, &mut downloads)?;
        self.counts.take(&tally);
        for (kernel, queue) in job.indirect() {
            self.device.count_indirect(kernel, after.groups(queue));
        }
        Ok((time, after))
    }
}

impl Job<'_> {
    /// Kernels of the dispatches whose size the device decides, and their queues.
    fn indirect(&self) -> impl Iterator<Item = (&beamlet_gpu::Kernel, u32)> {
        let passes = self.passes.iter().filter(|pass| pass.rays == Rays::Left);
        let walks = self.walks.iter().flat_map(|walk| {
            let longer = (0..numbers::count(LEVELS) - 1).map(|level| walk.longer + level);
            let own = match walk.rays {
                ExactRays::Queued(queue) => Some(queue),
                ExactRays::All(_) | ExactRays::Runs(_) => None,
            };
            own.into_iter().chain(longer).map(|queue| (walk.kernel, queue))
        });
        passes.map(|pass| (pass.kernel, QUEUE_LEFT)).chain(walks)
    }
}
