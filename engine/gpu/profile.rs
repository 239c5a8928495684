//! Counts of the work that a device was given, since it was opened.

use super::device::{Device, lock};
use super::kernel::Kernel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Dispatches of one kernel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct KernelProfile {
    /// Dispatches with work.
    pub dispatches: u64,
    /// Workgroups of all of them.
    pub groups: u64,
    /// Workgroups of the largest one.
    pub largest: u64,
    /// Time on the device, s; `None` where it was not measured ([`crate::EngineOptions::profile`]) or the
    /// device has no timestamps. Dispatches that overlap count whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
}

impl KernelProfile {
    /// Workgroups of a dispatch, on average; 0 without one.
    #[must_use]
    pub fn mean(&self) -> f64 {
        if self.dispatches == 0 { 0.0 } else { self.groups as f64 / self.dispatches as f64 }
    }

    /// Counts the workgroups of a dispatch.
    fn add(&mut self, groups: u64) {
        self.dispatches += u64::from(groups > 0);
        self.groups += groups;
        self.largest = self.largest.max(groups);
    }

    /// Counts the time of a dispatch.
    fn spend(&mut self, seconds: Option<f64>) {
        if let Some(seconds) = seconds {
            *self.seconds.get_or_insert(0.0) += seconds;
        }
    }
}

/// Bytes over the bus, and submissions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Traffic {
    /// Submissions to the queue.
    pub submissions: u64,
    /// Waits of the host for the end of a submission.
    pub waits: u64,
    /// Bytes that the host wrote to buffers of the device.
    pub bytes_to_device: u64,
    /// Bytes that the host read from buffers of the device.
    pub bytes_to_host: u64,
    /// Buffers made, those for transfers included.
    pub buffers: u64,
    /// Bytes of these buffers.
    #[serde(default)]
    pub buffer_bytes: u64,
}

impl Traffic {
    /// The part after an earlier state of the same device.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self {
            submissions: self.submissions - earlier.submissions,
            waits: self.waits - earlier.waits,
            bytes_to_device: self.bytes_to_device - earlier.bytes_to_device,
            bytes_to_host: self.bytes_to_host - earlier.bytes_to_host,
            buffers: self.buffers - earlier.buffers,
            buffer_bytes: self.buffer_bytes - earlier.buffer_bytes,
        }
    }
}

/// Work of a device for all its users.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Profile {
    /// Submissions and transfers.
    #[serde(flatten)]
    pub traffic: Traffic,
    /// Dispatches by kernel.
    pub kernels: BTreeMap<String, KernelProfile>,
}

/// A dispatch that was recorded: kernel, workgroups, where the host knows them, and the first of its two
/// timestamps, if any.
pub(super) type Dispatched = (Arc<str>, Option<u64>, Option<u32>);

impl Device {
    /// Counts the workgroups of a dispatch whose size the device decided, which has ended; 0: it had no work.
    pub fn count_indirect(&self, kernel: &Kernel, groups: u64) {
        lock(&self.counters).add_groups(&kernel.name, groups);
    }
}

/// The counts of an open device.
#[derive(Debug, Default)]
pub(super) struct Counters {
    pub(super) traffic: Traffic,
    /// Buffers that were written beyond their end, where they have guards.
    pub(super) overflows: u32,
    kernels: BTreeMap<Arc<str>, KernelProfile>,
}

impl Counters {
    /// Counts the dispatches of a submission; `seconds` of a dispatch by its first timestamp.
    pub(super) fn add(&mut self, all: &[Dispatched], seconds: impl Fn(u32) -> Option<f64>) {
        for (name, groups, stamp) in all {
            let of = self.kernels.entry(name.clone()).or_default();
            of.add(groups.unwrap_or(0));
            of.spend(stamp.and_then(&seconds));
        }
    }

    /// Counts the workgroups of a dispatch.
    fn add_groups(&mut self, kernel: &Arc<str>, groups: u64) {
        self.kernels.entry(kernel.clone()).or_default().add(groups);
    }

    /// The counts so far.
    pub(super) fn profile(&self) -> Profile {
        let kernels = self.kernels.iter().map(|(name, of)| (name.to_string(), *of)).collect();
        Profile { traffic: self.traffic, kernels }
    }
}
