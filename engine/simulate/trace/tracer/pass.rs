//! Passes over rays in any order: sums of first order.

use super::Tracer;
use super::kernels::OrderFree;
use beamlet_core::Result;
use beamlet_gpu::{Download, Recorder, Upload};
use beamlet_interface::{RayResult, TracePush};
use std::time::Duration;

/// A pass in any order over rays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pass {
    pub(super) moments: bool,
    /// Number of rays.
    pub(super) n: u32,
    /// They are those that were unbalanced.
    pub(super) listed: bool,
    pub(super) ray_offset: f32,
    pub(super) last: bool,
}

/// Counts of the passes over a batch.
#[derive(Debug)]
pub(super) struct Found {
    /// Number of rays that are unbalanced.
    pub(super) unbalanced: u32,
    /// Number of rays to be traced exactly, of all passes; `None`: not read.
    pub(super) exact: Option<u32>,
}

impl Tracer {
    /// One pass in any order, after `uploads`; its counts go to `found`, and results as far as there is room.
    pub(super) fn pass(
        &self,
        trace: &OrderFree,
        pass: Pass,
        uploads: &[Upload<'_>],
        (found, results): (&mut Found, &mut [RayResult]),
    ) -> Result<Duration> {
        let b = &self.batch;
        let Pass { moments, n, listed, ray_offset, last } = pass;
        let kernel = self.order_free(trace, moments).get()?;
        // Many materials are summed in memory, with or without moments.
        let keep = moments || !self.few;
        let push = TracePush {
            sample_ref: self.sample.record(self.node),
            rays: b.rays.address(),
            moments: if keep { b.moments.address() } else { 0 },
            results: b.results.address(),
            exact: b.exact.address(),
            unbalanced: b.unbalanced.address(),
            list: b.list.address(),
            tally: self.tally.address(),
            count: n,
            materials: self.sample.materials,
            listed: listed.into(),
            last: last.into(),
            ray_offset,
        };
        let mut downloads = vec![
            Download::new(&b.unbalanced, 0, std::slice::from_mut(&mut found.unbalanced)),
            Download::new(&b.results, 0, results),
        ];
        if let Some(exact) = &mut found.exact {
            downloads.push(Download::new(&b.exact, 0, std::slice::from_mut(exact)));
        }
        let record = |r: &mut Recorder<'_>| {
            if listed {
                r.copy(&b.unbalanced, 0, &b.list, 0, (u64::from(n) + 1) * 4);
            } else {
                r.fill(&b.exact, 0, 4, 0);
            }
            r.barrier();
            r.fill(&b.unbalanced, 0, 4, 0);
            r.barrier();
            r.dispatch(kernel, bytemuck::bytes_of(&push), [n.div_ceil(trace.rays), 1, 1]);
        };
        self.device.run_with(uploads, record, &mut downloads)
    }
}
