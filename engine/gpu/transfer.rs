//! Bytes for and of buffers, in the submission that works on them. Where the host does not reach the memory
//! of a buffer they go through staging buffers, which are kept for the next submission.

use super::buffer::Buffer;
use super::device::{Device, lock};
use super::recorder::Recorder;
use super::staging::Staging;
use super::submission::{Recording, once};
use super::{Memory, failure};
use ash::vk;
use beamlet_core::Result;
use bytemuck::{AnyBitPattern, NoUninit};
use std::sync::Arc;
use std::time::Duration;

/// Largest staging buffer, bytes; more is copied in parts.
pub(super) const MOST: u64 = 64 << 20;
/// Smallest one.
const LEAST: u64 = 64 << 10;
/// Staging buffers that are kept.
const KEPT: usize = 4;
/// Places in a staging buffer are multiples of it, bytes.
const ALIGN: u64 = 16;

/// Bytes for a buffer, which are there before the work of a submission.
#[derive(Debug, Clone, Copy)]
pub struct Upload<'a> {
    buffer: &'a Buffer,
    offset: u64,
    bytes: &'a [u8],
}

impl<'a> Upload<'a> {
    /// A slice for a byte offset of a buffer.
    ///
    /// # Panics
    /// Where the slice does not fit.
    pub fn new<T: NoUninit>(buffer: &'a Buffer, offset: u64, content: &'a [T]) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(content);
        buffer.check(offset, bytes.len() as u64);
        Self { buffer, offset, bytes }
    }
}

/// Bytes of a buffer as they are after the work of a submission.
#[derive(Debug)]
pub struct Download<'a> {
    buffer: &'a Buffer,
    offset: u64,
    bytes: &'a mut [u8],
}

impl<'a> Download<'a> {
    /// Values from a byte offset of a buffer.
    ///
    /// # Panics
    /// Where the buffer is shorter.
    pub fn new<T: NoUninit + AnyBitPattern>(
        buffer: &'a Buffer,
        offset: u64,
        values: &'a mut [T],
    ) -> Self {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(values);
        buffer.check(offset, bytes.len() as u64);
        Self { buffer, offset, bytes }
    }
}

impl Device {
    /// Puts bytes into buffers, records and submits work, waits, and gets bytes of buffers: one submission.
    /// Where the bytes are more than a staging buffer holds, there are more.
    ///
    /// # Errors
    /// As [`Device::run`].
    pub fn run_with(
        self: &Arc<Self>,
        uploads: &[Upload<'_>],
        record: impl FnOnce(&mut Recorder<'_>),
        downloads: &mut [Download<'_>],
    ) -> Result<Duration> {
        self.run_recorded(uploads, &mut once(record), downloads)
    }

    fn run_recorded(
        self: &Arc<Self>,
        uploads: &[Upload<'_>],
        record: Recording<'_>,
        downloads: &mut [Download<'_>],
    ) -> Result<Duration> {
        // Places of all in one staging buffer; none for memory that the host reaches.
        let mut room = 0;
        let mut place = |buffer: &Buffer, bytes: usize| {
            let at = room;
            let is_staged = buffer.is_staged() && bytes > 0;
            room += if is_staged { (bytes as u64).next_multiple_of(ALIGN) } else { 0 };
            is_staged.then_some(at)
        };
        let up: Vec<_> = uploads.iter().map(|it| place(it.buffer, it.bytes.len())).collect();
        let down: Vec<_> = downloads.iter().map(|it| place(it.buffer, it.bytes.len())).collect();
        if room > MOST {
            for it in uploads {
                it.buffer.write(it.offset, it.bytes)?;
            }
            let time = self.run(record)?;
            for it in downloads {
                it.buffer.read_into(it.offset, it.bytes)?;
            }
            return Ok(time);
        }
        let sent: u64 = uploads.iter().map(|it| it.bytes.len() as u64).sum();
        let fetched: u64 = downloads.iter().map(|it| it.bytes.len() as u64).sum();
        let mut counters = lock(&self.counters);
        counters.traffic.bytes_to_device += sent;
        counters.traffic.bytes_to_host += fetched;
        drop(counters);

        let staging = if room > 0 { Some(self.take_staging(room)?) } else { None };
        let pointer = |buffer: &Buffer, offset: u64, place: Option<u64>| match (place, &staging) {
            (Some(at), Some(staging)) => staging.at(at),
            _ => buffer.mapped(offset),
        };
        for (it, place) in uploads.iter().zip(&up) {
            if let Some(pointer) = pointer(it.buffer, it.offset, *place) {
                // SAFETY: the range was checked, the memory is mapped and no submission uses it, and
                // `bytes` is host memory apart from it.
                unsafe { pointer.copy_from_nonoverlapping(it.bytes.as_ptr(), it.bytes.len()) };
            }
        }
        let raw = staging.as_ref().map(|staging| staging.raw);
        let done = self.run(|r| {
            for (it, at) in uploads.iter().zip(&up) {
                if let (Some(at), Some(raw)) = (*at, raw) {
                    r.copy_raw(raw, at, it.buffer.raw(), it.offset, it.bytes.len() as u64);
                }
            }
            if up.iter().any(Option::is_some) {
                r.barrier();
            }
            record(r);
            if down.iter().any(Option::is_some) {
                r.barrier();
            }
            for (it, at) in downloads.iter().zip(&down) {
                if let (Some(at), Some(raw)) = (*at, raw) {
                    r.copy_raw(it.buffer.raw(), it.offset, raw, at, it.bytes.len() as u64);
                }
            }
        });
        let time = match done {
            Ok(time) => time,
            Err(error) => {
                // Work may still use it.
                lock(&self.withdrawn).extend(staging);
                return Err(error);
            }
        };
        for (it, place) in downloads.iter_mut().zip(&down) {
            if let Some(pointer) = pointer(it.buffer, it.offset, *place) {
                // SAFETY: as above, the other way round; the work has ended.
                unsafe { pointer.copy_to_nonoverlapping(it.bytes.as_mut_ptr(), it.bytes.len()) };
            }
        }
        if let Some(staging) = staging {
            self.keep_staging(staging);
        }
        Ok(time)
    }

    /// Gets bytes of buffers: in one submission where the host does not reach the memory of all, in none where
    /// it does.
    ///
    /// # Errors
    /// As [`Device::run`].
    pub fn read(self: &Arc<Self>, downloads: &mut [Download<'_>]) -> Result<()> {
        if downloads.iter().any(|it| it.buffer.is_staged()) {
            return self.run_with(&[], |_| {}, downloads).map(drop);
        }
        downloads.iter_mut().try_for_each(|it| it.buffer.read_into(it.offset, &mut *it.bytes))
    }

    /// A staging buffer of at least this many bytes.
    fn take_staging(self: &Arc<Self>, bytes: u64) -> Result<Staging> {
        let mut kept = lock(&self.kept);
        if let Some(at) = kept.iter().position(|staging| staging.bytes >= bytes) {
            return Ok(kept.swap_remove(at));
        }
        drop(kept);
        let bytes = bytes.next_power_of_two().max(LEAST);
        let (raw, memory) = self.buffer("staging", bytes, Memory::Host)?.into_parts();
        let unmapped = || failure::vulkan("staging", vk::Result::ERROR_MEMORY_MAP_FAILED);
        Ok(Staging { raw, memory: memory.ok_or_else(unmapped)?, bytes })
    }

    /// Keeps a staging buffer for the next submission, and destroys the smallest of too many.
    fn keep_staging(&self, staging: Staging) {
        let mut kept = lock(&self.kept);
        kept.push(staging);
        if kept.len() > KEPT {
            kept.sort_by_key(|staging| staging.bytes);
            let smallest = kept.remove(0);
            drop(kept);
            self.retire(smallest.retired());
        }
    }
}
