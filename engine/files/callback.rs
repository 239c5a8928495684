//! Bands handed to a closure, for callers that consume frames as they come.

use super::record::{RunRecord, RunStart};
use super::sink::Sink;
use beamlet_core::Result;
use beamlet_model::scene::{Exposure, Scene};
use ndarray::ArrayView3;
use std::fmt;
use std::ops::Range;

/// Calls `on_band(view, rows, data)` for every band, `data` being intensities
/// `[step][row][column]`. Detector numbers are left out: a [`Sink`] of the caller's own takes them.
pub struct CallbackSink<F> {
    on_band: F,
    record: Option<RunRecord>,
}

impl<F> CallbackSink<F>
where
    F: FnMut(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>,
{
    /// A sink that hands every band to `on_band`; an error from it ends the run.
    ///
    /// # Example
    ///
    /// ```no_run
    /// use beamlet::stack::CallbackSink;
    /// use beamlet::{Control, Engine, EngineOptions, scene::Scene};
    ///
    /// let engine = Engine::open(&EngineOptions::default())?;
    /// let scene = Scene::load("scene.toml")?;
    /// let mut sink = CallbackSink::new(|view, rows, data| {
    ///     println!("{view:?}, rows {rows:?}: {:?} steps, rows, columns", data.dim());
    ///     Ok(())
    /// });
    /// engine.run(&scene, &mut sink, Control::default())?;
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn new(on_band: F) -> Self {
        Self { on_band, record: None }
    }
}

impl<F> CallbackSink<F> {
    /// Record of the finished run; `None` before it has finished.
    pub fn record(&self) -> Option<&RunRecord> {
        self.record.as_ref()
    }
}

impl<F> fmt::Debug for CallbackSink<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CallbackSink").field("record", &self.record).finish_non_exhaustive()
    }
}

impl<F> Sink for CallbackSink<F>
where
    F: FnMut(Exposure, Range<u32>, ArrayView3<'_, f32>) -> Result<()>,
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
        _view: Exposure,
        _rows: Range<u32>,
        _numbers: ArrayView3<'_, f32>,
    ) -> Result<()> {
        Ok(())
    }

    fn commit(&mut self, _view: Exposure) -> Result<()> {
        Ok(())
    }

    fn finish(&mut self, record: &RunRecord) -> Result<()> {
        self.record = Some(record.clone());
        Ok(())
    }
}
