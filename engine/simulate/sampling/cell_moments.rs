//! Moments of the rays that bound cells, for other energies than those they were traced for.

use crate::trace::grazing;
use beamlet_interface::{Ray, RayResult};

/// Moments of the rays that bound cells.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CellMoments {
    /// `[cell][end][material][moment]`, in the order of [`crate::trace::Moment`]: path, lever in
    /// x and z, slope in x and z. Empty where they are not kept.
    pub ends: Vec<f32>,
    /// Cells whose rays were traced exactly.
    pub exact: Vec<ExactCell>,
}

/// A cell for which the first order is not enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactCell {
    /// Index of the cell.
    pub cell: u32,
    /// Its ray.
    pub ray: Ray,
    /// Results at both ends of the cell, at the mean constants of the spectrum.
    pub results: [RayResult; 2],
}

impl ExactCell {
    /// Least cosine of incidence at a surface over that below which the first order is not
    /// enough.
    #[must_use]
    pub fn grazing(&self) -> f64 {
        grazing(&self.results[0])
    }
}

impl CellMoments {
    /// Appends the moments of other cells, of which the first is cell `first` here.
    pub(super) fn append(&mut self, other: &Self, first: u32) {
        self.ends.extend_from_slice(&other.ends);
        self.exact.extend(other.exact.iter().map(|e| ExactCell { cell: e.cell + first, ..*e }));
    }
}
