//! Surfaces of a sample, for means over its facets.

use crate::accel::{Bvh, FacetTree};
use crate::trace::{component_hash, least_cosine};
use beamlet_geometry::{Component, Sample};
use beamlet_model::material::Constants;
use beamlet_model::media::{MaterialTable, ScatteringAxis};
use beamlet_model::scene::Transport;
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Effect of a surface on rays: constants inside minus constants outside.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SurfaceStep {
    /// Hash of its component, as in signatures of rays.
    pub(crate) hash: u32,
    /// Attenuation, 1/m.
    pub(crate) mu: f64,
    /// Refraction.
    pub(crate) delta: f64,
    /// Cosine of incidence below which the first order is not enough.
    pub(crate) least_cosine: f64,
    /// Standard deviation of the slopes of the surface.
    pub(crate) roughness: f64,
    /// Variance of the refraction angle per path length, rad2/m.
    pub(crate) scattering: f64,
    /// Materials inside and outside.
    pub(crate) sides: [u32; 2],
    /// Its object has defects: only a traced ray says which of its surfaces count.
    pub(crate) is_open: bool,
}

/// Surfaces of a sample, for means over facets.
#[derive(Debug)]
pub(crate) struct SampleFacets {
    /// All rays are traced exactly.
    pub(crate) is_exact: bool,
    /// Steps of the surfaces, by component.
    pub(crate) steps: Vec<SurfaceStep>,
    /// Steps between objects of exact shapes that cross: the later one, and the one around a point of its surface.
    between: BTreeMap<[u32; 2], SurfaceStep>,
    /// Variances of the refraction angle per path length by direction, in the frame of the sample, by material; none
    /// where all scatter alike in all directions.
    tensors: Vec<DMat3>,
    /// Trees over the facets.
    pub(crate) tree: FacetTree,
    /// Triangles across the edges of each triangle of the sample.
    pub(crate) across: Vec<[u32; 3]>,
}

impl SampleFacets {
    /// At the mean constants of the media.
    #[must_use]
    pub(crate) fn new(
        transport: Transport,
        sample: &Sample,
        media: &MaterialTable,
        bvh: &Bvh,
        across: Vec<[u32; 3]>,
    ) -> Self {
        let mean = media.mean();
        let step_of = |hash: u32, object: u32, around: Option<u32>| {
            let [inside, outside] = media.sides(object, around);
            let (a, b) = (&mean[inside as usize], &mean[outside as usize]);
            SurfaceStep {
                hash,
                mu: a.mu - b.mu,
                delta: a.delta - b.delta,
                least_cosine: match transport {
                    Transport::FirstOrder | Transport::Wave | Transport::Exact => 0.0,
                    Transport::Auto => least_cosine(media.step(inside, outside)),
                },
                scattering: a.scattering - b.scattering,
                sides: [inside, outside],
                roughness: media.roughness[object as usize],
                is_open: sample.objects.get(object as usize).is_some_and(|it| it.defects.refused()),
            }
        };
        let step = |(index, component): (u32, &Component)| {
            step_of(component_hash(index), component.object, component.outside)
        };
        let component = |at: u32| {
            let index = sample.placed[at as usize].component;
            (index, &sample.components[index as usize])
        };
        let mut between = BTreeMap::new();
        for (at, partners) in sample.partners.lists() {
            let (index, own) = component(at);
            let lower = partners.iter().map(|other| component(*other).1.object);
            for around in lower.filter(|it| *it < own.object) {
                let of = || step_of(component_hash(index), own.object, Some(around));
                between.entry([own.object, around]).or_insert_with(of);
            }
        }
        let is_exact = transport == Transport::Exact;
        let steps = (0..).zip(&sample.components).map(step).collect();
        let tree = FacetTree::new(bvh);
        let tensor = |(axis, constants): (&Option<ScatteringAxis>, &Constants)| {
            axis.map_or(DMat3::IDENTITY, |axis| axis.tensor()) * constants.scattering
        };
        let tensors = media.axes.iter().zip(&mean).map(tensor).collect();
        Self { is_exact, steps, between, tensors, tree, across }
    }

    /// Scattering inside a surface less outside of it, in direction of a vector in the frame of the sample, times its
    /// square: rad2/m; `None` where all materials scatter alike in all directions.
    pub(crate) fn directed(&self, step: &SurfaceStep, along: DVec3) -> Option<f64> {
        let [inside, outside] = step.sides.map(|side| self.tensors.get(side as usize));
        Some(along.dot((*inside? - *outside?) * along))
    }

    /// Effect of a surface of a component of an object where another object is around it: that of the component, but
    /// among exact shapes that cross.
    pub(crate) fn step_in(&self, component: u32, object: u32, around: Option<u32>) -> &SurfaceStep {
        let between = around.and_then(|around| self.between.get(&[object, around]));
        between.unwrap_or(&self.steps[component as usize])
    }
}
