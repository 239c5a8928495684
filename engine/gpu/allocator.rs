//! The allocator of device memory.

use ash::vk;
use beamlet_core::{Error, Result};
use gpu_allocator::AllocationSizes;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};

/// First and largest size of the blocks that small buffers share, in bytes.
const BLOCK: [u64; 2] = [16 << 20, 256 << 20];

pub(super) fn allocator(
    instance: &ash::Instance,
    device: &ash::Device,
    physical: vk::PhysicalDevice,
) -> Result<Allocator> {
    Allocator::new(&AllocatorCreateDesc {
        instance: instance.clone(),
        device: device.clone(),
        physical_device: physical,
        debug_settings: Default::default(),
        buffer_device_address: true,
        allocation_sizes: AllocationSizes::new(BLOCK[0], BLOCK[0])
            .with_max_device_memblock_size(BLOCK[1])
            .with_max_host_memblock_size(BLOCK[1]),
    })
    .map_err(|e| Error::device("the device memory", e.to_string(), ""))
}
