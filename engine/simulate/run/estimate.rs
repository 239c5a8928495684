//! Estimated cost of a run.

use beamlet_files::AuditedError;
use serde::Serialize;

/// Estimated cost of a run, from a sparse sample of its scene ([`crate::run::Simulation::estimate`]).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RunEstimate {
    /// Rays of one view, mean over the views.
    pub rays_per_view: f64,
    /// Rays of all views. The flat needs none.
    pub rays: f64,
    /// Lines of all views.
    pub lines: f64,
    /// Seconds on this device: preparation, tracing, illumination, blur and scatter, without noise and output.
    pub seconds: f64,
    /// Cells of lines that are in memory together.
    pub cells_at_once: f64,
    /// Patches (beamlet and detector row) that were sampled for the estimate.
    pub patches_sampled: f64,
    /// Measured error of sampling of some patches, by an audit of each; `None` where nothing is audited.
    pub sampling_error: Option<AuditedError>,
}
