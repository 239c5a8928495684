//! Rays that kernels make on the device, in a number that these decide: the passes over them are recorded once and
//! run by indirect dispatches.

use super::exact::{ExactRays, ExactWalk};
use super::pass::{Pass, Rays};
use super::queues::QUEUES;
use super::{Tracer, Wanted};
use beamlet_core::{Result, numbers};
use beamlet_gpu::{Backend, Buffer, Download, Recorder};
use beamlet_interface::TALLY_COUNTERS;
use beamlet_model::scene::Transport;
use std::sync::atomic::Ordering;

/// Passes over the rays that the device made.
#[derive(Debug)]
pub(crate) struct MadeRays<'k> {
    passes: Vec<Pass<'k>>,
    walks: Vec<ExactWalk<'k>>,
    /// Rays of a workgroup of the first pass.
    pub(crate) rays_of_group: u32,
}

/// Number of queues that are emptied before each pass.
pub(crate) const QUEUE_COUNT: u32 = numbers::count(QUEUES);

impl Tracer {
    /// The passes over rays that the device makes, whose number is in `QUEUE_MADE` and `QUEUE_MADE_EXACT` of [`Self::queues`]. All
    /// that another submission would do is in them: rays that the driver's search loses go to the software BVH.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`] where a kernel is not to be had.
    pub(crate) fn made_rays(&self, moments: bool) -> Result<MadeRays<'_>> {
        let wanted = if moments { Wanted::Both } else { Wanted::RayResults };
        let walks = self.walks(self.backend);
        let software = self.walks(Backend::Bvh);
        let again = self.backend != Backend::Bvh;
        let leaves = walks.leaves_rays() || again;
        let first = walks.order_free(true);
        let mut passes = vec![self.pass(first, Rays::Made, wanted, leaves)?];
        if leaves {
            let others = if again { software } else { walks };
            passes.push(self.pass(others.order_free(false), Rays::Left, wanted, false)?);
        }
        let mut exact_walks = Vec::new();
        if let Some(rays) = self.exact_rays(ExactRays::Made) {
            exact_walks.push(self.walk(walks, rays)?);
            if again {
                exact_walks.push(self.lost_walk()?);
            }
        }
        Ok(MadeRays { passes, walks: exact_walks, rays_of_group: first.rays })
    }

    /// Records the passes; a barrier is to part them from what makes the rays, and from what follows.
    pub(crate) fn record_made(&self, r: &mut Recorder<'_>, made: &MadeRays<'_>) {
        made.passes.iter().for_each(|pass| self.record_pass(r, pass));
        made.walks.iter().for_each(|walk| self.record_walk(r, walk));
    }

    /// Heads of the queues, for kernels that make rays.
    pub(crate) const fn queues(&self) -> &Buffer {
        &self.batch.queues
    }

    /// Moments of the rays, `[ray][MOMENTS_HEAD + word]`.
    pub(crate) const fn moments(&self) -> &Buffer {
        &self.batch.moments
    }

    /// Reads the counts of the device; [`Self::take_tally`] takes them before other rays are traced.
    pub(crate) fn read_tally<'t>(&'t self, tally: &'t mut [u32; TALLY_COUNTERS]) -> Download<'t> {
        Download::new(&self.tally, 0, tally)
    }

    /// Takes counts that were read.
    pub(crate) fn take_tally(&self, tally: &[u32; TALLY_COUNTERS]) {
        self.counts.take(tally);
    }

    /// Takes counts of the kernels that made the rays: of all of them, of rays traced exactly, and of rays that
    /// the driver's search left or lost.
    pub(crate) fn count_made(&self, [rays, exact, left]: [u32; 3]) {
        self.counts.rays.fetch_add(rays.into(), Ordering::Relaxed);
        let exact = match self.transport {
            Transport::FirstOrder | Transport::Wave => 0,
            Transport::Exact => rays,
            Transport::Auto => exact,
        };
        self.counts.exact.fetch_add(exact.into(), Ordering::Relaxed);
        if self.backend != Backend::Bvh {
            self.counts.retraced.fetch_add(left.into(), Ordering::Relaxed);
        }
    }
}
