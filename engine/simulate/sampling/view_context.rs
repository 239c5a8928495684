//! Inputs of the sampling of a pose of a view.

use super::error_budget::ErrorBudget;
use super::lattice::Lattice;
use super::moment_recording::MomentRecording;
use super::projected_bounds::ProjectedBounds;
use super::responses::Responses;
use super::sample_facets::SampleFacets;
use beamlet_core::numbers::single;
use beamlet_geometry::Sample;
use beamlet_interface::{Ray, RayResult};
use beamlet_model::optics::Optics;
use beamlet_model::scene::Motion;
use std::ops::Range;

/// Inputs of the cells of a pose of a view.
#[derive(Debug)]
pub(crate) struct ViewContext<'a> {
    /// Elements of the beam.
    pub optics: &'a Optics,
    /// Motion of the sample in the pose.
    pub motion: Motion,
    /// Its sample.
    pub sample: &'a Sample,
    /// Surfaces of the sample, whose facets describe the space between rays.
    pub facets: &'a SampleFacets,
    /// Its lattice.
    pub lattice: &'a Lattice,
    /// Index of the pose among the poses of all views.
    pub pose: u32,
    /// Projected bounds of the components.
    pub projected_bounds: &'a [ProjectedBounds],
    /// Moments of the rays, for other energies.
    pub recording: Option<&'a MomentRecording>,
    /// Effect of changes of a result on recorded values, of each design that is lit.
    pub responses: &'a Responses,
    /// Errors that sampling may leave.
    pub budget: ErrorBudget,
}

impl ViewContext<'_> {
    /// The ray through a place of a beamlet (m from its centre) and row (share of it).
    pub(crate) fn ray(&self, beamlet: i64, row: i64, x: f32, z: f32) -> Ray {
        self.lattice.ray(beamlet, f64::from(x), row as f64 + f64::from(z), self.pose)
    }

    /// Variance of the displacement that a cell has by rough surfaces, m2: where moments are kept it is in these.
    pub(super) fn variance_of(&self, result: &RayResult) -> f32 {
        if self.recording.is_some() { 0.0 } else { result.displacement_variance }
    }

    /// Rows whose light is recorded, of the whole detector: cells do not depend on bands.
    pub(crate) fn recorded_rows(&self) -> Range<i64> {
        let blur = self.lattice.blur_rows;
        -blur..i64::from(self.optics.detector.pixels[1]) + blur
    }

    /// Rows that a ray is displaced by on the detector, downwards.
    pub(crate) fn down(&self, result: &RayResult) -> f32 {
        -result.landing_z(single(self.optics.gap())) / single(self.optics.detector.pitch[1])
    }

    /// How much farther than its result says light may land, at another energy.
    pub(crate) fn delta_ratio(&self) -> f64 {
        self.recording.map_or(1.0, |recording| recording.delta_ratio)
    }
}
