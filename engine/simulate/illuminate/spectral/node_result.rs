//! Result of a ray at one energy.

use beamlet_core::numbers::single;

/// Result of a ray at a node, all that light needs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NodeResult {
    pub(super) depth: f64,
    pub(super) x: f64,
    /// At the detector.
    pub(super) z: f64,
    pub(super) slope_x: f64,
}

impl NodeResult {
    /// Share of the light that passes.
    pub(super) fn light(&self) -> f64 {
        f64::from(single(-self.depth).exp())
    }
}
