//! One object as a closed, oriented surface in the world.

use glam::DVec3;

use super::Component;
use super::orientation::{Orientation, around};
use super::placed::Prototype;
use super::search::{Search, winding_by_solid_angle};
use super::surface::{Defect, Surface, bounds_of, corners_of};
use super::topology::{self, Edge};
use beamlet_core::numbers;

/// A surface, its components turned so that material lies behind every triangle.
#[derive(Debug)]
pub(super) struct Body {
    pub(crate) surface: Surface,
    pub(crate) triangle_component: Vec<u32>,
    pub(crate) components: Vec<Component>,
    pub(crate) warnings: Vec<String>,
    /// Over its triangles, if it was needed already.
    pub(crate) search: Option<Search>,
}

impl Body {
    /// Orients a welded surface of the object number `object`, whose edges are `edges`. `search`:
    /// over its triangles, if there is one already.
    pub(super) fn new(
        mut surface: Surface,
        edges: &[Edge],
        mut search: Option<Search>,
        object: u32,
    ) -> Result<Self, Defect> {
        if surface.triangles.is_empty() {
            return Err(Defect::new("there are no triangles", ""));
        }
        let mut warnings = Vec::new();
        let (mut triangle_component, count) = topology::components(&surface, edges);
        let mut components = measure(&surface, &triangle_component, count, object);
        let flat = drop_flat(&mut surface, &mut triangle_component, &mut components);
        if flat > 0 {
            search = None;
            warnings.push(format!("{flat} parts without volume were left out"));
        }
        if components.is_empty() {
            return Err(Defect::new("the surface encloses no volume", ""));
        }
        let around = around(&surface, &mut search, &triangle_component, &components);
        let orientation = Orientation::of(&components, &around);
        warnings.extend(orientation.warnings(&components));
        let Orientation { turned, filled } = orientation;
        for (triangle, component) in surface.triangles.iter_mut().zip(&triangle_component) {
            if turned[*component as usize] {
                triangle.swap(1, 2);
            }
        }
        for (component, turned) in components.iter_mut().zip(&turned) {
            if *turned {
                component.volume = -component.volume;
            }
        }
        if filled.contains(&true) {
            let wanted = filled.iter().map(|filled| !filled).collect();
            keep(wanted, &mut surface, &mut triangle_component, &mut components);
            search = None;
        }
        Ok(Self { surface, triangle_component, components, warnings, search })
    }

    /// Puts pieces, each with the object around it, in the place of the components that are gone.
    pub(super) fn replace(
        &mut self,
        gone: &[bool],
        pieces: impl Iterator<Item = (Surface, Option<u32>)>,
        object: u32,
    ) {
        let is_left = |component: u32| !gone[component as usize];
        self.surface.keep(|triangle| is_left(self.triangle_component[triangle]));
        self.triangle_component.retain(|component| is_left(*component));
        let mut next = 0;
        let renumbered: Vec<u32> = gone
            .iter()
            .map(|gone| {
                let number = next;
                next += u32::from(!gone);
                number
            })
            .collect();
        for component in &mut self.triangle_component {
            *component = renumbered[*component as usize];
        }
        let mut flags = gone.iter();
        self.components.retain(|_| !flags.next().copied().unwrap_or_default());
        for (mut surface, outside) in pieces {
            let edges = topology::edges(&surface);
            let (mut of, count) = topology::components(&surface, &edges);
            let mut components = measure(&surface, &of, count, object);
            drop_thin(&mut surface, &mut of, &mut components);
            let first = numbers::count(self.components.len());
            self.surface.append(surface);
            self.triangle_component.extend(of.iter().map(|it| it + first));
            components.iter_mut().for_each(|component| component.outside = outside);
            self.components.extend(components);
        }
        self.search = None;
    }

    /// One without surface.
    pub(super) fn empty() -> Self {
        Self {
            surface: Surface::default(),
            triangle_component: Vec::new(),
            components: Vec::new(),
            warnings: Vec::new(),
            search: None,
        }
    }

    /// Makes its surface a prototype; the body has no component afterwards.
    pub(super) fn take_prototype(&mut self) -> Prototype {
        let surface = std::mem::take(&mut self.surface);
        let components = std::mem::take(&mut self.components);
        let of = std::mem::take(&mut self.triangle_component);
        self.search = None;
        Prototype::new(surface.vertices, surface.triangles, of, components)
    }

    /// A point on each component.
    pub(super) fn first_corners(&self) -> Vec<DVec3> {
        let mut starts = vec![DVec3::NAN; self.components.len()];
        for (triangle, component) in self.triangle_component.iter().enumerate() {
            let start = &mut starts[*component as usize];
            if start.is_nan() {
                *start = self.surface.corners(triangle)[0];
            }
        }
        starts
    }

    /// True if a point off its surface lies in its material; its search exists.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        let Some(search) = &self.search else { return false };
        match search.crossings(&self.surface, point) {
            Some(hits) => hits.iter().map(|(_, sign)| sign).sum::<i32>() > 0,
            None => {
                winding_by_solid_angle(&self.surface, 0..self.surface.triangles.len(), point) > 0.5
            }
        }
    }

    /// Adds components: a closed surface, and the component of each of its triangles.
    pub(super) fn add(&mut self, surface: Surface, of: &[u32], components: Vec<Component>) {
        let first = numbers::count(self.components.len());
        self.surface.append(surface);
        self.triangle_component.extend(of.iter().map(|it| it + first));
        self.components.extend(components);
        self.search = None;
    }

    /// Bounding box of all components.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        self.surface.bounds()
    }
}

/// Components of a surface, by the component of each triangle, with their bounds, volume and area.
pub(super) fn measure(surface: &Surface, of: &[u32], count: u32, object: u32) -> Vec<Component> {
    let mut bounds = vec![bounds_of(std::iter::empty()); count as usize];
    for (triangle, component) in of.iter().enumerate() {
        let [low, high] = &mut bounds[*component as usize];
        for corner in surface.corners(triangle) {
            *low = low.min(corner);
            *high = high.max(corner);
        }
    }
    let mut components: Vec<Component> = bounds
        .iter()
        .map(|bounds| Component {
            object,
            bounds: bounds.map(|corner| corner.to_array()),
            ..Component::default()
        })
        .collect();
    for (triangle, component) in of.iter().enumerate() {
        // About the middle of the part, or a part far from the origin loses its digits.
        let [low, high] = bounds[*component as usize];
        let middle = low.midpoint(high);
        let component = &mut components[*component as usize];
        let [a, b, c] = surface.corners(triangle).map(|corner| corner - middle);
        component.volume += a.dot(b.cross(c)) / 6.0;
        component.area += (b - a).cross(c - a).length() / 2.0;
    }
    components
}

/// True if a closed surface of this volume and area encloses nothing.
pub(super) fn is_flat(volume: f64, area: f64) -> bool {
    volume.abs() <= 1e-10 * area.powf(1.5)
}

/// Removes components that enclose nothing, such as a sheet folded onto itself: they have no
/// outside, and change nothing.
fn drop_flat(surface: &mut Surface, of: &mut Vec<u32>, components: &mut Vec<Component>) -> usize {
    let solid = components.iter().map(|it| !is_flat(it.volume, it.area)).collect();
    keep(solid, surface, of, components)
}

/// Removes components that are thinner than f32 resolves, as cuts along faces that coincide
/// leave them: the device sees them without thickness.
fn drop_thin(surface: &mut Surface, of: &mut Vec<u32>, components: &mut Vec<Component>) {
    let thick = |it: &Component| {
        let [low, high] = corners_of(it);
        let reach = low.abs().max(high.abs()).max_element();
        it.volume.abs() > 0.25 * f64::from(f32::EPSILON) * reach * it.area
    };
    keep(components.iter().map(thick).collect(), surface, of, components);
}

/// A surface without the components that are thinner than f32 resolves.
pub(super) fn without_thin(mut surface: Surface) -> Surface {
    let (mut of, count) = topology::components(&surface, &topology::edges(&surface));
    let mut components = measure(&surface, &of, count, 0);
    drop_thin(&mut surface, &mut of, &mut components);
    surface
}

/// Keeps the components that are wanted; gives the number of others.
fn keep(
    solid: Vec<bool>,
    surface: &mut Surface,
    of: &mut Vec<u32>,
    components: &mut Vec<Component>,
) -> usize {
    let flat = solid.iter().filter(|solid| !**solid).count();
    if flat == 0 {
        return 0;
    }
    let mut next = 0;
    let renumbered: Vec<Option<u32>> = solid
        .iter()
        .map(|solid| {
            solid.then(|| {
                next += 1;
                next - 1
            })
        })
        .collect();
    surface.keep(|triangle| solid[of[triangle] as usize]);
    of.retain(|component| solid[*component as usize]);
    for component in of.iter_mut() {
        *component = renumbered[*component as usize].unwrap_or_default();
    }
    let mut solid = solid.into_iter();
    components.retain(|_| solid.next().unwrap_or(true));
    flat
}
