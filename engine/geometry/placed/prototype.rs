//! A surface in its own frame, with several places.

use std::sync::OnceLock;

use glam::DVec3;

use super::super::Component;
use super::super::adjacency::across;
use super::super::analytic::AnalyticShape;
use super::super::lids::Gathered;
use super::super::search::winding;
use super::super::surface::bounds_of;
use super::Place;

/// Error of the facets of a shape, share of its least extent: with few places, and with many.
const FINE: f64 = 5e-4;
const COARSE: f64 = 5e-3;
const FEW: usize = 1000;

/// Most facets of a shape that is cut, or nearly touches another surface.
const MOST_FACETS: u64 = 150_000;

/// A closed surface in its own frame, m: a mesh, or an analytic shape with facets that stand for it
/// where no ray is traced.
#[derive(Debug, Clone)]
pub struct Prototype {
    /// The shape that is traced in place of the facets.
    pub shape: Option<AnalyticShape>,
    /// How far facets that stand for the shape are off it, m.
    error: f64,
    /// m.
    pub vertices: Vec<DVec3>,
    /// Counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Component of each triangle, counted from 0.
    pub triangle_component: Vec<u32>,
    /// In the own frame; `outside` belongs to each place.
    pub components: Vec<Component>,
    /// Triangles across the edges of each, as [`super::super::across_edges`] gives them.
    pub across: Vec<[u32; 3]>,
    bounds: [DVec3; 2],
    /// See [`Self::extremes`].
    extremes: OnceLock<Vec<DVec3>>,
}

/// The vertices farthest along the axes of a cube, its space diagonals and its face diagonals.
fn extremes_of(vertices: &[DVec3]) -> Vec<DVec3> {
    let along = |k: i32| DVec3::new(f64::from(k % 3), f64::from(k / 3 % 3), f64::from(k / 9)) - 1.0;
    let farthest = |k: i32| {
        let reach = |vertex: &DVec3| vertex.dot(along(k));
        vertices.iter().copied().max_by(|a, b| reach(a).total_cmp(&reach(b)))
    };
    (0..27).filter(|k| *k != 13).filter_map(farthest).collect()
}

impl Prototype {
    /// A mesh: vertices (m), triangles, and the component of each triangle.
    pub(crate) fn new(
        vertices: Vec<DVec3>,
        triangles: Vec<[u32; 3]>,
        triangle_component: Vec<u32>,
        components: Vec<Component>,
    ) -> Self {
        let across = across(vertices.len(), &triangles);
        let mut components = components;
        let mut lids: Vec<Gathered> = components.iter().map(Gathered::new).collect();
        for (triangle, component) in triangles.iter().zip(&triangle_component) {
            lids[*component as usize].add(triangle.map(|vertex| vertices[vertex as usize]));
        }
        for (component, lids) in components.iter_mut().zip(lids) {
            component.lids = lids.lids();
        }
        let bounds = bounds_of(vertices.iter().copied());
        let error = 0.0;
        Self {
            shape: None,
            error,
            vertices,
            triangles,
            triangle_component,
            components,
            across,
            bounds,
            extremes: OnceLock::new(),
        }
    }

    /// An analytic shape of an object with `places` places.
    pub(crate) fn of_shape(shape: AnalyticShape, object: u32, places: usize) -> Self {
        let [low, high] = shape.bounds();
        let size = (high - low).min_element();
        let error = size * if places > FEW { COARSE } else { FINE };
        let surface = shape.surface(error);
        let component = Component {
            object,
            volume: shape.volume(),
            area: shape.area(),
            bounds: [low, high].map(Into::into),
            ..Component::default()
        };
        let of = vec![0; surface.triangles.len()];
        Self {
            shape: Some(shape),
            error,
            bounds: [low, high],
            ..Self::new(surface.vertices, surface.triangles, of, vec![component])
        }
    }

    /// The same shape with facets that are off it by less, as near to `error` (m) as `MOST_FACETS`
    /// allow; nothing for a mesh, or where they cannot be finer.
    pub(crate) fn finer(&self, error: f64) -> Option<Self> {
        self.finer_of(error, MOST_FACETS)
    }

    /// As [`Self::finer`], with at most `most` facets.
    pub(super) fn finer_of(&self, error: f64, most: u64) -> Option<Self> {
        let shape = self.shape?;
        let allowed = |error: &f64| shape.triangles(*error) <= most.min(MOST_FACETS);
        let error = (0..30).map(|step| error * f64::from(1_u32 << step)).find(allowed)?;
        if error >= self.error {
            return None;
        }
        let surface = shape.surface(error);
        let of = vec![0; surface.triangles.len()];
        let components = self.components.clone();
        let finer = Self::new(surface.vertices, surface.triangles, of, components);
        Some(Self { shape: Some(shape), error, bounds: self.bounds, ..finer })
    }

    /// Number of facets that are traced.
    pub fn facets(&self) -> usize {
        if self.shape.is_some() { 0 } else { self.triangles.len() }
    }

    /// Corners of a triangle, m.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex as usize])
    }

    /// A shape that lies in this one at a distance from its surface, m, without facets; nothing for a
    /// mesh, or where nothing is left.
    pub(super) fn inset(&self, by: f64) -> Option<Self> {
        let shape = self.shape?.inset(by)?;
        let none = Self::new(Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Some(Self { shape: Some(shape), bounds: shape.bounds(), ..none })
    }

    /// The vertices farthest along some directions.
    pub(super) fn extremes(&self) -> &[DVec3] {
        self.extremes.get_or_init(|| extremes_of(&self.vertices))
    }

    /// A point of each component.
    pub(super) fn starts(&self) -> impl Iterator<Item = DVec3> {
        let mut first = vec![None; self.components.len()];
        for (triangle, component) in self.triangle_component.iter().enumerate() {
            first[*component as usize].get_or_insert(self.corners(triangle)[0]);
        }
        first.into_iter().flatten()
    }

    /// True if a point off the surface lies in the material, of the own frame.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        let [low, high] = self.bounds;
        let in_box = low.cmple(point).all() && point.cmple(high).all();
        if let Some(shape) = self.shape {
            return shape.contains(point);
        }
        let corners = (0..self.triangles.len()).map(|triangle| self.corners(triangle));
        in_box && winding(corners, point) > 0.5
    }

    /// The point of the hull that is farthest along a vector of the own frame.
    pub(crate) fn farthest(&self, along: DVec3) -> DVec3 {
        match self.shape {
            Some(shape) => shape.support(along),
            None => {
                let reach = |it: &DVec3| along.dot(*it);
                let vertices = self.vertices.iter().copied();
                vertices.max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or_default()
            }
        }
    }

    /// The largest product of a point of the surface with a vector of the own frame.
    pub(crate) fn reach(&self, along: DVec3) -> f64 {
        self.farthest(along).dot(along)
    }

    /// How far facets that stand for the surface are off it, m of the own frame.
    pub(crate) const fn error(&self) -> f64 {
        self.error
    }

    /// Area of each component in a place, m2.
    pub(crate) fn areas(&self, place: &Place) -> Vec<f64> {
        if (place.stretch - 1.0).abs() < f64::EPSILON {
            let scale = place.scale * place.scale;
            return self.components.iter().map(|it| it.area * scale).collect();
        }
        let mut areas = vec![0.0; self.components.len()];
        for (triangle, component) in self.triangle_component.iter().enumerate() {
            let [a, b, c] = self.corners(triangle).map(|it| place.world_from_own(it));
            areas[*component as usize] += (b - a).cross(c - a).length() / 2.0;
        }
        areas
    }

    /// Least and greatest corner of its box, m.
    pub(crate) const fn bounds(&self) -> [DVec3; 2] {
        self.bounds
    }
}
