//! What patches in refinement hold in memory.

use super::PatchWork;
use crate::sampling::patch::{PARTS, RECTANGLE};
use crate::sampling::patch_error::KnownErrors;
use beamlet_interface::{Ray, RayResult};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of a ray that is traced: its place, it and its result, each twice.
const RAY: usize = 2 * (size_of::<[f32; 2]>() + size_of::<Ray>() + size_of::<RayResult>());

/// Bytes added by a split: its parts, their known errors, and their rays.
const SPLIT: usize = PARTS as usize * (RECTANGLE + KnownErrors::NODE) + 2 * RAY;

/// Bytes that patches hold together.
pub(super) struct Held {
    bytes: AtomicU64,
    most: u64,
    /// Total size, if above `most`.
    full: AtomicU64,
}

impl Held {
    pub(super) fn new(work: &[PatchWork], most: u64) -> Self {
        Self { bytes: bytes_of(work).into(), most, full: AtomicU64::new(0) }
    }

    pub(super) fn add(&self, bytes: u64) {
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Bytes that patches would hold with the splits that had no room; 0 where all had.
    pub(super) fn full(self) -> u64 {
        self.full.into_inner()
    }

    /// True if this number of further splits fits in memory.
    pub(super) fn takes(&self, splits: usize) -> bool {
        let all = self.bytes.load(Ordering::Relaxed).saturating_add((SPLIT * splits) as u64);
        if all > self.most {
            self.full.fetch_max(all, Ordering::Relaxed);
        }
        all <= self.most
    }
}

/// How refinement ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sampling) enum Refined {
    /// All patches are done.
    Done,
    /// Several hold too many rectangles together; they can be gone on with.
    Crowded,
    /// They would hold this many bytes, more than there is room for; they can be gone on with.
    Full(u64),
}

/// Bytes that patches in refinement hold.
pub(in crate::sampling) fn bytes_of(work: &[PatchWork]) -> u64 {
    let of_patch = |work: &PatchWork| {
        (work.patch.bytes() + work.known_errors.bytes() + RAY * work.pending.len()) as u64
    };
    work.iter().map(of_patch).sum()
}
