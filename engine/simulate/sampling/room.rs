//! Memory that lines may hold.

use crate::lines::Piece;
use beamlet_core::Error;

/// Bytes of lines and of all that is made of them, for each byte of lines; of the moments of both ends of their cells as
/// well.
const BYTES_OF_CELLS: u64 = 6;
/// Most bytes of lines and of all that is made of them.
const MOST: u64 = 2 << 30;

/// Memory that lines may hold.
#[derive(Debug, Clone, Copy, Default)]
pub struct Room {
    /// Memory limit of a run, and its remainder for lines, bytes.
    pub(crate) limit: Option<[u64; 2]>,
    /// Words of the moments of a ray, where they are recorded.
    pub(crate) words: usize,
}

impl Room {
    /// Bytes of all that is made of lines, for each of their bytes.
    fn whole(&self) -> u64 {
        let moments = (2 * self.words * size_of::<f32>()) as u64;
        BYTES_OF_CELLS + (BYTES_OF_CELLS * moments).div_ceil(size_of::<Piece>() as u64)
    }

    /// Bytes that lines may hold.
    pub(crate) fn bytes(&self) -> u64 {
        self.limit.map_or(MOST, |[_, left]| left).min(MOST) / self.whole()
    }

    /// The error of one patch whose lines hold more than there is room for.
    pub(crate) fn too_small(&self, (beamlet, row): (i64, i64)) -> Error {
        let [limit, left] = self.limit.unwrap_or([u64::MAX; 2]);
        let needed = self.whole().saturating_mul(2 * self.bytes());
        Error::Memory {
            purpose: format!("sampling beamlet {beamlet}, row {row} (its lines),"),
            needed: (limit - left).saturating_add(needed),
            available: Some(limit),
            remedy: "raise the memory limit or sampling.tolerance, or lower sampling.max_rays"
                .into(),
        }
    }
}
