//! Progress and end of work in several stages.

use beamlet_core::numbers::whole;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Cancel, Result};
use std::fmt;

/// Steps of the progress that a caller sees.
const STEPS: u64 = 1000;

/// Receiver of the share of work done, and the means to end it.
pub(super) struct Work<'a> {
    pub(super) cancel: Cancel,
    pub(super) report: &'a mut dyn FnMut(f64),
}

impl fmt::Debug for Work<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Work").finish_non_exhaustive()
    }
}

impl Work<'_> {
    /// Does a stage that is the part of all work from one share to another.
    pub(super) fn stage<T>(
        &mut self,
        [from, to]: [f64; 2],
        stage: impl FnOnce(&mut Work<'_>) -> Result<T>,
    ) -> Result<T> {
        self.cancel.check()?;
        let outer = &mut *self.report;
        let mut report = |share: f64| outer(from + (to - from) * share);
        stage(&mut Work { cancel: self.cancel.clone(), report: &mut report })
    }
}

/// Does work that reports to a caller.
pub(super) fn reporting<T>(
    control: &mut RowsControl<'_>,
    work: impl FnOnce(&mut Work<'_>) -> Result<T>,
) -> Result<T> {
    let cancel = control.cancel.clone();
    let mut report = |share: f64| {
        if let Some(progress) = &mut control.progress {
            progress(whole(share * STEPS as f64), STEPS);
        }
    };
    work(&mut Work { cancel, report: &mut report })
}
