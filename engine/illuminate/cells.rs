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
use crate::gpu::{Buffer, Device, Kernel, LazyKernel, Memory, shaders};
use crate::trace::{Strips, push_bytes};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

/// Invocations per workgroup in illuminate.comp.
const GROUP: u32 = 64;
/// Dispatches longer than this are cut.
const LONG: Duration = Duration::from_millis(100);

/// Mask steps of an invocation: what it reads of a strip serves all of them.
const STEPS_EACH: u32 = 16;

/// The kernels of cells.
#[derive(Debug)]
pub struct CellKernels {
    near: LazyKernel,
    /// For light that lands more than a row away.
    far: LazyKernel,
}

impl CellKernels {
    /// Kernels of a device.
    #[must_use]
    pub fn new(device: &Arc<Device>) -> Self {
        let kernel =
            |name, spirv| LazyKernel::new(device, name, spirv, push_bytes::<IlluminatePush>());
        Self {
            near: kernel("illuminate", shaders::ILLUMINATE),
            far: kernel("illuminate far", shaders::ILLUMINATE_FAR),
        }
    }
}

/// Illuminates cells.
#[derive(Debug)]
pub struct CellIlluminator {
    device: Arc<Device>,
    kernels: Arc<CellKernels>,
    strips: Option<Buffer>,
    cells: Option<Buffer>,
    /// Strips times steps of a dispatch, adapted.
    load: u64,
}

impl CellIlluminator {
    /// An illuminator, its kernel made.
    ///
    /// # Errors
    /// [`crate::Error::Device`], [`crate::Error::Memory`].
    pub fn new(device: &Arc<Device>, kernels: &Arc<CellKernels>) -> Result<Self> {
        kernels.near.get()?;
        Ok(Self {
            device: device.clone(),
            kernels: kernels.clone(),
            strips: None,
            cells: None,
            load: 1 << 16,
        })
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
        // Light of parts of a spot that spread differently over rows has its own kernel, as has
        // that of cells which lands far off.
        let near = |strip: &&Strip| !light.rows_apart && lands_near(&strips.cells, strip);
        let mut ordered = Cow::from(&strips.strips);
        let mut near_count = strips.strips.len() as u32;
        if !strips.strips.iter().all(|strip| near(&strip)) {
            let (mut first, far): (Vec<_>, Vec<_>) = strips.strips.iter().partition(&near);
            near_count = first.len() as u32;
            first.extend(far);
            ordered = first.into_iter().copied().collect();
        }
        fit::<Strip>(&self.device, &mut self.strips, "strips", &ordered)?;
        fit::<Cell>(&self.device, &mut self.cells, "cells", &strips.cells)?;
        let kernels = self.kernels.clone();
        self.dispatch(kernels.near.get()?, light, sums, 0..near_count, steps)?;
        if near_count < ordered.len() as u32 {
            self.dispatch(
                kernels.far.get()?,
                light,
                sums,
                near_count..ordered.len() as u32,
                steps,
            )?;
        }
        Ok(())
    }

    fn dispatch(
        &mut self,
        kernel: &Kernel,
        light: &LightRecord,
        sums: &Sums,
        strips: Range<u32>,
        steps: u32,
    ) -> Result<()> {
        let (Some(strip_buffer), Some(cell_buffer)) = (&self.strips, &self.cells) else {
            return Ok(());
        };
        // Light that no sample mask moves is the same at every step.
        let (steps, repeats) = if light.same_at_all_steps { (1, steps) } else { (steps, 1) };
        for light in light.addresses() {
            let mut first_strip = strips.start;
            while first_strip < strips.end {
                let left = strips.end - first_strip;
                let strip_count = left.min(self.load.min(1 << 20) as u32).max(1);
                let at_once =
                    ((self.load / u64::from(strip_count)).clamp(1, 4096) as u32).min(steps);
                let mut first_step = 0;
                while first_step < steps {
                    let last_step = steps.min(first_step + at_once);
                    let steps_each = STEPS_EACH.min(last_step - first_step);
                    let push = IlluminatePush {
                        light_ref: light,
                        strips: strip_buffer.address(),
                        cells: cell_buffer.address(),
                        sums: sums.buffer.address(),
                        strip_count,
                        first_strip,
                        first_step,
                        last_step,
                        steps_each,
                        repeats,
                    };
                    let shares = (last_step - first_step).div_ceil(steps_each);
                    let time = self.device.run(|r| {
                        let groups = [strip_count.div_ceil(GROUP), shares, 1];
                        r.dispatch(kernel, bytemuck::bytes_of(&push), groups);
                    })?;
                    first_step = last_step;
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

/// Whether all light of a strip lands in its row and the two beside it.
fn lands_near(cells: &[Cell], strip: &Strip) -> bool {
    let first = strip.first as usize;
    cells[first..first + strip.count as usize].iter().all(|cell| cell.above >= 0.0)
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
