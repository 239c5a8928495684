//! Facets that the plane through the source and a line cuts, and the exact shapes beside them.

use crate::accel::{Fan, Met};
use crate::sampling::ViewContext;
use beamlet_geometry::{FacetOf, Place, Placed};
use glam::{DMat3, DVec3};
use std::ops::Range;

/// Place where the plane of lines cuts an edge of a facet.
#[derive(Debug, Clone, Copy)]
pub(super) struct EdgePlace {
    /// x in the cell plane, m.
    pub x: f64,
    /// From the source along y, m.
    pub distance: f64,
    /// Normal that refracts light, beam frame; of smooth objects interpolated, and not of unit length.
    pub normal: DVec3,
}

/// A facet that the plane of lines cuts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Both ends of the section, from left to right.
    pub ends: [EdgePlace; 2],
    /// Rays enter its object.
    pub is_front: bool,
    pub component: u32,
    /// Its normals are those of a smooth surface.
    pub is_smooth: bool,
}

/// Finds the surfaces of a view that lines meet.
#[derive(Debug)]
pub(super) struct FacetCuts<'a> {
    view: &'a ViewContext<'a>,
    source: DVec3,
    /// From the sample's frame to the beam's.
    pub rotation: DMat3,
}

impl<'a> FacetCuts<'a> {
    pub(super) fn new(view: &'a ViewContext<'a>) -> Self {
        let source = DVec3::new(0.0, -view.optics.rotation, 0.0);
        Self { view, source, rotation: view.motion.rotation() }
    }

    /// Facets that the plane of the lines at a row coordinate cuts, over some beamlets, and the exact shapes that it
    /// may cut, as indices among the placed surfaces.
    pub(super) fn of(&self, row: f64, beamlets: &Range<i64>) -> (Vec<Cut>, Vec<usize>) {
        let (view, lattice) = (self.view, self.view.lattice);
        let half = 0.5 * lattice.period;
        let slope = |beamlet: i64, x: f64| lattice.slopes(beamlet, x, row);
        let [[low, slope_z], [high, _]] =
            [slope(beamlets.start, -half), slope(beamlets.end - 1, half)];
        let beam = Fan::new(self.source, [low, high], slope_z);
        let fan = beam.in_frame(&self.rotation, view.motion.offset());
        let (mut cuts, mut shapes) = (Vec::new(), Vec::new());
        view.facets.tree.each(view.sample, &fan, &mut |met| {
            let (facet, fan, leaf) = match met {
                Met::Facet(facet, fan, leaf) => (facet, fan, leaf),
                Met::Shape(at) => return shapes.push(at),
            };
            let corners = self.corners(facet);
            let heights = corners.own.map(|corner| fan.height(corner));
            let Some(crossed) = crossed_edges(heights) else { return };
            let component = view.sample.component_of(facet);
            let is_smooth = view.sample.components[component as usize].smooth;
            let normals = if is_smooth {
                let own = view.facets.tree.corner_normals(leaf);
                own.map(|normal| self.rotation * corners.direction(normal))
            } else {
                [self.normal(facet); 3]
            };
            let at = |[from, to]: [usize; 2]| {
                // In the order of the corners' numbers: both facets at an edge find the same place.
                let [from, to] = if corners.numbers[from] < corners.numbers[to] {
                    [from, to]
                } else {
                    [to, from]
                };
                let share = heights[from] / (heights[from] - heights[to]);
                let own = corners.own[from] + (corners.own[to] - corners.own[from]) * share;
                let point = view.motion.at(corners.world(own));
                let distance = point.y - self.source.y;
                let x = point.x / distance * lattice.plane;
                let normal = normals[from] + (normals[to] - normals[from]) * share;
                EdgePlace { x, distance, normal }
            };
            let [up, down] = crossed.map(at);
            let is_front = down.x < up.x;
            let ends = if is_front { [down, up] } else { [up, down] };
            if ends[1].x <= low * lattice.plane
                || ends[0].x >= high * lattice.plane
                || ends[1].x <= ends[0].x
            {
                return;
            }
            cuts.push(Cut { ends, is_front, component, is_smooth });
        });
        (cuts, shapes)
    }

    fn corners(&self, facet: FacetOf) -> Corners<'a> {
        let sample = self.view.sample;
        match facet {
            FacetOf::Sample(triangle) => {
                let numbers = sample.triangles[triangle];
                let own = numbers.map(|v| DVec3::from_array(sample.vertices[v as usize]));
                Corners { numbers, own, place: None }
            }
            FacetOf::Placed(at, triangle) => {
                let Placed { prototype, place, .. } = &sample.placed[at];
                let prototype = &sample.prototypes[*prototype as usize];
                let numbers = prototype.triangles[triangle];
                let own = numbers.map(|v| prototype.vertices[v as usize]);
                Corners { numbers, own, place: Some(place) }
            }
        }
    }

    /// Unit normal of a facet in the beam frame.
    fn normal(&self, facet: FacetOf) -> DVec3 {
        let [a, b, c] = self.view.sample.corners(facet);
        self.rotation * (b - a).cross(c - a).normalize_or_zero()
    }
}

/// Corners of a facet in the frame of its mesh, with their numbers.
struct Corners<'a> {
    numbers: [u32; 3],
    own: [DVec3; 3],
    /// Place of a mesh that is placed.
    place: Option<&'a Place>,
}

impl Corners<'_> {
    /// A normal of the mesh in the sample, not of unit length.
    fn direction(&self, normal: DVec3) -> DVec3 {
        self.place.map_or(normal, |place| place.rotation * (normal / place.scales()))
    }

    /// A point of the mesh in the sample, m.
    fn world(&self, point: DVec3) -> DVec3 {
        self.place.map_or(point, |place| place.world_from_own(point))
    }
}

/// Edges of a facet whose corners have these heights above a plane, in the order of its corners: the one that goes
/// upwards through the plane and the one that goes downwards.
fn crossed_edges(heights: [f64; 3]) -> Option<[[usize; 2]; 2]> {
    // Half open: a corner belongs to one side.
    let above = heights.map(|height| height >= 0.0);
    let edge = |rises: bool| {
        (0..3)
            .map(|at| [at, (at + 1) % 3])
            .find(|[from, to]| above[*from] != rises && above[*to] == rises)
    };
    Some([edge(true)?, edge(false)?])
}
