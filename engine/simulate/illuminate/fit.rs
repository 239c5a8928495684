//! Buffers that grow as needed.

use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Memory};
use std::sync::Arc;

/// A buffer that holds `items`: the old one where it is large enough.
///
/// # Errors
/// [`beamlet_core::Error::Memory`].
pub(crate) fn fit<T>(
    device: &Arc<Device>,
    buffer: Option<Buffer>,
    name: &str,
    items: usize,
) -> Result<Buffer> {
    let bytes = (items * size_of::<T>()) as u64;
    match buffer.filter(|old| old.len() >= bytes) {
        Some(old) => Ok(old),
        None => device.buffer(name, bytes.next_power_of_two(), Memory::Device),
    }
}
