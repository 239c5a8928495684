//! Buffers of the rays that are traced together.

use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Memory};
use beamlet_interface::{Ray, RayResult};
use std::sync::Arc;

/// Buffers of one batch.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) capacity: u32,
    pub(crate) rays: Buffer,
    pub(crate) moments: Buffer,
    pub(crate) results: Buffer,
    pub(crate) exact: Buffer,
    pub(crate) unbalanced: Buffer,
    pub(crate) list: Buffer,
    pub(crate) longer: Buffer,
    pub(super) long_list: Buffer,
    pub(crate) nodes: Buffer,
}

impl Batch {
    /// `words`: of the moments of a ray.
    pub(super) fn new(device: &Arc<Device>, capacity: u32, words: usize) -> Result<Self> {
        let n = u64::from(capacity);
        let words = words as u64;
        let make = |name: &str, bytes: u64| device.buffer(name, bytes, Memory::Device);
        Ok(Self {
            capacity,
            rays: make("rays", n * size_of::<Ray>() as u64)?,
            moments: make("moments", n * words * 4)?,
            results: make("results", n * size_of::<RayResult>() as u64)?,
            exact: make("rays to trace exactly", (n + 2) * 4)?,
            unbalanced: make("unbalanced rays", (n + 1) * 4)?,
            list: make("rays to trace again", (n + 1) * 4)?,
            longer: make("rays of many crossings", (n + 1) * 4)?,
            long_list: make("rays of many crossings to trace", (n + 1) * 4)?,
            nodes: make("energies of rays", n * 4)?,
        })
    }
}
