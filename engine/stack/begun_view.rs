//! A view of which some blocks of rows are committed.

use super::moment_file::Beginning;
use super::progress_log::Block;
use crate::Tally;
use crate::scene::Exposure;

/// A view of which some rows, from the first on, are committed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BegunView {
    /// The view.
    pub view: Exposure,
    /// Number of these rows.
    pub rows: u32,
    /// Counts of these rows.
    pub tally: Tally,
    /// Moments of these rows, where moments are kept.
    pub kept: Option<Beginning>,
}

impl BegunView {
    /// Of blocks one after another, from row 0 on; `None` where there are none.
    pub(super) fn of(view: Exposure, blocks: &[Block]) -> Option<Self> {
        let last = blocks.last()?;
        let tally = blocks.iter().filter_map(|block| block.entry.tally).sum();
        Some(Self { view, rows: last.rows.end, tally, kept: last.kept.clone() })
    }
}
