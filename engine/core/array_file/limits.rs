//! Sides and sizes of frames that files may claim.

use crate::{Error, Result};
use std::path::Path;

/// Bytes of a frame that any file may claim.
pub(super) const LEAST: u64 = 1 << 30;

/// Pixels of a side of a frame, and so of a detector: rows are read whole.
pub const LONGEST_SIDE: u32 = 65_536;

/// Refuses frames with more pixels on a side than a detector has.
///
/// # Errors
///
/// [`crate::Error::File`] that names the sides found and allowed.
pub fn refuse_wide(path: &Path, frame: [usize; 2]) -> Result<()> {
    if frame.iter().all(|side| *side as u64 <= u64::from(LONGEST_SIDE)) {
        return Ok(());
    }
    let [rows, columns] = frame;
    let problem = format!(
        "has frames of {rows} rows and {columns} columns; allowed: up to {LONGEST_SIDE} each"
    );
    Err(Error::file(path, problem, None))
}

/// Refuses frames that claim more than their file holds, before memory is taken for them: more
/// pixels than any compression makes of it, or more than 1 GiB of 64 times its length.
pub(super) fn refuse_hollow(path: &Path, [rows, columns]: [usize; 2]) -> Result<()> {
    let found = std::fs::metadata(path)
        .map_err(|error| Error::file(path, "cannot be read", Some(error)))?
        .len();
    let claimed = rows as f64 * columns as f64;
    let most = (64 * found.min(1 << 56)).max(LEAST) as f64;
    if claimed <= 4096.0 * found as f64 && 4.0 * claimed <= most {
        return refuse_wide(path, [rows, columns]);
    }
    let problem = format!(
        "claims {rows} rows of {columns} columns in {found} bytes: cut short, or not a frame"
    );
    Err(Error::file(path, problem, None))
}

/// Refuses a frame of another shape than the rest.
pub(super) fn refuse_shape(path: &Path, found: [usize; 2], expected: [usize; 2]) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    let problem = format!(
        "has {} rows of {} columns; the first frame has {} rows of {}",
        found[0], found[1], expected[0], expected[1]
    );
    Err(Error::file(path, problem, None))
}
