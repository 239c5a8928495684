//! Buffers that grow as needed.

use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Memory};
use std::sync::Arc;

/// A buffer on the device that grows as needed.
#[derive(Debug)]
pub(crate) struct GrowingBuffer {
    device: Arc<Device>,
    name: &'static str,
    buffer: Option<Arc<Buffer>>,
}

impl GrowingBuffer {
    /// A buffer without room. `name` appears in messages.
    pub(crate) fn new(device: &Arc<Device>, name: &'static str) -> Self {
        Self { device: device.clone(), name, buffer: None }
    }

    /// The buffer with room for `items`: the old one where it is large enough.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`].
    pub(crate) fn fit<T>(&mut self, items: usize) -> Result<Arc<Buffer>> {
        let bytes = (items * size_of::<T>()) as u64;
        let buffer = match self.buffer.take().filter(|old| old.len() >= bytes) {
            Some(old) => old,
            None => {
                let bytes = bytes.next_power_of_two();
                Arc::new(self.device.buffer(self.name, bytes, Memory::Device)?)
            }
        };
        Ok(self.buffer.insert(buffer).clone())
    }

    /// The buffer, if it was made.
    pub(crate) fn get(&self) -> Option<&Buffer> {
        self.buffer.as_deref()
    }
}
