//! Contents of a submission: dispatches, copies and fills, in order.

use super::buffer::Buffer;
use super::command_batch::CommandBatch;
use super::device::Device;
use super::kernel::Kernel;
use super::profile::Dispatched;
use ash::vk;
use beamlet_core::Error;
use std::fmt;

/// Records the commands of one submission. Commands may overlap unless a barrier parts them.
/// Submissions themselves do not overlap on the device, and the host sees all that they wrote.
pub struct Recorder<'a> {
    /// The device that runs them.
    pub(super) device: &'a Device,
    pub(super) batch: &'a CommandBatch,
    /// Dispatches so far.
    pub(super) dispatched: Vec<Dispatched>,
    /// Timestamps so far.
    pub(super) stamps: u32,
    /// The first command that could not be recorded.
    pub(super) error: Option<Error>,
}

impl Recorder<'_> {
    /// Runs a kernel with this many workgroups in x, y and z. More than [`Device::max_groups`] make
    /// the submission fail.
    ///
    /// # Panics
    /// Where the push constants are not as long as the kernel's.
    pub fn dispatch(&mut self, kernel: &Kernel, push: &[u8], groups: [u32; 3]) {
        if groups.contains(&0) {
            kernel.check(push);
            return;
        }
        let most = self.device.max_groups();
        if groups.iter().zip(most).any(|(&n, most)| n > most) {
            self.error.get_or_insert_with(|| {
                Error::device(
                    format!("the kernel {}", kernel.name()),
                    format!("a dispatch of {groups:?} workgroups"),
                    format!("the device runs at most {most:?}: use smaller batches"),
                )
            });
            return;
        }
        let all = groups.iter().map(|n| u64::from(*n)).product();
        self.dispatch_by(kernel, push, Some(all), |raw, commands| {
            // SAFETY: the command buffer is recording, and the counts were checked.
            unsafe { raw.cmd_dispatch(commands, groups[0], groups[1], groups[2]) };
        });
    }

    /// Runs a kernel whose workgroups in x, y and z are three words of a buffer when it begins. Its workgroups are
    /// counted by [`Device::count_indirect`].
    ///
    /// # Panics
    /// As [`Recorder::dispatch`]; where the words are not in the buffer.
    pub fn dispatch_indirect(&mut self, kernel: &Kernel, push: &[u8], groups: &Buffer, at: u64) {
        groups.check(at, 12);
        assert!(at.is_multiple_of(4), "{}: whole words", groups.name());
        self.dispatch_by(kernel, push, None, |raw, commands| {
            // SAFETY: the command buffer is recording, and the words were checked to lie in the buffer, which
            // is of this device and is kept until the submission ends.
            unsafe { raw.cmd_dispatch_indirect(commands, groups.raw(), at) };
        });
    }

    /// Binds a kernel with its push constants, and dispatches it, with timestamps around it.
    fn dispatch_by(
        &mut self,
        kernel: &Kernel,
        push: &[u8],
        groups: Option<u64>,
        dispatch: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) {
        kernel.check(push);
        let stamp = self.batch.next_stamps(self.stamps);
        self.dispatched.push((kernel.name.clone(), groups, stamp));
        if stamp.is_some() {
            self.stamp(vk::PipelineStageFlags::TOP_OF_PIPE);
        }
        let (raw, commands) = (&self.device.raw, self.batch.commands);
        // SAFETY: the command buffer is recording, the kernel is of this device and is kept until
        // the submission ends, and push constants were checked.
        unsafe {
            raw.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, kernel.pipeline);
            if !push.is_empty() {
                let stage = vk::ShaderStageFlags::COMPUTE;
                raw.cmd_push_constants(commands, kernel.layout, stage, 0, push);
            }
        }
        dispatch(raw, commands);
        if stamp.is_some() {
            self.stamp(vk::PipelineStageFlags::BOTTOM_OF_PIPE);
        }
    }

    /// Writes a timestamp, for which there is room, where this stage of all before has ended.
    fn stamp(&mut self, stage: vk::PipelineStageFlags) {
        let CommandBatch { commands, stamps, .. } = *self.batch;
        // SAFETY: the command buffer is recording, and the timestamp is in the pool and was reset.
        unsafe { self.device.raw.cmd_write_timestamp(commands, stage, stamps, self.stamps) };
        self.stamps += 1;
    }

    /// Resets the timestamps of an earlier submission.
    pub(super) fn reset_stamps(&self) {
        if let Some(first) = self.batch.next_stamps(0) {
            let CommandBatch { commands, stamps, .. } = *self.batch;
            // SAFETY: the command buffer is recording, and the pool is of this device.
            unsafe {
                self.device.raw.cmd_reset_query_pool(
                    commands,
                    stamps,
                    first,
                    super::command_batch::STAMPS,
                );
            }
        }
    }

    /// Everything before ends, and is seen by everything after.
    pub fn barrier(&mut self) {
        self.barrier_to(vk::PipelineStageFlags::ALL_COMMANDS, vk::AccessFlags::empty());
    }

    /// As [`Recorder::barrier`], and seen by the host.
    pub(super) fn barrier_to_host(&mut self) {
        let stages = vk::PipelineStageFlags::ALL_COMMANDS | vk::PipelineStageFlags::HOST;
        self.barrier_to(stages, vk::AccessFlags::HOST_READ);
    }

    fn barrier_to(&mut self, stages: vk::PipelineStageFlags, reads: vk::AccessFlags) {
        let barrier = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE | reads)];
        // SAFETY: the command buffer is recording.
        unsafe {
            self.device.raw.cmd_pipeline_barrier(
                self.batch.commands,
                vk::PipelineStageFlags::ALL_COMMANDS,
                stages,
                vk::DependencyFlags::empty(),
                &barrier,
                &[],
                &[],
            );
        }
    }

    /// Sets `bytes` bytes from a byte offset on to a repeated word.
    ///
    /// # Panics
    /// Where the range is not in the buffer or not of whole words.
    pub fn fill(&mut self, buffer: &Buffer, offset: u64, bytes: u64, word: u32) {
        buffer.check(offset, bytes);
        assert!(
            offset.is_multiple_of(4) && bytes.is_multiple_of(4),
            "{}: a fill of whole words",
            buffer.name()
        );
        if bytes > 0 {
            // SAFETY: the command buffer is recording and the range was checked; the buffer is of
            // this device and is kept until the submission ends.
            unsafe {
                self.device.raw.cmd_fill_buffer(
                    self.batch.commands,
                    buffer.raw(),
                    offset,
                    bytes,
                    word,
                );
            }
        }
    }

    /// Copies bytes between ranges that were checked.
    pub(super) fn copy_raw(
        &mut self,
        from: vk::Buffer,
        at: u64,
        to: vk::Buffer,
        to_offset: u64,
        bytes: u64,
    ) {
        let region = [vk::BufferCopy::default().src_offset(at).dst_offset(to_offset).size(bytes)];
        // SAFETY: as in `fill`.
        unsafe { self.device.raw.cmd_copy_buffer(self.batch.commands, from, to, &region) };
    }

    /// Copies bytes between two buffers, or between apart ranges of one.
    ///
    /// # Panics
    /// Where a range is not in its buffer.
    pub fn copy(&mut self, from: &Buffer, at: u64, to: &Buffer, to_offset: u64, bytes: u64) {
        from.check(at, bytes);
        to.check(to_offset, bytes);
        if bytes > 0 {
            self.copy_raw(from.raw(), at, to.raw(), to_offset, bytes);
        }
    }
}

impl fmt::Debug for Recorder<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recorder").field("error", &self.error).finish_non_exhaustive()
    }
}
