//! Control of work on the rows of images and volumes.

use crate::cancel::Cancel;
use std::fmt;

/// Progress and end of a retrieval, a reconstruction or a comparison; set in a chain.
#[derive(Default)]
pub struct RowsControl<'a> {
    /// Called now and then with rows done and rows in all, over all images and the flat.
    pub progress: Option<&'a mut dyn FnMut(u64, u64)>,
    /// Ends the work with [`crate::Error::Interrupted`].
    pub cancel: Cancel,
}

impl<'a> RowsControl<'a> {
    setters! {
        /// Sets the callback for the progress.
        with_progress(progress: &'a mut dyn FnMut(u64, u64));
        /// Sets what ends the work.
        with_cancel(cancel: Cancel);
    }
}

impl fmt::Debug for RowsControl<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RowsControl").finish_non_exhaustive()
    }
}
