//! Passes over rays in any order: sums of first order.

use super::kernels::OrderFree;
use super::queues::Queues;
use super::{Tracer, Wanted};
use beamlet_core::Result;
use beamlet_gpu::{Kernel, Recorder};
use beamlet_interface::{ATTEMPTS, QUEUE_LEFT, RAYS_COUNTED, RAYS_LEFT, TracePush};

/// Rays of a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Rays {
    /// This many from the first on.
    First(u32),
    /// Those that the pass before left.
    Left,
}

/// A pass in any order over rays, ready to be recorded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pass<'k> {
    pub(super) kernel: &'k Kernel,
    push: TracePush,
    pub(super) rays: Rays,
    rays_of_group: u32,
}

impl Tracer {
    /// A pass; `leaves`: it leaves rays that take another attempt to another pass.
    pub(super) fn pass<'k>(
        &self,
        trace: &'k OrderFree,
        rays: Rays,
        wanted: Wanted,
        leaves: bool,
    ) -> Result<Pass<'k>> {
        let b = &self.batch;
        let moments = wanted != Wanted::RayResults;
        // Many materials are summed in memory, with or without moments.
        let keep = moments || !self.few;
        let push = TracePush {
            sample_ref: self.sample.record(self.node),
            rays: b.rays.address(),
            moments: if keep { b.moments.address() } else { 0 },
            results: b.results.address(),
            queues: b.queues.address(),
            exact: b.exact.address(),
            left: b.left.address(),
            tally: self.tally.address(),
            count: if let Rays::First(n) = rays { n } else { 0 },
            materials: self.sample.materials,
            rays_are: match rays {
                Rays::First(_) => RAYS_COUNTED,
                Rays::Left => RAYS_LEFT,
            },
            attempts: if leaves { 1 } else { ATTEMPTS },
        };
        let kernel = self.order_free(trace, moments).get()?;
        Ok(Pass { kernel, push, rays, rays_of_group: trace.rays })
    }

    /// Records a pass.
    pub(super) fn record_pass(&self, r: &mut Recorder<'_>, pass: &Pass<'_>) {
        let push = bytemuck::bytes_of(&pass.push);
        match pass.rays {
            Rays::First(n) => r.dispatch(pass.kernel, push, [n.div_ceil(pass.rays_of_group), 1, 1]),
            Rays::Left => {
                r.barrier();
                let at = Queues::groups_at(QUEUE_LEFT);
                r.dispatch_indirect(pass.kernel, push, &self.batch.queues, at);
            }
        }
    }
}
