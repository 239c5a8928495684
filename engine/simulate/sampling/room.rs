//! What refinement may hold in memory, and the patches that wait for their turn.

use super::patch::Node;
use super::refinement::{PatchWork, bytes_of};
use crate::lines::Piece;
use beamlet_core::Error;

/// Bytes of cells that are made of a patch for each byte of its rectangles, with what vectors hold
/// beyond their length while they grow.
const CELLS: u64 = 2;
/// Bytes of lines and of all that is made of them, for each byte of lines.
const BYTES_OF_CELLS: u64 = 6;
/// Most bytes of lines and of all that is made of them.
const MOST_OF_LINES: u64 = 2 << 30;
/// Copies of the moments of both ends of a cell while they are made and written.
pub(super) const MOMENTS: usize = 4;

/// Rays and memory that refinement may hold.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// Rays in memory at a time, about.
    pub(crate) rays_at_once: usize,
    /// Memory limit of a run, and its remainder for refinement, bytes; without a limit one patch may take
    /// any memory.
    pub(crate) limit: Option<[u64; 2]>,
    /// Words of the moments of a ray, where they are recorded.
    pub(crate) words: usize,
}

impl Room {
    /// Rectangles shared by several patches: the planned leaves, with the rectangles that they were split
    /// from.
    pub(super) const fn rectangles(&self) -> usize {
        2 * self.rays_at_once
    }

    /// Bytes of patches and of all that is made of them, for each byte of the patches.
    fn whole(&self) -> u64 {
        let moments = (MOMENTS * 2 * self.words * size_of::<f32>()) as u64;
        1 + CELLS + moments.div_ceil(size_of::<Node>() as u64)
    }

    /// Bytes that patches may hold.
    pub(super) fn bytes(&self) -> u64 {
        self.limit.map_or(u64::MAX, |[_, left]| left / self.whole())
    }

    /// Bytes that lines may hold: cells and rectangles that are made of them take some times as much.
    pub(super) fn bytes_of_lines(&self) -> u64 {
        let moments = (MOMENTS * 2 * self.words * size_of::<f32>()) as u64;
        let each = BYTES_OF_CELLS + moments.div_ceil(size_of::<Piece>() as u64);
        self.limit.map_or(MOST_OF_LINES, |[_, left]| left).min(MOST_OF_LINES) / each
    }

    /// The error of one patch that holds more than there is room for.
    pub(super) fn too_small(&self, (beamlet, row): (i64, i64), parts: &str, bytes: u64) -> Error {
        let [limit, left] = self.limit.unwrap_or([u64::MAX; 2]);
        Error::Memory {
            purpose: format!("refining beamlet {beamlet}, row {row} (its {parts}),"),
            needed: (limit - left).saturating_add(self.whole().saturating_mul(bytes)),
            available: Some(limit),
            remedy: "raise the memory limit or sampling.tolerance, or lower sampling.max_rays"
                .into(),
        }
    }
}

/// Patches whose turn is to come.
pub(super) enum Group {
    /// With the work that is done of them.
    Begun(Vec<PatchWork>),
    /// To be begun.
    Waiting(Vec<(i64, i64)>),
}

impl Group {
    /// Patches that are done.
    pub(super) fn done(&self) -> usize {
        match self {
            Self::Begun(work) => work.iter().filter(|work| work.done).count(),
            Self::Waiting(_) => 0,
        }
    }

    /// Bytes that it holds.
    pub(super) fn bytes(&self) -> u64 {
        match self {
            Self::Begun(work) => bytes_of(work),
            Self::Waiting(_) => 0,
        }
    }

    /// Lets go of the work that is done.
    pub(super) fn let_go(&mut self) {
        if let Self::Begun(work) = self {
            let place = |work: &PatchWork| (work.patch.beamlet, work.patch.row);
            *self = Self::Waiting(work.iter().map(place).collect());
        }
    }
}
