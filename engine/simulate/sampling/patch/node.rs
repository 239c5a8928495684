//! A rectangle of a patch, and the rule that gives its result.

use beamlet_interface::{FLAG_DRAWN, FLAG_NOT_FINITE, FLAG_REFLECTED, RayResult};

/// The axis along which a rectangle is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sampling) enum Axis {
    X,
    Z,
}

/// Slopes of optical depth and displacement along x (per m) and z (per row).
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::sampling) struct Slopes {
    pub(in crate::sampling) depth: [f32; 2],
    pub(in crate::sampling) displacement: [f32; 2],
    /// Slopes of the displacement along z on the detector, where apertures end along z; else 0.
    pub(in crate::sampling) landing: [f32; 2],
}

/// A rectangle and its result.
#[derive(Debug, Clone, Copy)]
pub(in crate::sampling) struct Node {
    /// From the beamlet's centre in the cell plane at the middle of the row, m.
    pub(in crate::sampling) x: [f32; 2],
    /// Share of the row, downwards.
    pub(in crate::sampling) z: [f32; 2],
    pub(in crate::sampling) result: RayResult,
}

impl Node {
    pub(in crate::sampling) fn new(x: [f32; 2], z: [f32; 2], result: RayResult) -> Self {
        Self { x, z, result }
    }

    /// Centre (x, z).
    pub(in crate::sampling) fn centre(&self) -> [f32; 2] {
        [0.5 * (self.x[0] + self.x[1]), 0.5 * (self.z[0] + self.z[1])]
    }

    pub(in crate::sampling) fn width(&self) -> f32 {
        self.x[1] - self.x[0]
    }

    pub(in crate::sampling) fn height(&self) -> f32 {
        self.z[1] - self.z[0]
    }

    /// True if coordinates lie in it.
    pub(in crate::sampling) fn holds(&self, [x, z]: [f32; 2]) -> bool {
        x >= self.x[0] && x < self.x[1] && z >= self.z[0] && z < self.z[1]
    }
}

/// True if two rays crossed the same components in the same way: results between them may be interpolated.
pub(in crate::sampling) fn alike(a: &RayResult, b: &RayResult) -> bool {
    a.signature == b.signature
        && (a.flags ^ b.flags) & FLAG_REFLECTED == 0
        && (a.flags | b.flags) & FLAG_NOT_FINITE == 0
}

/// True if a ray drew its normal at a rough surface: another at the same place may go elsewhere.
pub(in crate::sampling) fn is_drawn(result: &RayResult) -> bool {
    result.flags & FLAG_DRAWN != 0
}

/// True if no silhouette lies between two rays. Rays that draw their normals may reflect or not on one
/// surface: any two that cross the sample are alike.
pub(in crate::sampling) fn no_silhouette_between(a: &RayResult, b: &RayResult) -> bool {
    if is_drawn(a) || is_drawn(b) {
        return (a.crossings == 0) == (b.crossings == 0);
    }
    alike(a, b)
}
