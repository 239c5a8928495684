//! Room for rectangles and cells on the device.

use super::buffers::{
    CELL, CELL_OF_HOST, CELL_OF_SPECTRUM, RECTANGLE, RECTANGLE_OF_HOST, merged_bytes,
};
use crate::sampling::bytes_of_leaf;
use beamlet_core::{Error, numbers};

/// Rectangles that there is room for where memory has no limit, and least.
const RECTANGLES: [u64; 2] = [1 << 21, 1 << 14];
/// Cells that are lit at once, and least.
const CELLS: [u64; 2] = [1 << 18, 1 << 13];
/// Rectangles that there is room for where the host makes the cells.
const RECTANGLES_OF_HOST: u64 = 1 << 18;
/// Rectangles of a group after refinement over those before, as long as none is known.
pub(super) const GROWTH: f64 = 8.0;
/// Least base rectangles of a patch.
const LEAST_BASE: u64 = 4;

/// Memory of the refinement on the device.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RefineRoom {
    /// Limit, and bytes that are left of it; `None` without a limit.
    limit: Option<[u64; 2]>,
    /// Bytes of a rectangle, and of a cell.
    rectangle: u64,
    cell: u64,
    /// Rectangles where memory has no limit.
    most: u64,
}

impl RefineRoom {
    /// Room under a limit, with bytes left; `spectrum`: words that are kept of the moments of a ray, and groups
    /// of light.
    pub(crate) fn new(limit: Option<[u64; 2]>, spectrum: Option<[usize; 2]>) -> Self {
        let [mut rectangle, mut cell] = [RECTANGLE, CELL];
        if let Some([words, groups]) = spectrum {
            rectangle += 4 * words as u64 + merged_bytes(groups as u64) / LEAST_BASE;
            cell += CELL_OF_SPECTRUM;
        }
        Self { limit, rectangle, cell, most: RECTANGLES[0] }
    }

    /// The same where the host makes the cells; `words`: of the moments of a ray.
    pub(crate) fn of_host(limit: Option<[u64; 2]>, words: usize) -> Self {
        Self {
            limit,
            rectangle: RECTANGLE + RECTANGLE_OF_HOST + bytes_of_leaf(words) as u64,
            cell: CELL_OF_HOST,
            most: RECTANGLES_OF_HOST,
        }
    }

    pub(super) fn rectangles(self) -> u32 {
        let most = self.limit.map_or(self.most, |[_, left]| left * 3 / 4 / self.rectangle);
        numbers::low_word(most.clamp(RECTANGLES[1], self.most))
    }

    pub(super) fn cells(self) -> u32 {
        let most = self.limit.map_or(CELLS[0], |[_, left]| left / 4 / self.cell);
        numbers::low_word(most.clamp(CELLS[1], CELLS[0]))
    }

    /// Room to begin with for this many base rectangles.
    pub(super) fn first(self, base: u64) -> u32 {
        let wanted = numbers::whole::<u64>(base as f64 * GROWTH).next_power_of_two();
        numbers::low_word(wanted.clamp(RECTANGLES[1], self.rectangles().into()))
    }

    /// More room: as far as groups of patches have it, or for a single patch as far as memory has it.
    pub(super) fn more(self, places: u32, single: bool) -> Option<u32> {
        let next = places.checked_mul(2)?;
        let bytes = u64::from(next) * self.rectangle;
        let fits = self.limit.is_none_or(|[_, left]| bytes <= left * 3 / 4);
        (next <= self.rectangles() || (single && fits)).then_some(next)
    }

    /// The error of a patch that has more rectangles than there is room for.
    pub(super) fn too_small(self, (beamlet, row): (i64, i64), places: u32) -> Error {
        let [limit, left] = self.limit.unwrap_or([u64::MAX; 2]);
        let needed = (2 * u64::from(places) * self.rectangle).saturating_mul(4) / 3;
        Error::Memory {
            purpose: format!("refining beamlet {beamlet}, row {row} ({places} rectangles),"),
            needed: (limit - left).saturating_add(needed),
            available: Some(limit),
            remedy: "raise the memory limit or sampling.tolerance, or lower sampling.max_rays"
                .into(),
        }
    }
}
