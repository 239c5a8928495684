//! Commands of one submission, with the fence that signals their end, and timestamps of its dispatches.

use super::failure;
use ash::vk;
use beamlet_core::{Result, numbers};
use std::time::Duration;

/// Timestamps of a submission: two for each dispatch. Later dispatches are not timed.
pub(super) const STAMPS: u32 = 1024;

/// A command buffer with its pool, and the fence that signals its end.
pub(super) struct CommandBatch {
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) fence: vk::Fence,
    /// Null where dispatches are not timed.
    pub(super) stamps: vk::QueryPool,
}

impl CommandBatch {
    pub(super) fn new(raw: &ash::Device, family: u32, timed: bool) -> Result<Self> {
        let failed = |e| failure::vulkan("memory for commands", e);
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the device is alive and has a queue of this family.
        let pool = unsafe { raw.create_command_pool(&info, None) }.map_err(failed)?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was just made; a fence needs nothing.
        let made = unsafe {
            raw.allocate_command_buffers(&info).and_then(|commands| {
                let fence = raw.create_fence(&vk::FenceCreateInfo::default(), None)?;
                let info = vk::QueryPoolCreateInfo::default()
                    .query_type(vk::QueryType::TIMESTAMP)
                    .query_count(STAMPS);
                let stamps = match timed {
                    true => raw
                        .create_query_pool(&info, None)
                        .inspect_err(|_| raw.destroy_fence(fence, None))?,
                    false => vk::QueryPool::null(),
                };
                Ok((commands[0], fence, stamps))
            })
        };
        match made {
            Ok((commands, fence, stamps)) => Ok(Self { pool, commands, fence, stamps }),
            Err(e) => {
                // SAFETY: nothing uses the pool.
                unsafe { raw.destroy_command_pool(pool, None) };
                Err(failed(e))
            }
        }
    }

    /// The number of the first of two timestamps of a dispatch, where there is room.
    pub(super) fn next_stamps(&self, used: u32) -> Option<u32> {
        (self.stamps != vk::QueryPool::null() && used + 2 <= STAMPS).then_some(used)
    }

    /// The timestamps of commands that have ended, in ticks; none where they cannot be read.
    pub(super) fn ticks(&self, raw: &ash::Device, used: u32) -> Vec<u64> {
        let mut ticks = vec![0_u64; numbers::length(used.into())];
        if used == 0 {
            return ticks;
        }
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: the pool has that many, and the commands that wrote them have ended.
        match unsafe { raw.get_query_pool_results(self.stamps, 0, &mut ticks, flags) } {
            Ok(()) => ticks,
            Err(_) => Vec::new(),
        }
    }

    /// True if its work ends within this time (or never will, with the device lost).
    pub(super) fn ends_within(&self, raw: &ash::Device, time: Duration) -> bool {
        let nanoseconds = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        // SAFETY: the fence was submitted with the work.
        let ended = unsafe { raw.wait_for_fences(&[self.fence], true, nanoseconds) };
        ended != Err(vk::Result::TIMEOUT)
    }

    /// Destroys pool, commands and fence.
    ///
    /// # Safety
    /// The device does not run the commands, and `raw` is the device that made them.
    pub(super) unsafe fn destroy(self, raw: &ash::Device) {
        // SAFETY: by the contract of this function.
        unsafe {
            raw.destroy_fence(self.fence, None);
            raw.destroy_query_pool(self.stamps, None);
            raw.destroy_command_pool(self.pool, None);
        }
    }
}
