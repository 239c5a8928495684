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
    /// Results at both ends of a cell with this one in its middle and the change of depth and displacement of others.
    pub(super) fn with_change_of(self, ends: &[Self; 2]) -> [Self; 2] {
        let [low, high] = ends;
        let [depth, x] = [high.depth - low.depth, high.x - low.x].map(|change| 0.5 * change);
        [-1.0, 1.0].map(|side| Self {
            depth: (self.depth + side * depth).max(0.0),
            x: self.x + side * x,
            ..self
        })
    }

    /// Share of the light that passes.
    pub(super) fn light(&self) -> f64 {
        f64::from(single(-self.depth).exp())
    }
}
