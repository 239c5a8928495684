//! Buffers of the rays that are traced together.

use super::queues::Queues;
use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Memory};
use beamlet_interface::{Ray, RayResult};
use std::sync::Arc;

/// Bytes of a ray in the buffers of a batch, besides its moments.
pub(crate) const RAY_BYTES: u64 = (size_of::<Ray>() + size_of::<RayResult>() + 6 * 4) as u64;

/// Buffers of one batch.
#[derive(Debug)]
pub(super) struct Batch {
    pub(crate) rays: Buffer,
    pub(crate) moments: Buffer,
    pub(crate) results: Buffer,
    /// Heads of the queues; the indices of their rays have buffers of their own.
    pub(super) queues: Buffer,
    pub(super) exact: Buffer,
    pub(super) left: Buffer,
    pub(super) lost: Buffer,
    /// Rays with more crossings than the lists of a pass hold, by turns.
    pub(super) longer: [Buffer; 2],
    pub(super) nodes: Buffer,
}

impl Batch {
    /// `words`: of the moments of a ray.
    pub(super) fn new(device: &Arc<Device>, capacity: u32, words: usize) -> Result<Self> {
        let n = u64::from(capacity);
        let words = words as u64;
        let make = |name: &str, bytes: u64| device.buffer(name, bytes, Memory::Device);
        Ok(Self {
            rays: make("rays", n * size_of::<Ray>() as u64)?,
            moments: make("moments", n * words * 4)?,
            results: make("results", n * size_of::<RayResult>() as u64)?,
            queues: make("queues of rays", size_of::<Queues>() as u64)?,
            exact: make("rays to trace exactly", n * 4)?,
            left: make("rays that are left", n * 4)?,
            lost: make("rays to follow again", n * 4)?,
            longer: [
                make("rays of many crossings", n * 4)?,
                make("rays of most crossings", (n + 1) * 4)?,
            ],
            nodes: make("energies of rays", n * 4)?,
        })
    }

    /// Indices of runs of equal rays, with one more: no pass writes here before they are read, as passes of
    /// first order write to the other queues.
    pub(super) const fn runs(&self) -> &Buffer {
        &self.longer[1]
    }
}
