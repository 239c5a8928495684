//! Queues of rays between the passes over a batch: the device fills them, and runs the pass of each by an
//! indirect dispatch, so that the host reads no counter between rays and results.

use beamlet_interface::{QUEUE_HEAD, QUEUE_LONGER};

/// Passes of an exact walk, with longer and longer lists: the last hold the longest.
pub(super) const LEVELS: usize = 6;

/// Number of queues: two exact walks have queues of longer lists of their own.
pub(super) const QUEUES: usize = QUEUE_LONGER as usize + 2 * LEVELS;

/// Heads of the queues of a batch: the number of rays, and the workgroups of a dispatch in x, y and z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub(super) struct Queues([[u32; QUEUE_HEAD as usize]; QUEUES]);

impl Queues {
    /// Empty ones.
    pub(super) const EMPTY: Self = Self([[0, 0, 1, 1]; QUEUES]);

    /// Number of rays in a queue.
    pub(super) fn rays(&self, queue: u32) -> u32 {
        self.0[queue as usize][0]
    }

    /// Workgroups of the pass over a queue.
    pub(super) fn groups(&self, queue: u32) -> u64 {
        self.0[queue as usize][1].into()
    }

    /// Offset of the workgroups of a queue, bytes.
    pub(super) const fn groups_at(queue: u32) -> u64 {
        (queue * QUEUE_HEAD + 1) as u64 * 4
    }

    /// These queues, and all others empty.
    pub(super) fn only(&self, kept: &[u32]) -> Self {
        let mut queues = Self::EMPTY;
        for queue in kept {
            queues.0[*queue as usize] = self.0[*queue as usize];
        }
        queues
    }
}
