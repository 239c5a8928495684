//! Rectangles of a patch as cells are made of them.

use super::moment_recording::LinearModel;
use beamlet_interface::{FLAG_NOT_FINITE, Ray};

/// Place of a patch: its beamlet and detector row.
#[derive(Debug, Clone, Copy)]
pub(super) struct PatchPlace {
    pub(super) beamlet: i64,
    pub(super) row: i64,
}

/// A rectangle as a cell: its result at both ends of x.
#[derive(Clone, Copy)]
pub(super) struct Rectangle {
    pub(crate) x: [f32; 2],
    pub(crate) z: [f32; 2],
    /// Its ray: another one beside it may draw another normal.
    pub(super) ray: Ray,
    pub(super) ends: LinearModel,
    /// Variance of the displacement about the result, m2.
    pub(crate) displacement_variance: f32,
    /// Displacement on the detector along z at both ends of z, m.
    pub(super) ends_z: [f32; 2],
    /// Change of its light over its height, relative to the mean light.
    pub(crate) tilt: f32,
    /// Shares of its light in the rows above and below, where they are known beforehand.
    pub(crate) shares: Option<[f32; 2]>,
}

impl Rectangle {
    /// True if all its rays miss the sample.
    pub(super) fn is_empty(&self) -> bool {
        self.ends.result.crossings == 0
    }

    /// True if it has light that is known: the tally has rays that are not finite.
    pub(super) fn is_lit(&self) -> bool {
        self.x[1] > self.x[0] && self.ends.result.flags & FLAG_NOT_FINITE == 0
    }

    /// True if another one lies beside it, at the same heights.
    pub(super) fn is_before(&self, next: &Self) -> bool {
        self.x[1].to_bits() == next.x[0].to_bits()
            && self.z.map(f32::to_bits) == next.z.map(f32::to_bits)
    }
}
