//! Kernels over many items, in dispatches that a device ends in a fraction of a second.

use super::{Device, Kernel, Pace};
use beamlet_core::{Cancel, Result};
use beamlet_interface::GROUP;
use bytemuck::NoUninit;
use std::sync::Arc;

impl Device {
    /// Runs a kernel with an invocation for each of `items`, in dispatches as `pace` says. `push`
    /// makes the push constants of a dispatch from its first item and the end of its items; `done`
    /// gets the items done so far.
    ///
    /// # Errors
    /// As [`Device::run`]; [`beamlet_core::Error::Interrupted`] where `cancel` was set.
    pub fn run_paced<P: NoUninit>(
        self: &Arc<Self>,
        kernel: &Kernel,
        items: u32,
        (pace, cancel): (&mut Pace, &Cancel),
        push: impl Fn(u32, u32) -> P,
        done: &mut dyn FnMut(u32),
    ) -> Result<()> {
        let mut first = 0;
        while first < items {
            cancel.check()?;
            let n = pace.size().min(items - first);
            let push = push(first, first + n);
            let groups = [n.div_ceil(GROUP), 1, 1];
            let time = self.run(|r| r.dispatch(kernel, bytemuck::bytes_of(&push), groups))?;
            first += n;
            pace.adapt(time);
            done(first);
        }
        Ok(())
    }
}
