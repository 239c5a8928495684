//! Memory of a device: the kind for a buffer, and the free amount.

use super::buffer::Memory;
use super::device::{Device, lock};
use super::failure;
use super::faults::FaultyCall;
use super::physical::DeviceKind;
use ash::vk;
use beamlet_core::{Error, Result};
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use gpu_allocator::{AllocationError, MemoryLocation};
use vk::MemoryPropertyFlags as Flags;

impl Device {
    /// Memory for a buffer.
    pub(super) fn allocate(
        &self,
        name: &str,
        mut requirements: vk::MemoryRequirements,
        memory: Memory,
    ) -> Result<Allocation> {
        self.faults
            .check(FaultyCall::Allocate)
            .map_err(|e| failure::out_of_memory(name, requirements.size, e))?;
        let limit = self.physical.description.max_allocation_bytes;
        if requirements.size > limit {
            return Err(failure::too_large(name, requirements.size, limit));
        }
        let mut location = match memory {
            Memory::Host => MemoryLocation::GpuToCpu,
            Memory::Device => MemoryLocation::GpuOnly,
        };
        if memory == Memory::Device {
            let mapped = requirements.memory_type_bits & self.mapped_device_types();
            if mapped != 0 {
                requirements.memory_type_bits = mapped;
                location = MemoryLocation::GpuToCpu;
            }
        }
        let description = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let mut allocator = lock(&self.allocator);
        let allocator = allocator.as_mut().expect("the device is open");
        let allocated = allocator.allocate(&description).map_err(|e| match e {
            AllocationError::OutOfMemory => {
                let device = vk::Result::ERROR_OUT_OF_DEVICE_MEMORY;
                failure::out_of_memory(name, requirements.size, device)
            }
            // The allocator wraps the host's want of memory in text.
            AllocationError::Internal(text) if text.contains("OUT_OF") => {
                let host = vk::Result::ERROR_OUT_OF_HOST_MEMORY;
                failure::out_of_memory(name, requirements.size, host)
            }
            e => Error::device(format!("memory for {name}"), e.to_string(), ""),
        })?;
        if self.physical.description.kind == DeviceKind::Cpu && !is_backed(&allocated) {
            // Nothing was done with it yet.
            let _ = allocator.free(allocated);
            return Err(failure::not_backed(name, requirements.size));
        }
        Ok(allocated)
    }

    /// Gives memory back.
    pub(super) fn free(&self, memory: Allocation) {
        if let Some(allocator) = lock(&self.allocator).as_mut()
            && let Err(e) = allocator.free(memory)
        {
            log::error!("giving device memory back: {e}");
        }
    }

    /// Bits of the memory types that are as fast for the device as any and that the host can read at full
    /// speed: types of devices that share the host's memory.
    fn mapped_device_types(&self) -> u32 {
        let shares = [DeviceKind::Cpu, DeviceKind::Integrated];
        if !shares.contains(&self.physical.description.kind) {
            return 0;
        }
        let wanted =
            Flags::DEVICE_LOCAL | Flags::HOST_VISIBLE | Flags::HOST_COHERENT | Flags::HOST_CACHED;
        let types = self.memory_types.memory_types_as_slice().iter().zip(0u32..);
        types.filter(|(t, _)| t.property_flags.contains(wanted)).map(|(_, bit)| 1 << bit).sum()
    }
}

/// "Input/output error" of Linux.
#[cfg(target_os = "linux")]
const EIO: i32 = 5;

/// True if mapped memory is there. llvmpipe keeps memory in a file and overlooks that a limit of file
/// sizes keeps it short: the first access beyond its end would end the process. A read through the
/// system fails instead.
#[cfg(target_os = "linux")]
fn is_backed(memory: &Allocation) -> bool {
    use std::os::unix::fs::FileExt;
    let Some(start) = memory.mapped_ptr() else { return true };
    let last = start.addr().get() as u64 + memory.size().max(1) - 1;
    let read =
        std::fs::File::open("/proc/self/mem").and_then(|file| file.read_exact_at(&mut [0], last));
    // Without /proc it stays unknown.
    !read.is_err_and(|error| error.raw_os_error() == Some(EIO))
}

#[cfg(not(target_os = "linux"))]
const fn is_backed(_: &Allocation) -> bool {
    true
}
