//! Kernels over many items, in dispatches that a device ends in a fraction of a second.

use super::{Device, Download, Kernel, Pace, Recorder, Upload};
use beamlet_core::{Cancel, Result};
use beamlet_interface::GROUP;
use bytemuck::NoUninit;
use std::sync::Arc;

impl Device {
    /// Runs a kernel with an invocation for each of `items`, in dispatches as `pace` says: the first takes
    /// `uploads` along, the last `downloads`. `push` makes the push constants of a dispatch from its first
    /// item and the end of its items; `done` gets the items done so far.
    ///
    /// # Errors
    /// As [`Device::run`]; [`beamlet_core::Error::Interrupted`] where `cancel` was set.
    pub fn run_paced<P: NoUninit>(
        self: &Arc<Self>,
        kernel: &Kernel,
        items: u32,
        (pace, cancel): (&mut Pace, &Cancel),
        (uploads, downloads): (&[Upload<'_>], &mut [Download<'_>]),
        push: impl Fn(u32, u32) -> P,
        done: &mut dyn FnMut(u32),
    ) -> Result<()> {
        let mut first = 0;
        while first < items {
            cancel.check()?;
            let n = pace.size().min(items - first);
            let push = push(first, first + n);
            let groups = [n.div_ceil(GROUP), 1, 1];
            let uploads = if first == 0 { uploads } else { &[] };
            let downloads = if first + n == items { &mut *downloads } else { &mut [] };
            let record = |r: &mut Recorder<'_>| {
                r.dispatch(kernel, bytemuck::bytes_of(&push), groups);
            };
            let time = self.run_with(uploads, record, downloads)?;
            first += n;
            pace.adapt(time);
            done(first);
        }
        Ok(())
    }
}
