//! Surfaces of a sample, for means over its facets.

use crate::trace::{component_hash, least_cosine};
use beamlet_geometry::{Component, FacetNumbers, Sample};
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::Transport;

/// Effect of a surface on rays: constants inside minus constants outside.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfaceStep {
    /// Hash of its component, as in signatures of rays.
    pub(crate) hash: u32,
    /// Attenuation, 1/m.
    pub(crate) mu: f64,
    /// Refraction.
    pub(crate) delta: f64,
    /// Cosine of incidence below which the first order is not enough.
    pub(super) least_cosine: f64,
}

/// Surfaces of a sample, for means over facets.
#[derive(Debug)]
pub(crate) struct SampleFacets {
    /// No mean replaces rays: facets describe the space between them.
    pub(super) by_rays_alone: bool,
    /// Steps of the surfaces, by component.
    pub(super) steps: Vec<SurfaceStep>,
    /// True for each component whose normals rays draw, or whose smooth normals refract rays: means do not
    /// know of these.
    pub(super) by_rays: Vec<bool>,
    /// Number of triangles by component.
    pub(crate) triangles: Vec<u32>,
    /// Triangles across the edges of each, of the sample itself.
    pub(super) across: Vec<[u32; 3]>,
    /// Numbers of the facets, placed meshes included.
    pub(super) numbers: FacetNumbers,
}

impl SampleFacets {
    /// At the mean constants of the media. `across`: [`beamlet_geometry::across_edges`] of the sample.
    #[must_use]
    pub(crate) fn new(
        transport: Transport,
        sample: &Sample,
        media: &MaterialTable,
        across: Vec<[u32; 3]>,
    ) -> Self {
        let mean = media.mean();
        let step = |(index, component): (u32, &Component)| {
            let [inside, outside] = media.sides(component.object, component.outside);
            let (a, b) = (&mean[inside as usize], &mean[outside as usize]);
            SurfaceStep {
                hash: component_hash(index),
                mu: a.mu - b.mu,
                delta: a.delta - b.delta,
                least_cosine: match transport {
                    // For exact transport facets estimate errors alone, to first order.
                    Transport::FirstOrder | Transport::Wave | Transport::Exact => 0.0,
                    Transport::Auto => least_cosine(media.step(inside, outside)),
                },
            }
        };
        let mut triangles = vec![0; sample.components.len()];
        sample.triangle_component.iter().for_each(|c| triangles[*c as usize] += 1);
        for placed in &sample.placed {
            let prototype = &sample.prototypes[placed.prototype as usize];
            for component in &prototype.triangle_component[..prototype.facets()] {
                triangles[(placed.component + component) as usize] += 1;
            }
        }
        let numbers = FacetNumbers::new(sample);
        let by_rays = sample.components.iter();
        let by_rays = by_rays.map(|it| it.smooth || media.rough[it.object as usize]).collect();
        let steps = (0..).zip(&sample.components).map(step).collect();
        let by_rays_alone = transport == Transport::Exact;
        Self { by_rays_alone, steps, by_rays, triangles, across, numbers }
    }
}
