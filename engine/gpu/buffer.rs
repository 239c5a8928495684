//! A buffer: memory with a device address.

use super::device::{Device, lock};
use super::failure;
use super::retire::Retired;
use super::transfer::{self, Download, Upload};
use ash::vk;
use beamlet_core::{Result, numbers};
use bytemuck::{AnyBitPattern, NoUninit, Pod};
use gpu_allocator::vulkan::Allocation;
use std::fmt;
use std::sync::Arc;

/// Bytes of a guard behind a buffer, and their value.
const GUARD: usize = 1 << 16;
const UNTOUCHED: u8 = 0xa5;

/// Bytes of a buffer of `len` bytes: Vulkan knows no empty buffers; whole words can be filled.
const fn whole_size(len: u64) -> u64 {
    if len < 16 { 16 } else { len.next_multiple_of(16) }
}

/// Where a buffer lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Memory {
    /// Fast for the device. Mapped too where the device shares the host's memory.
    Device,
    /// Mapped and fast to read for the host; the device may reach it slowly.
    Host,
}

/// Memory with a device address. The host must not read or write bytes that a running submission uses.
pub struct Buffer {
    device: Arc<Device>,
    raw: vk::Buffer,
    /// `None` only while it is being dropped.
    memory: Option<Allocation>,
    name: String,
    len: u64,
    address: u64,
    staged: bool,
}

impl Device {
    /// A buffer of `bytes` bytes; the content is undefined. `name` describes it in errors.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`] where there is not that much.
    pub fn buffer(self: &Arc<Self>, name: &str, bytes: u64, memory: Memory) -> Result<Buffer> {
        let mut usage = vk::BufferUsageFlags::empty();
        if self.structures.is_some() {
            usage |= vk::BufferUsageFlags::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR;
        }
        Buffer::new(self, name, bytes, memory, usage)
    }

    /// A device buffer with the content of a slice.
    ///
    /// # Errors
    /// As [`Device::buffer`]; [`beamlet_core::Error::Device`] where the copy fails.
    pub fn upload<T: NoUninit>(self: &Arc<Self>, name: &str, content: &[T]) -> Result<Buffer> {
        let buffer = self.buffer(name, size_of_val(content) as u64, Memory::Device)?;
        buffer.write(0, content)?;
        Ok(buffer)
    }
}

impl Buffer {
    /// A buffer of `bytes` bytes; `name` appears in messages.
    ///
    /// # Errors
    ///
    /// `Error::Memory` or `Error::Device`.
    pub(super) fn new(
        device: &Arc<Device>,
        name: &str,
        bytes: u64,
        memory: Memory,
        usage: vk::BufferUsageFlags,
    ) -> Result<Self> {
        use vk::BufferUsageFlags as Usage;
        let limit = device.physical.description.max_allocation_bytes;
        if bytes > limit {
            return Err(failure::too_large(name, bytes, limit));
        }
        let size = whole_size(bytes) + if device.guards { GUARD as u64 } else { 0 };
        let usage = usage
            | Usage::STORAGE_BUFFER
            | Usage::SHADER_DEVICE_ADDRESS
            | Usage::INDIRECT_BUFFER
            | Usage::TRANSFER_SRC
            | Usage::TRANSFER_DST;
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: the device is alive; the size is within its limit and not zero.
        let raw = unsafe { device.raw.create_buffer(&info, None) }
            .map_err(|e| failure::vulkan(name, e))?;
        // SAFETY: `raw` was just made by this device.
        let requirements = unsafe { device.raw.get_buffer_memory_requirements(raw) };
        let allocation = device.allocate(name, requirements, memory).inspect_err(|_| {
            // SAFETY: nothing uses the buffer yet.
            unsafe { device.raw.destroy_buffer(raw, None) }
        })?;
        let mapped = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let staged = allocation.mapped_ptr().is_none()
            || !allocation.memory_properties().contains(mapped)
            || (device.staging && memory == Memory::Device);
        // SAFETY: the allocation satisfies the requirements of this buffer and is bound once.
        let bound =
            unsafe { device.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        {
            let traffic = &mut lock(&device.counters).traffic;
            traffic.buffers += 1;
            traffic.buffer_bytes += bytes;
        }
        let mut buffer = Self {
            device: device.clone(),
            raw,
            memory: Some(allocation),
            name: name.to_owned(),
            len: bytes,
            address: 0,
            staged,
        };
        bound.map_err(|e| failure::vulkan(name, e))?;
        if let Some(guard) = buffer.guard() {
            // SAFETY: the memory behind the buffer is mapped and its own.
            unsafe { guard.write_bytes(UNTOUCHED, GUARD) };
        }
        let info = vk::BufferDeviceAddressInfo::default().buffer(raw);
        // SAFETY: the buffer is bound to memory and was made for device addresses.
        buffer.address = unsafe { device.raw.get_buffer_device_address(&info) };
        device.name(raw, name);
        Ok(buffer)
    }

    /// Address for kernels.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Length in bytes, as requested.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// True if the length is zero.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Contents of the buffer.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The handle of Vulkan.
    pub(super) fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Writes a slice at a byte offset, and waits until it is there.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Device`] or [`beamlet_core::Error::Memory`] where the copy fails.
    ///
    /// # Panics
    /// Where the slice does not fit.
    pub fn write<T: NoUninit>(&self, offset: u64, content: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        self.check(offset, bytes.len() as u64);
        if let Some(pointer) = self.mapped(offset) {
            lock(&self.device.counters).traffic.bytes_to_device += bytes.len() as u64;
            // SAFETY: the range was checked, the memory is mapped while the buffer lives, and
            // `bytes` is host memory apart from it.
            unsafe { pointer.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
            return Ok(());
        }
        let mut at = offset;
        for part in bytes.chunks(numbers::length(transfer::MOST)) {
            self.device.run_with(&[Upload::new(self, at, part)], |_| {}, &mut [])?;
            at += part.len() as u64;
        }
        Ok(())
    }

    /// Reads `count` values from a byte offset.
    ///
    /// # Errors
    /// As [`Buffer::write`].
    ///
    /// # Panics
    /// Where the buffer is shorter.
    pub fn read<T: Pod>(&self, offset: u64, count: usize) -> Result<Vec<T>> {
        let mut values = bytemuck::zeroed_vec(count);
        self.read_into(offset, &mut values)?;
        Ok(values)
    }

    /// Reads from a byte offset into a slice.
    ///
    /// # Errors
    /// As [`Buffer::write`].
    ///
    /// # Panics
    /// Where the buffer is shorter.
    pub fn read_into<T: NoUninit + AnyBitPattern>(
        &self,
        offset: u64,
        values: &mut [T],
    ) -> Result<()> {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(values);
        self.check(offset, bytes.len() as u64);
        if let Some(pointer) = self.mapped(offset) {
            lock(&self.device.counters).traffic.bytes_to_host += bytes.len() as u64;
            // SAFETY: as in `write`, the other way round.
            unsafe { pointer.copy_to_nonoverlapping(bytes.as_mut_ptr(), bytes.len()) };
            return Ok(());
        }
        let mut at = offset;
        for part in bytes.chunks_mut(numbers::length(transfer::MOST)) {
            let length = part.len() as u64;
            self.device.run_with(&[], |_| {}, &mut [Download::new(self, at, part)])?;
            at += length;
        }
        Ok(())
    }

    /// Asserts that a range of bytes lies in the buffer.
    ///
    /// # Panics
    ///
    /// Where it does not.
    pub(super) fn check(&self, offset: u64, bytes: u64) {
        assert!(
            offset.checked_add(bytes).is_some_and(|end| end <= self.len),
            "bytes {offset} + {bytes} are not in {} of {} bytes",
            self.name,
            self.len
        );
    }

    /// The mapped byte at an offset, where the host may use the memory directly.
    pub(super) fn mapped(&self, offset: u64) -> Option<*mut u8> {
        if self.staged { None } else { self.byte(offset) }
    }

    /// The byte at an offset, where the memory is mapped.
    fn byte(&self, offset: u64) -> Option<*mut u8> {
        let pointer = self.memory.as_ref()?.mapped_ptr()?.cast::<u8>();
        let offset = usize::try_from(offset).ok()?;
        // SAFETY: callers give offsets in the buffer or of its guard, and so in its mapped memory.
        Some(unsafe { pointer.as_ptr().add(offset) })
    }

    /// Memory behind the buffer where it has a guard, [`GUARD`] bytes.
    fn guard(&self) -> Option<*mut u8> {
        if self.device.guards { self.byte(whole_size(self.len)) } else { None }
    }

    /// Counts a buffer that was written beyond its end.
    fn check_guard(&self) {
        let Some(guard) = self.guard() else { return };
        // SAFETY: these bytes are mapped, and no kernel is to write them.
        let bytes = unsafe { std::slice::from_raw_parts(guard, GUARD) };
        if bytes.iter().any(|byte| *byte != UNTOUCHED) {
            lock(&self.device.counters).overflows += 1;
            log::error!("{} of {} bytes: written beyond its end", self.name, self.len);
        }
    }

    /// True where the host reaches the memory by copies on the device alone.
    pub(super) const fn is_staged(&self) -> bool {
        self.staged
    }

    /// The buffer of Vulkan and its memory, for a new owner.
    pub(super) fn into_parts(mut self) -> (vk::Buffer, Option<Allocation>) {
        // Dropped without memory it destroys nothing.
        (self.raw, self.memory.take())
    }
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Buffer")
            .field("name", &self.name)
            .field("len", &self.len)
            .finish_non_exhaustive()
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.check_guard();
        if let Some(memory) = self.memory.take() {
            self.device.retire(Retired::Buffer(self.raw, memory));
        }
    }
}
