//! Bands handed to a closure, for callers that consume frames as they come.

use super::{Exposure, RunStart, Sink};
use crate::scene::Scene;
use crate::{Result, RunRecord};
use ndarray::ArrayView3;
use std::fmt;
use std::ops::Range;

/// What is called where nobody asked for counts.
type Ignore = fn(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>;

/// Calls `on_band(view, rows, data)` for every band, `data` being intensities
/// `[step][row][column]`, and `on_counts` in the same way for detector numbers.
pub struct CallbackSink<F, C = Ignore> {
    on_band: F,
    on_counts: C,
    record: Option<RunRecord>,
}

impl<F> CallbackSink<F>
where
    F: FnMut(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>,
{
    /// A sink that hands every band to `on_band`; an error from it ends the run.
    pub fn new(on_band: F) -> Self {
        Self { on_band, on_counts: |_, _, _| Ok(()), record: None }
    }

    /// The same with detector numbers handed to `on_counts`, where the scene asks for noise.
    pub fn with_counts<C>(self, on_counts: C) -> CallbackSink<F, C>
    where
        C: FnMut(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>,
    {
        CallbackSink { on_band: self.on_band, on_counts, record: self.record }
    }
}

impl<F, C> CallbackSink<F, C> {
    /// Record of the finished run; `None` before it has finished.
    pub fn record(&self) -> Option<&RunRecord> {
        self.record.as_ref()
    }
}

impl<F, C> fmt::Debug for CallbackSink<F, C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CallbackSink").field("record", &self.record).finish_non_exhaustive()
    }
}

impl<F, C> Sink for CallbackSink<F, C>
where
    F: FnMut(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>,
    C: FnMut(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>,
{
    fn begin(&mut self, _scene: &Scene, _start: &RunStart) -> Result<()> {
        self.record = None;
        Ok(())
    }

    fn write(&mut self, view: Exposure, rows: Range<u32>, data: ArrayView3<'_, f32>) -> Result<()> {
        (self.on_band)(view, rows, data)
    }

    fn write_counts(
        &mut self,
        view: Exposure,
        rows: Range<u32>,
        numbers: ArrayView3<'_, f32>,
    ) -> Result<()> {
        (self.on_counts)(view, rows, numbers)
    }

    fn commit(&mut self, _view: Exposure) -> Result<()> {
        Ok(())
    }

    fn finish(&mut self, record: &RunRecord) -> Result<()> {
        self.record = Some(record.clone());
        Ok(())
    }
}
