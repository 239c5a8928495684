//! Commands of one submission, with the fence that signals their end.

use super::failure;
use ash::vk;
use beamlet_core::Result;
use std::time::Duration;

/// A command buffer with its pool, and the fence that signals its end.
pub(super) struct CommandBatch {
    pub(super) pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    pub(super) fence: vk::Fence,
}

impl CommandBatch {
    pub(super) fn new(raw: &ash::Device, family: u32) -> Result<Self> {
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
                Ok((commands[0], fence))
            })
        };
        match made {
            Ok((commands, fence)) => Ok(Self { pool, commands, fence }),
            Err(e) => {
                // SAFETY: nothing uses the pool.
                unsafe { raw.destroy_command_pool(pool, None) };
                Err(failed(e))
            }
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
            raw.destroy_command_pool(self.pool, None);
        }
    }
}
