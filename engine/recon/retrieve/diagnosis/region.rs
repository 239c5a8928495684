//! A rectangle of pixels of a frame.

use beamlet_core::{Error, Result};
use std::ops::Range;

/// Columns and rows of a rectangle of a frame, ends excluded.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Region {
    /// Columns, counted from 0.
    pub columns: Range<usize>,
    /// Rows, counted from 0 at the top; `None`: all.
    pub rows: Option<Range<usize>>,
}

impl Region {
    /// Columns `columns` of these rows; `None`: of all rows.
    #[must_use]
    pub fn new(columns: Range<usize>, rows: impl Into<Option<Range<usize>>>) -> Self {
        Self { columns, rows: rows.into() }
    }

    /// Its rows and columns in a frame of `rows` x `columns`.
    ///
    /// # Errors
    /// [`Error::Argument`] where it is empty or reaches beyond the frame.
    pub(in crate::retrieve) fn within(
        &self,
        [rows, columns]: [usize; 2],
    ) -> Result<[Range<usize>; 2]> {
        let own_rows = self.rows.clone().unwrap_or(0..rows);
        for (kind, own, count) in [("columns", &self.columns, columns), ("rows", &own_rows, rows)] {
            if own.start >= own.end || own.end > count {
                return Err(Error::argument(
                    "empty_beam",
                    format!("{kind} {}:{}", own.start, own.end),
                    format!("{kind} from 0 to {count}, the end excluded, and at least one of them"),
                ));
            }
        }
        Ok([own_rows, self.columns.clone()])
    }
}
