//! Facets in the way of a fan of rays: a walk of the trees on the host.

use super::Bvh;
use beamlet_geometry::{CornerNormals, FacetOf, Placed, Sample};
use beamlet_interface::Node;
use glam::{DMat3, DVec3};

/// Bits of the nodes of a tree that are met.
const INNER: u32 = 24;

/// Trees over the facets of a sample and of its prototypes.
#[derive(Debug, Clone, Default)]
pub(crate) struct FacetTree {
    nodes: Vec<Node>,
    /// Facet of each leaf: a triangle of the sample or of a prototype, or beyond the triangles of the sample the
    /// index of a placed surface.
    facets: Vec<u32>,
    /// Root and first leaf, by prototype.
    roots: Vec<u32>,
    /// Normals of the corners of each leaf, in the frame of its mesh; none where no object is smooth.
    normals: Vec<CornerNormals>,
}

/// A surface whose box touches a fan.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Met<'a> {
    /// A facet, with the fan in the frame of its mesh and the number of its leaf.
    Facet(FacetOf, &'a Fan, usize),
    /// An exact shape, by its index among the placed surfaces.
    Shape(usize),
}

/// Rays from the source in one plane, between two rays of it: planes through the source, in some frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fan {
    /// Plane of the rays, and the planes through the first and the last ray; normals upward and into the fan.
    normals: [DVec3; 3],
    /// Values of the planes at the origin, m.
    offsets: [f64; 3],
}

impl Fan {
    /// Fan in the beam frame. `source`: place of the source, m; `slopes_x`: of the first and last ray; `slope_z`: of
    /// all.
    pub(crate) fn new(source: DVec3, slopes_x: [f64; 2], slope_z: f64) -> Self {
        let [low, high] = slopes_x;
        let normals = [
            DVec3::new(0.0, -slope_z, 1.0),
            DVec3::new(1.0, -low, 0.0),
            DVec3::new(-1.0, high, 0.0),
        ];
        Self { normals, offsets: normals.map(|normal| -normal.dot(source)) }
    }

    /// The fan in a frame from which a linear map and a shift lead to that of this one.
    pub(crate) fn in_frame(&self, linear: &DMat3, shift: DVec3) -> Self {
        let transposed = linear.transpose();
        let mut offsets = self.offsets;
        for (offset, normal) in offsets.iter_mut().zip(self.normals) {
            *offset += normal.dot(shift);
        }
        Self { normals: self.normals.map(|normal| transposed * normal), offsets }
    }

    /// Height of a point above the plane of the rays, in units of its normal.
    pub(crate) fn height(&self, point: DVec3) -> f64 {
        self.normals[0].dot(point) + self.offsets[0]
    }

    /// True if a box may touch the fan.
    fn touches(&self, low: DVec3, high: DVec3) -> bool {
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low));
        let value = |plane: usize| self.normals[plane].dot(centre) + self.offsets[plane];
        let reach = |plane: usize| self.normals[plane].abs().dot(half);
        value(0).abs() <= reach(0) && value(1) >= -reach(1) && value(2) >= -reach(2)
    }
}

impl FacetTree {
    /// The trees that a device walks.
    pub(crate) fn new(bvh: &Bvh) -> Self {
        Self {
            nodes: bvh.nodes.clone(),
            facets: bvh.facets.clone(),
            roots: bvh.prototypes.iter().map(|it| it.root).collect(),
            normals: bvh.corner_normals.clone(),
        }
    }

    /// Normals of the corners of a leaf of a smooth object, in the frame of its mesh.
    pub(crate) fn corner_normals(&self, leaf: usize) -> [DVec3; 3] {
        self.normals[leaf].map(|normal| DVec3::from_array(normal.map(f64::from)))
    }

    /// Calls `visit` with the surfaces whose boxes touch a fan in the frame of the sample, in the order of the tree.
    pub(crate) fn each(&self, sample: &Sample, fan: &Fan, visit: &mut dyn FnMut(Met<'_>)) {
        if self.nodes.is_empty() {
            return;
        }
        let triangles = sample.triangles.len();
        self.walk(0, fan, &mut |leaf| {
            let facet = self.facets[leaf] as usize;
            let Some(at) = facet.checked_sub(triangles) else {
                return visit(Met::Facet(FacetOf::Sample(facet), fan, leaf));
            };
            let Placed { prototype, place, .. } = &sample.placed[at];
            if sample.prototypes[*prototype as usize].shape.is_some() {
                return visit(Met::Shape(at));
            }
            let own = fan.in_frame(&place.linear(), place.position);
            let root = self.roots[*prototype as usize];
            self.walk(root, &own, &mut |leaf| {
                visit(Met::Facet(FacetOf::Placed(at, self.facets[leaf] as usize), &own, leaf));
            });
        });
    }

    /// Calls `visit` with the leaves below a node whose boxes touch a fan.
    fn walk(&self, root: u32, fan: &Fan, visit: &mut dyn FnMut(usize)) {
        let mut stack = vec![root];
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            let scale = [0, 8, 16]
                .map(|byte| f64::from(f32::from_bits((node.exponents >> byte & 0xff) << 23)));
            let scale = DVec3::from_array(scale);
            let origin = DVec3::from_array(node.origin.map(f64::from));
            for child in 0..8_usize {
                let byte = |words: &[u32; 2]| words[child >> 2] >> (8 * (child & 3)) & 0xff;
                let meta = byte(&node.meta);
                if meta == 0 {
                    continue;
                }
                let corner = |x, y, z| {
                    origin
                        + scale
                            * DVec3::new(f64::from(byte(x)), f64::from(byte(y)), f64::from(byte(z)))
                };
                let low = corner(&node.min_x, &node.min_y, &node.min_z);
                let high = corner(&node.max_x, &node.max_y, &node.max_z);
                if !fan.touches(low, high) {
                    continue;
                }
                let first = meta & 31;
                if first >= INNER {
                    let before = node.exponents >> 24 & ((1 << (first - INNER)) - 1);
                    stack.push(node.child_base + before.count_ones());
                } else {
                    // As many leaves as bits.
                    let count = (meta >> 5).count_ones();
                    (first..first + count).for_each(|leaf| visit((node.leaf_base + leaf) as usize));
                }
            }
        }
    }
}
