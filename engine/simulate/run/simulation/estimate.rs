//! Estimated cost of a run.

use super::Simulation;
use super::detection::detection_seconds;
use crate::run::RunEstimate;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use std::time::Instant;

impl Simulation {
    /// Estimates rays and time of a run without noise and output, from a part of the patches; it takes
    /// about a second, and does not depend on earlier estimates.
    ///
    /// # Errors
    /// As [`Simulation::run`], without errors of a sink.
    pub fn estimate(&self) -> Result<RunEstimate> {
        self.estimate_until(&Cancel::default())
    }

    /// As [`Simulation::estimate`]; [`beamlet_core::Error::Interrupted`] when `cancel` was set.
    ///
    /// # Errors
    ///
    /// As [`Simulation::estimate`].
    #[doc(hidden)]
    pub fn estimate_until(&self, cancel: &Cancel) -> Result<RunEstimate> {
        let begin = Instant::now();
        let mut light = Self::light(std::slice::from_ref(self), cancel)?;
        let fixed = self.prepared_in + begin.elapsed().as_secs_f64();
        let estimate = light.estimate()?;
        let (scan, steps) = (&self.scene.scan, self.scene.mask_steps());
        let exposures = (scan.poses() + scan.flat_places().len()) as f64;
        let detection = detection_seconds(&self.detector, steps, self.memory.band_rows, cancel)?;
        let seconds = estimate.seconds + fixed + exposures * detection;
        Ok(RunEstimate { seconds, ..estimate })
    }
}
