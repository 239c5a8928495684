//! Illuminates strips of cells at every mask step.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "counts and indices are bounded by the scene's validation; rounding to f32 is meant"
)]

use super::light::LightRecord;
use super::sums::Sums;
use crate::Result;
use crate::gpu::interface::{Cell, IlluminatePush, Strip};
use crate::gpu::{Buffer, Device, Kernel, Memory, shaders};
use crate::trace::{Strips, push_bytes};
use std::sync::Arc;
use std::time::Duration;

/// Invocations per workgroup in illuminate.comp.
const GROUP: u32 = 64;
/// Dispatches longer than this are cut.
const LONG: Duration = Duration::from_millis(100);

/// Illuminates cells.
#[derive(Debug)]
pub struct CellIlluminator {
    device: Arc<Device>,
    kernel: Arc<Kernel>,
    strips: Option<Buffer>,
    cells: Option<Buffer>,
    /// Strips times steps of a dispatch, adapted.
    load: u64,
}

impl CellIlluminator {
    /// Compiles the kernel.
    ///
    /// # Errors
    /// [`crate::Error::Device`].
    pub fn kernel(device: &Arc<Device>) -> Result<Arc<Kernel>> {
        let bytes = push_bytes::<IlluminatePush>();
        Ok(Arc::new(device.kernel("illuminate", shaders::ILLUMINATE, bytes, None)?))
    }

    /// An illuminator.
    #[must_use]
    pub fn new(device: &Arc<Device>, kernel: &Arc<Kernel>) -> Self {
        Self {
            device: device.clone(),
            kernel: kernel.clone(),
            strips: None,
            cells: None,
            load: 1 << 16,
        }
    }

    /// Adds the light of the strips to the sums, at `steps` mask steps.
    ///
    /// # Errors
    /// [`crate::Error::Memory`], [`crate::Error::Device`].
    pub fn add(
        &mut self,
        light: &LightRecord,
        strips: &Strips,
        sums: &Sums,
        steps: u32,
    ) -> Result<()> {
        if strips.strips.is_empty() || strips.cells.is_empty() {
            return Ok(());
        }
        fit::<Strip>(&self.device, &mut self.strips, "strips", &strips.strips)?;
        fit::<Cell>(&self.device, &mut self.cells, "cells", &strips.cells)?;
        let (Some(strip_buffer), Some(cell_buffer)) = (&self.strips, &self.cells) else {
            return Ok(());
        };
        // Light that no sample mask moves is the same at every step.
        let (steps, repeats) = if light.same_at_all_steps { (1, steps) } else { (steps, 1) };
        let all = strips.strips.len() as u32;
        for light in light.addresses() {
            let mut first_strip = 0;
            while first_strip < all {
                let strip_count = (all - first_strip).min(self.load.min(1 << 20) as u32).max(1);
                let at_once =
                    ((self.load / u64::from(strip_count)).clamp(1, 4096) as u32).min(steps);
                let mut first_step = 0;
                while first_step < steps {
                    let n = at_once.min(steps - first_step);
                    let push = IlluminatePush {
                        light_ref: light,
                        strips: strip_buffer.address(),
                        cells: cell_buffer.address(),
                        sums: sums.buffer.address(),
                        strip_count,
                        first_strip,
                        first_step,
                        repeats,
                    };
                    let time = self.device.run(|r| {
                        let groups = [strip_count.div_ceil(GROUP), n, 1];
                        r.dispatch(&self.kernel, bytemuck::bytes_of(&push), groups);
                    })?;
                    first_step += n;
                    if time > LONG {
                        self.load = (self.load / 2).max(1024);
                    } else if time < LONG / 4 {
                        self.load = (self.load * 2).min(1 << 26);
                    }
                }
                first_strip += strip_count;
            }
        }
        Ok(())
    }
}

/// Writes items into a buffer that grows as needed.
fn fit<T: bytemuck::Pod>(
    device: &Arc<Device>,
    buffer: &mut Option<Buffer>,
    name: &str,
    items: &[T],
) -> Result<()> {
    let bytes = size_of_val(items) as u64;
    if buffer.as_ref().is_none_or(|b| b.len() < bytes) {
        *buffer = None;
        *buffer = Some(device.buffer(name, bytes.next_power_of_two(), Memory::Device)?);
    }
    buffer.as_ref().map_or(Ok(()), |b| b.write(0, items))
}
