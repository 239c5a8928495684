//! Surfaces with many places, and analytic ones: kept once, with the places.

mod contact;
mod groups;
mod partners;
mod pipe;
mod place;
mod prototype;
mod resolution;
mod resolved;
mod sample;
mod solid;
mod union;

pub(crate) use groups::{Group, Groups};
pub(crate) use partners::Partners;
pub use place::Place;
pub use prototype::Prototype;

use glam::DVec3;
use std::borrow::Cow;

use super::Sample;
use super::analytic::Entry;
use super::body::Body;
use super::surface::Surface;
use beamlet_core::numbers;

/// A prototype in its place.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    /// Index into the prototypes of the sample.
    pub prototype: u32,
    /// The first of its components; the others of its prototype follow it.
    pub component: u32,
    /// Its position and rotation in the sample.
    pub place: Place,
}

impl Placed {
    /// True if both show the same outlines but for their scale and position.
    pub fn shows_the_same(&self, other: &Self) -> bool {
        let Place { stretch, rotation, .. } = self.place;
        self.prototype == other.prototype
            && rotation == other.place.rotation
            && stretch.to_bits() == other.place.stretch.to_bits()
    }
}

/// A facet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FacetOf {
    /// A triangle of the sample.
    Sample(usize),
    /// A triangle of the prototype of a placed mesh: index of the placed one, and of the triangle.
    Placed(usize, usize),
}

impl Sample {
    /// True if there is nothing to trace.
    #[doc(hidden)]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.placed.is_empty()
    }

    /// The largest coordinate, m.
    #[doc(hidden)]
    pub fn reach(&self) -> f64 {
        let of_mesh = self.vertices.iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()));
        self.placed.iter().fold(of_mesh, |most, it| {
            let [low, high] = self.bounds_of_placed(it);
            most.max(low.abs().max(high.abs()).max_element())
        })
    }

    /// Box of a placed surface in the world: least and greatest corner, m.
    #[doc(hidden)]
    pub fn bounds_of_placed(&self, placed: &Placed) -> [DVec3; 2] {
        placed.place.bounds(self.prototypes[placed.prototype as usize].bounds())
    }

    /// Area that each component of a placed surface shows along directions, over its scale squared, m2;
    /// half of both sides.
    #[doc(hidden)]
    pub fn projected_areas(&self, placed: &Placed, along: [DVec3; 2]) -> Vec<[f64; 2]> {
        let prototype = &self.prototypes[placed.prototype as usize];
        let place = Place { scale: 1.0, position: DVec3::ZERO, ..placed.place };
        let mut areas = vec![[0.0; 2]; prototype.components.len()];
        for (triangle, component) in prototype.triangle_component.iter().enumerate() {
            let [a, b, c] = prototype.corners(triangle).map(|it| place.world_from_own(it));
            let area = 0.5 * (b - a).cross(c - a);
            for (sum, along) in areas[*component as usize].iter_mut().zip(along) {
                *sum += 0.5 * area.dot(along).abs();
            }
        }
        areas
    }

    /// Corners of a facet, m.
    #[doc(hidden)]
    pub fn corners(&self, facet: FacetOf) -> [DVec3; 3] {
        match facet {
            FacetOf::Sample(triangle) => {
                self.triangles[triangle].map(|v| DVec3::from_array(self.vertices[v as usize]))
            }
            FacetOf::Placed(placed, triangle) => {
                let Placed { prototype, place, .. } = &self.placed[placed];
                let corners = self.prototypes[*prototype as usize].corners(triangle);
                corners.map(|corner| place.world_from_own(corner))
            }
        }
    }

    /// Component of a facet.
    #[doc(hidden)]
    pub fn component_of(&self, facet: FacetOf) -> u32 {
        match facet {
            FacetOf::Sample(triangle) => self.triangle_component[triangle],
            FacetOf::Placed(placed, triangle) => {
                let placed = &self.placed[placed];
                let prototype = &self.prototypes[placed.prototype as usize];
                placed.component + prototype.triangle_component[triangle]
            }
        }
    }

    /// Index of the object of a component.
    #[doc(hidden)]
    pub fn object_of(&self, component: u32) -> usize {
        self.components[component as usize].object as usize
    }

    /// Extent of a placed surface along a direction: the least and the greatest product with its points, m.
    #[doc(hidden)]
    pub fn extent_of_placed(&self, placed: &Placed, along: DVec3) -> [f64; 2] {
        [-along, along].map(|towards| along.dot(self.farthest_of_placed(placed, towards)))
    }

    /// The point of the hull of a placed surface that is farthest along a direction, m.
    #[doc(hidden)]
    pub fn farthest_of_placed(&self, placed: &Placed, along: DVec3) -> DVec3 {
        let (prototype, place) = (&self.prototypes[placed.prototype as usize], &placed.place);
        place.world_from_own(prototype.farthest(place.linear().transpose() * along))
    }

    /// Where a line enters a placed exact shape: along it, m, and the unit normal. `None` where it misses the
    /// shape, or for a mesh.
    #[doc(hidden)]
    pub fn entry(&self, placed: &Placed, start: DVec3, along: DVec3) -> Option<Entry> {
        let shape = self.prototypes[placed.prototype as usize].shape?;
        let Place { rotation, .. } = placed.place;
        let scales = placed.place.scales();
        let own_along = rotation.inverse() * along / scales;
        let Entry { distance, normal } =
            shape.entry(placed.place.own_from_world(start), own_along)?;
        Some(Entry { distance, normal: (rotation * (normal / scales)).normalize() })
    }

    /// Triangles of [`Sample::as_meshes`].
    #[must_use]
    pub fn triangles_as_meshes(&self) -> u64 {
        self.triangles_as_meshes_of(|_| true)
    }

    /// Most triangles of [`Sample::as_meshes_of`].
    #[doc(hidden)]
    pub fn triangles_as_meshes_of(&self, wanted: impl Fn(&Placed) -> bool) -> u64 {
        let of = |it: &Placed| self.prototypes[it.prototype as usize].triangles.len() as u64;
        let is_there = |(at, it): &(u32, &Placed)| self.partners.of(*at).is_some() || wanted(it);
        let placed = (0_u32..).zip(&self.placed).filter(is_there);
        self.triangles.len() as u64 + placed.map(|(_, it)| of(it)).sum::<u64>()
    }

    /// The same surfaces with every instance as a mesh of its own, and shapes that cross without what
    /// others cover of them; triangles of an object lie together.
    #[must_use]
    pub fn as_meshes(&self) -> Cow<'_, Self> {
        self.as_meshes_of(|_| true)
    }

    /// As [`Self::as_meshes`], without the instances that are not wanted; of shapes that cross all are there.
    #[doc(hidden)]
    pub fn as_meshes_of(&self, wanted: impl Fn(&Placed) -> bool) -> Cow<'_, Self> {
        if self.placed.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut all = Self {
            vertices: self.vertices.clone(),
            components: self.components.clone(),
            objects: self.objects.clone(),
            overlaps: self.overlaps.clone(),
            ..Self::default()
        };
        let object = |component: u32| self.components[component as usize].object;
        let mut own = self.triangles.iter().zip(&self.triangle_component).peekable();
        let mut placed = (0_u32..).zip(&self.placed).peekable();
        let facets = |prototype: &Prototype, _: &Placed| {
            Surface::new(prototype.vertices.clone(), prototype.triangles.clone())
        };
        // Where they cannot be cut, whole ones are drawn.
        let mut resolved = match self.partners.is_empty() {
            true => Vec::new(),
            false => self.resolved(facets).unwrap_or_default(),
        };
        let is_resolved = {
            let is_cut = !resolved.is_empty();
            move |at: u32| is_cut && self.partners.of(at).is_some()
        };
        for number in 0..numbers::count(self.objects.len()) {
            while let Some((triangle, component)) = own.next_if(|it| object(*it.1) == number) {
                all.triangles.push(*triangle);
                all.triangle_component.push(*component);
            }
            if let Some(body) = resolved.get_mut(number as usize) {
                all.add_body(std::mem::replace(body, Body::empty()));
            }
            while let Some((at, it)) = placed.next_if(|it| object(it.1.component) == number) {
                if is_resolved(at) || !wanted(it) {
                    continue;
                }
                let prototype = &self.prototypes[it.prototype as usize];
                let vertices = prototype.vertices.iter().map(|own| it.place.world_from_own(*own));
                let of = &prototype.triangle_component;
                all.add_surface(vertices, &prototype.triangles, of, it.component);
            }
        }
        Cow::Owned(all)
    }
}
