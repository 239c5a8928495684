//! Buffers of the refinement, which groups of patches share.

use super::tables::address;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_gpu::{Buffer, Device, Memory};
use beamlet_interface::{
    Cell, CellRow, CellRowPart, HEAD_WORDS, MERGED_COLUMNS, MERGED_WORDS, OCTAVES, PATCH_HEAD,
    REPORT_WORDS, RayResult, Rectangle, RefineParams, RefinedLeaf, RefinedPatch, RefinedRow,
    RefinedWall, RepeatedRectangle,
};
use std::sync::Arc;

/// Bytes for a rectangle: itself, what younger ones ask of it, and its place in lists.
pub(super) const RECTANGLE: u64 = size_of::<Rectangle>() as u64 + 3 * 4 + 2 * 4 + 2 * 4;
/// Bytes for a cell, its row and its part of that, its rectangle and its lists.
pub(super) const CELL: u64 =
    (size_of::<Cell>() + size_of::<CellRow>() + 2 * size_of::<CellRowPart>() + 8 * 4) as u64;

/// Bytes for a cell under a spectrum beyond these: its list, and a ray to trace at each energy.
pub(super) const CELL_OF_SPECTRUM: u64 = 3 * 4 + size_of::<RepeatedRectangle>() as u64;

/// Bytes for a rectangle whose cell the host makes beyond these: its result.
pub(super) const RECTANGLE_OF_HOST: u64 = size_of::<RayResult>() as u64;
/// Bytes for a cell that the host makes, in place of [`CELL`]: its leaf.
pub(super) const CELL_OF_HOST: u64 = size_of::<RefinedLeaf>() as u64;

/// Bytes of the sums of leaked light of a patch in these groups.
pub(super) const fn merged_bytes(groups: u64) -> u64 {
    4 * groups * (MERGED_COLUMNS * MERGED_WORDS) as u64
}

/// Sizes of buffers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sizes {
    /// Rectangles.
    pub(super) room: u32,
    pub(super) cells: u32,
    pub(super) patches: u32,
    pub(super) rows: u32,
    pub(super) walls: u32,
    /// Words of the sums of all patches.
    pub(super) sums: u64,
    /// Words that are kept of the moments of a ray, and groups of light, under a spectrum.
    pub(super) spectrum: Option<[u32; 2]>,
    /// The host makes the cells.
    pub(super) leaves: bool,
}

impl Sizes {
    /// Words of the sums of a patch.
    pub(super) fn sums_of_patch(steps: u32) -> u64 {
        u64::from(PATCH_HEAD + 4 * OCTAVES) + 4 * (u64::from(steps) + 1)
    }

    /// Bytes of the sums of leaked light of patches.
    pub(super) fn merged_bytes(&self, patches: usize) -> u64 {
        let [_, groups] = self.spectrum.unwrap_or_default();
        merged_bytes(groups.into()) * patches as u64
    }

    fn fits(&self, other: &Self) -> bool {
        self.room == other.room
            && self.cells == other.cells
            && self.spectrum == other.spectrum
            && self.leaves == other.leaves
            && self.patches >= other.patches
            && self.rows >= other.rows
            && self.walls >= other.walls
            && self.sums >= other.sums
    }
}

/// Buffers.
#[derive(Debug)]
pub(super) struct Buffers {
    pub(super) sizes: Sizes,
    pub(super) params: Buffer,
    pub(super) head: Buffer,
    pub(super) report: Buffer,
    pub(super) patches: Buffer,
    pub(super) rows: Buffer,
    pub(super) walls: Buffer,
    pub(super) sums: Buffer,
    pub(super) rectangles: Buffer,
    pub(super) lists: Buffer,
    pub(super) splits: Buffer,
    pub(super) asked: Buffer,
    pub(super) again: Buffer,
    pub(super) cells: Buffer,
    pub(super) cell_rows: Buffer,
    pub(super) parts: Buffer,
    pub(super) made: Buffer,
    pub(super) runs: Buffer,
    /// Moments of rectangles, the lists that cells are in, and sums of leaked light, under a spectrum.
    pub(super) kept: Option<Buffer>,
    pub(super) marks: Option<Buffer>,
    pub(super) merged: Option<Buffer>,
    /// Rectangles whose rays are traced at each energy.
    pub(super) repeated: Option<Buffer>,
    /// Results by rectangle, and leaves of a submission, where the host makes the cells.
    pub(super) results: Option<Buffer>,
    pub(super) leaves: Option<Buffer>,
}

impl Buffers {
    /// Those that there are, if they are large enough, or new ones.
    pub(super) fn fit(device: &Arc<Device>, known: Option<Self>, sizes: Sizes) -> Result<Self> {
        match known {
            Some(known) if known.sizes.fits(&sizes) => Ok(known),
            known => {
                let sizes = match known.map(|known| known.sizes) {
                    Some(before) => Sizes {
                        patches: sizes.patches.max(before.patches),
                        rows: sizes.rows.max(before.rows),
                        walls: sizes.walls.max(before.walls),
                        sums: sizes.sums.max(before.sums),
                        ..sizes
                    },
                    None => sizes,
                };
                Self::new(device, sizes)
            }
        }
    }

    fn new(device: &Arc<Device>, sizes: Sizes) -> Result<Self> {
        let make = |name: &str, count: u64, bytes: usize| {
            device.buffer(name, (count * bytes as u64).max(4), Memory::Device)
        };
        let of_spectrum =
            |make: &dyn Fn([u32; 2]) -> Result<Buffer>| sizes.spectrum.map(make).transpose();
        let [room, cells] = [sizes.room, sizes.cells].map(u64::from);
        // Cells of the device.
        let made = if sizes.leaves { 0 } else { cells };
        let of_host =
            |name, count, bytes| sizes.leaves.then(|| make(name, count, bytes)).transpose();
        Ok(Self {
            sizes,
            params: make("parameters of refinement", 1, size_of::<RefineParams>())?,
            head: make("cursors of refinement", HEAD_WORDS.into(), 4)?,
            report: make("reported errors", REPORT_WORDS.into(), 4)?,
            patches: make("patches", sizes.patches.into(), size_of::<RefinedPatch>())?,
            rows: make("rows of patches", sizes.rows.into(), size_of::<RefinedRow>())?,
            walls: make("walls of patches", sizes.walls.into(), size_of::<RefinedWall>())?,
            sums: make("errors of patches", sizes.sums, 4)?,
            rectangles: make("rectangles", room, size_of::<Rectangle>())?,
            lists: make("lists of rectangles", 2 * room, 4)?,
            splits: make("rectangles to split", room, 4)?,
            asked: make("rectangles that are asked", 3 * room, 4)?,
            again: make("rectangles to estimate again", room, 4)?,
            cells: make("cells of rectangles", made, size_of::<Cell>())?,
            cell_rows: make("cell rows of rectangles", made, size_of::<CellRow>())?,
            parts: make("parts of cell rows of rectangles", 2 * made, size_of::<CellRowPart>())?,
            made: make("rectangles of runs", 3 * made, 4)?,
            runs: make("runs of rectangles", 2 * made, 4)?,
            kept: of_spectrum(&|[words, _]| {
                make("moments of rectangles", room * u64::from(words), 4)
            })?,
            repeated: of_spectrum(&|_| {
                make("rectangles to trace at each energy", cells, size_of::<RepeatedRectangle>())
            })?,
            marks: of_spectrum(&|_| make("lists of cell rows", 3 * cells, 4))?,
            merged: of_spectrum(&|_| {
                make("leaked light", sizes.merged_bytes(sizes.patches as usize), 1)
            })?,
            results: of_host("results of rectangles", room, size_of::<RayResult>())?,
            leaves: of_host("rectangles for the host", cells, size_of::<RefinedLeaf>())?,
        })
    }

    /// Parameters with the addresses of all buffers.
    pub(super) fn params(&self, tracer: &Tracer) -> RefineParams {
        RefineParams {
            all_results: address(&self.results),
            leaves: address(&self.leaves),
            patches: self.patches.address(),
            rows: self.rows.address(),
            walls: self.walls.address(),
            rectangles: self.rectangles.address(),
            sums: self.sums.address(),
            head: self.head.address(),
            report: self.report.address(),
            lists: self.lists.address(),
            splits: self.splits.address(),
            asked: self.asked.address(),
            again: self.again.address(),
            cells: self.cells.address(),
            cell_rows: self.cell_rows.address(),
            parts: self.parts.address(),
            made: self.made.address(),
            runs: self.runs.address(),
            rays: tracer.rays().address(),
            results: tracer.results().address(),
            queues: tracer.queues().address(),
            room: self.sizes.room,
            cell_room: self.sizes.cells,
            batch: tracer.capacity(),
            ..bytemuck::Zeroable::zeroed()
        }
    }
}
