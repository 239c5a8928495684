//! Work for the device, collected until a result is needed: few submissions, one after another.

use beamlet_core::{Cancel, Result};
use beamlet_gpu::{Buffer, Device, Download, Kernel, Pace};
use beamlet_interface::GROUP;
use bytemuck::NoUninit;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// Direction of a projector, each with a pace of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Back,
}

/// One command; it sees the memory that earlier ones wrote.
enum Step {
    /// Dispatches that do not depend on each other: push constants and workgroups.
    Dispatch(Arc<Kernel>, Vec<(Vec<u8>, u32)>),
    /// A value over and over, for this number of bytes.
    Fill(Arc<Buffer>, u64, f32),
    /// A copy of this number of bytes.
    Copy(Arc<Buffer>, Arc<Buffer>, u64),
}

/// Steps that wait for their submission. A submission contains at most one paced dispatch.
pub(super) struct Stream {
    device: Arc<Device>,
    steps: Vec<Step>,
    /// Buffers that are used by the address alone.
    kept: Vec<Arc<Buffer>>,
    /// Items times their cost of a dispatch.
    paces: [Pace; 2],
    /// The direction of the paced dispatch among the steps, and whether it has its full size.
    paced: Option<(Direction, bool)>,
}

impl fmt::Debug for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stream").field("steps", &self.steps.len()).finish_non_exhaustive()
    }
}

impl Stream {
    pub(super) fn new(device: &Arc<Device>) -> Self {
        let pace = Pace::new(1 << 18, 1 << 14, u32::MAX);
        let (steps, kept) = (Vec::new(), Vec::new());
        Self { device: device.clone(), steps, kept, paces: [pace; 2], paced: None }
    }

    pub(super) const fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Keeps a buffer until the steps so far have ended.
    pub(super) fn keep(&mut self, buffer: &Arc<Buffer>) {
        self.kept.push(buffer.clone());
    }

    pub(super) fn fill(&mut self, buffer: &Arc<Buffer>, bytes: u64, value: f32) {
        self.steps.push(Step::Fill(buffer.clone(), bytes, value));
    }

    pub(super) fn copy(&mut self, from: &Arc<Buffer>, to: &Arc<Buffer>, bytes: u64) {
        self.steps.push(Step::Copy(from.clone(), to.clone(), bytes));
    }

    /// A dispatch of workgroups that share all work, at most as the device has them.
    pub(super) fn dispatch<P: NoUninit>(&mut self, kernel: &Arc<Kernel>, push: &P, groups: u32) {
        let groups = groups.min(self.device.max_groups()[0]);
        let part = (bytemuck::bytes_of(push).to_vec(), groups);
        self.steps.push(Step::Dispatch(kernel.clone(), vec![part]));
    }

    /// An invocation for each of `items`, in dispatches that end in a fraction of a second; the last one
    /// waits with the other steps. `cost`: terms of an item, which differ from call to call; `is_usual`: it has
    /// no fewer here. `push` makes the push constants from the first item and the end of the items; `done`
    /// gets the items so far.
    ///
    /// # Errors
    /// As [`Device::run`]; [`beamlet_core::Error::Interrupted`].
    pub(super) fn paced<P: NoUninit>(
        &mut self,
        (kernel, direction): (&Arc<Kernel>, Direction),
        (items, cost, is_usual): (u32, usize, bool),
        cancel: &Cancel,
        push: impl Fn(u32, u32) -> P,
        done: &mut dyn FnMut(u32),
    ) -> Result<()> {
        let most = self.device.max_groups()[0].saturating_mul(GROUP).max(GROUP);
        let cost = beamlet_core::numbers::count(cost.max(1));
        let kept = self.kept.clone();
        let mut first = 0;
        while first < items {
            cancel.check()?;
            if self.paced.is_some() {
                self.submit(&mut [])?;
                self.kept.clone_from(&kept);
            }
            let size = (self.paces[direction as usize].size() / cost).max(GROUP);
            let end = first + size.min(items - first);
            let parts = (first..end).step_by(beamlet_core::numbers::length(most.into()));
            let part = |at: u32| {
                let until = end.min(at.saturating_add(most));
                (bytemuck::bytes_of(&push(at, until)).to_vec(), (until - at).div_ceil(GROUP))
            };
            self.steps.push(Step::Dispatch(kernel.clone(), parts.map(part).collect()));
            self.paced = Some((direction, is_usual && end - first == size));
            first = end;
            done(first);
        }
        Ok(())
    }

    /// Submits the steps, waits for their end, and gets bytes of buffers.
    ///
    /// # Errors
    /// As [`Device::run_with`].
    pub(super) fn submit(&mut self, downloads: &mut [Download<'_>]) -> Result<()> {
        if self.steps.is_empty() && downloads.is_empty() {
            return Ok(());
        }
        let steps = std::mem::take(&mut self.steps);
        let record = |r: &mut beamlet_gpu::Recorder<'_>| {
            for (n, step) in steps.iter().enumerate() {
                if n > 0 {
                    r.barrier();
                }
                match step {
                    Step::Dispatch(kernel, parts) => {
                        parts.iter().for_each(|(push, groups)| {
                            r.dispatch(kernel, push, [*groups, 1, 1]);
                        });
                    }
                    Step::Fill(buffer, bytes, value) => r.fill(buffer, 0, *bytes, value.to_bits()),
                    Step::Copy(from, to, bytes) => r.copy(from, 0, to, 0, *bytes),
                }
            }
        };
        let time: Duration = self.device.run_with(&[], record, downloads)?;
        if let Some((direction, is_full)) = self.paced.take() {
            let pace = &mut self.paces[direction as usize];
            let before = pace.size();
            let mut next = *pace;
            next.adapt(time);
            // A smaller dispatch that is short says nothing of a full one.
            if is_full || next.size() < before {
                *pace = next;
            }
        }
        self.kept.clear();
        Ok(())
    }
}
