//! Kernels of waves, each made when it is first wanted.

use beamlet_gpu::{Device, LazyKernel, push_bytes};
use beamlet_interface::{WaveFieldPush, WaveLinePush};
use std::sync::Arc;

/// Kernels of one device.
#[derive(Debug)]
pub(crate) struct WaveKernels {
    /// Fields of rays.
    pub(super) field: LazyKernel,
    /// Light of lines.
    pub(super) line: LazyKernel,
}

impl WaveKernels {
    /// Kernels of a device.
    #[must_use]
    pub(crate) fn new(device: &Arc<Device>) -> Self {
        Self {
            field: LazyKernel::new(device, "wave_field", push_bytes::<WaveFieldPush>()),
            line: LazyKernel::new(device, "wave_line", push_bytes::<WaveLinePush>()),
        }
    }

    /// All of them.
    pub(crate) const fn all(&self) -> [&LazyKernel; 2] {
        [&self.field, &self.line]
    }
}
