//! A staging buffer.

use super::retire::Retired;
use ash::vk;
use beamlet_core::numbers;
use gpu_allocator::vulkan::Allocation;

/// Mapped memory that bytes go through.
pub(super) struct Staging {
    pub(super) raw: vk::Buffer,
    pub(super) memory: Allocation,
    pub(super) bytes: u64,
}

impl Staging {
    /// The mapped byte at an offset.
    pub(super) fn at(&self, offset: u64) -> Option<*mut u8> {
        let pointer = self.memory.mapped_ptr()?.cast::<u8>();
        // SAFETY: places lie in the buffer, and so in its mapped memory.
        Some(unsafe { pointer.as_ptr().add(numbers::length(offset)) })
    }

    /// The object to destroy.
    pub(super) fn retired(self) -> Retired {
        Retired::Buffer(self.raw, self.memory)
    }
}
