//! Facets of a view in the beam frame, and where they project to.

use super::lattice::Lattice;
use super::sample_facets::SampleFacets;
use super::view_context::ViewContext;
use beamlet_core::numbers;
use beamlet_geometry::{FacetOf, Sample};
use beamlet_model::scene::Motion;
use glam::DVec3;
use rayon::prelude::*;

/// Triangles that one task takes.
const TRIANGLES_OF_A_TASK: usize = 1 << 12;

/// Facets of a view in the beam frame.
#[derive(Clone, Copy)]
pub(super) struct Triangles<'a> {
    sample: &'a Sample,
    facets: &'a SampleFacets,
    lattice: &'a Lattice,
    motion: Motion,
    source: DVec3,
}

impl<'a> Triangles<'a> {
    pub(super) const fn of(view: &ViewContext<'a>) -> Self {
        Self {
            sample: view.sample,
            facets: view.facets,
            lattice: view.lattice,
            motion: view.motion,
            source: DVec3::new(0.0, -view.optics.rotation, 0.0),
        }
    }

    /// Place of the source.
    pub(super) const fn source(&self) -> DVec3 {
        self.source
    }

    pub(super) fn corners(&self, facet: FacetOf) -> [DVec3; 3] {
        self.sample.corners(facet).map(|corner| self.motion.at(corner))
    }

    pub(super) fn is_front(&self, corners: &[DVec3; 3]) -> bool {
        let [a, b, c] = *corners;
        (b - a).cross(c - a).dot(a - self.source) < 0.0
    }

    /// The facets across the edges of one; none at an open edge.
    pub(super) fn beside(&self, facet: FacetOf) -> [Option<FacetOf>; 3] {
        let known = |other: u32| (other != u32::MAX).then_some(other as usize);
        match facet {
            FacetOf::Sample(triangle) => {
                self.facets.across[triangle].map(|other| known(other).map(FacetOf::Sample))
            }
            FacetOf::Placed(placed, triangle) => {
                let prototype =
                    &self.sample.prototypes[self.sample.placed[placed].prototype as usize];
                prototype.across[triangle]
                    .map(|other| known(other).map(|other| FacetOf::Placed(placed, other)))
            }
        }
    }

    /// Calls `visit` with the facets of the components that are not left out.
    pub(super) fn each(&self, left_out: &[bool], visit: &Visit<'_>) {
        let tasks = self.sample.triangles.len().div_ceil(TRIANGLES_OF_A_TASK);
        let take = |number: u32, facet: FacetOf| {
            let corners = self.corners(facet);
            visit((number, facet), &corners, &self.project(&corners));
        };
        (0..tasks).into_par_iter().for_each(|task| {
            let first = task * TRIANGLES_OF_A_TASK;
            let end = (first + TRIANGLES_OF_A_TASK).min(self.sample.triangles.len());
            for triangle in first..end {
                if !left_out[self.sample.triangle_component[triangle] as usize] {
                    take(numbers::count(triangle), FacetOf::Sample(triangle));
                }
            }
        });
        self.facets.numbers.placed().par_bridge().for_each(|(at, first)| {
            let placed = &self.sample.placed[at];
            let prototype = &self.sample.prototypes[placed.prototype as usize];
            for (number, (triangle, component)) in
                (numbers::low_word(first)..).zip(prototype.triangle_component.iter().enumerate())
            {
                if !left_out[(placed.component + component) as usize] {
                    take(number, FacetOf::Placed(at, triangle));
                }
            }
        });
    }

    /// x in the cell plane and row coordinate.
    fn project(&self, corners: &[DVec3; 3]) -> [[f64; 2]; 3] {
        corners.map(|p| self.lattice.project(p.x, p.y, p.z))
    }
}

/// Takes a facet: its number, its corners in the beam frame, and where they project to.
pub(super) type Visit<'v> = dyn Fn((u32, FacetOf), &[DVec3; 3], &[[f64; 2]; 3]) + Sync + 'v;
