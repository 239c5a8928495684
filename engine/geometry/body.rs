//! One object as a closed, oriented surface in the world.

use glam::DVec3;
use rayon::prelude::*;

use super::Component;
use super::search::{Search, winding_by_solid_angle};
use super::surface::{Defect, Surface, bounds_of, encloses, in_mm};
use super::topology::{self, Edge};
use super::tree::Tree;

/// A surface, its components turned so that material lies behind every triangle.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) surface: Surface,
    pub(super) triangle_component: Vec<u32>,
    pub(super) components: Vec<Component>,
    pub(super) warnings: Vec<String>,
    /// Over its triangles, if it was needed already.
    pub(super) search: Option<Search>,
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
        let depths = depths(&surface, &mut search, &triangle_component, &components);
        let turned: Vec<bool> = components
            .iter()
            .zip(&depths)
            .map(|(component, depth)| (component.volume > 0.0) != (depth % 2 == 0))
            .collect();
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
        if let Some(first) = turned.iter().position(|turned| *turned) {
            let [low, high] = corners_of(&components[first]);
            warnings.push(format!(
                "{} of {} parts were inside out and have been turned (the first around {})",
                turned.iter().filter(|turned| **turned).count(),
                turned.len(),
                in_mm(low.midpoint(high))
            ));
        }
        Ok(Self { surface, triangle_component, components, warnings, search })
    }

    /// Bounding box of all components.
    pub(super) fn bounds(&self) -> [DVec3; 2] {
        self.surface.bounds()
    }
}

fn measure(surface: &Surface, of: &[u32], count: u32, object: u32) -> Vec<Component> {
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

/// The bounding box of a component as vectors.
fn corners_of(component: &Component) -> [DVec3; 2] {
    component.bounds.map(DVec3::from_array)
}

/// Removes components that enclose nothing, such as a sheet folded onto itself: they have no
/// outside, and change nothing.
fn drop_flat(surface: &mut Surface, of: &mut Vec<u32>, components: &mut Vec<Component>) -> usize {
    let solid: Vec<bool> = components
        .iter()
        .map(|component| component.volume.abs() > 1e-10 * component.area.powf(1.5))
        .collect();
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

/// How many other components of the object each component lies in.
fn depths(
    surface: &Surface,
    search: &mut Option<Search>,
    of: &[u32],
    components: &[Component],
) -> Vec<usize> {
    if components.len() == 1 {
        return vec![0];
    }
    let boxes: Vec<[DVec3; 2]> = components.iter().map(corners_of).collect();
    let tree = Tree::of_boxes(&boxes);
    let around: Vec<Vec<u32>> = components
        .par_iter()
        .map(|inner| {
            let mut around = Vec::new();
            let bounds = corners_of(inner);
            tree.around(bounds, |outer| {
                let volume = components[outer as usize].volume;
                if volume.abs() > inner.volume.abs() && encloses(boxes[outer as usize], bounds) {
                    around.push(outer);
                }
            });
            around.sort_unstable();
            around
        })
        .collect();
    if around.iter().all(Vec::is_empty) {
        return vec![0; components.len()];
    }
    let mut members = vec![Vec::new(); components.len()];
    for (triangle, component) in of.iter().enumerate() {
        members[*component as usize].push(triangle);
    }
    let search = search.get_or_insert_with(|| Search::new(surface));
    // Several points must agree, or a part that pokes into another would count as a void.
    let contained = |inner: usize| {
        let mut outers = around[inner].clone();
        let triangles = &members[inner];
        for triangle in triangles.iter().step_by(triangles.len().div_ceil(8)) {
            if outers.is_empty() {
                break;
            }
            let point = surface.corners(*triangle)[0];
            match search.crossings(surface, point) {
                Some(hits) => {
                    let mut met: Vec<u32> =
                        hits.iter().map(|(triangle, _)| of[*triangle]).collect();
                    met.sort_unstable();
                    let odd = |outer: &u32| {
                        let first = met.partition_point(|it| it < outer);
                        met[first..].iter().take_while(|it| *it == outer).count() % 2 == 1
                    };
                    outers.retain(odd);
                }
                None => outers.retain(|outer| {
                    let shell = members[*outer as usize].iter().copied();
                    winding_by_solid_angle(surface, shell, point).abs() > 0.5
                }),
            }
        }
        outers.len()
    };
    (0..components.len()).into_par_iter().map(contained).collect()
}
