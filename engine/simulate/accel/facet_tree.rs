//! Facets in the way of a fan of rays: a walk of the trees on the host.

use super::Bvh;
use beamlet_geometry::{Placed, Sample};
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
        }
    }

    /// Calls `visit` with the facets whose boxes touch a fan in the frame of the sample, in the order of the tree: the
    /// placed surface that a facet belongs to, if any, the fan in the frame of its mesh, and the triangle.
    pub(crate) fn each<'s>(
        &self,
        sample: &'s Sample,
        fan: &Fan,
        visit: &mut dyn FnMut(Option<&'s Placed>, &Fan, usize),
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let triangles = sample.triangles.len();
        self.walk(0, fan, &mut |leaf| {
            let facet = self.facets[leaf] as usize;
            let Some(placed) = facet.checked_sub(triangles) else {
                return visit(None, fan, facet);
            };
            let placed = &sample.placed[placed];
            if sample.prototypes[placed.prototype as usize].shape.is_some() {
                return;
            }
            let place = &placed.place;
            let linear = DMat3::from_quat(place.rotation) * DMat3::from_diagonal(place.scales());
            let own = fan.in_frame(&linear, place.position);
            let root = self.roots[placed.prototype as usize];
            self.walk(root, &own, &mut |leaf| {
                visit(Some(placed), &own, self.facets[leaf] as usize)
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

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_core::random::Draws;
    use std::collections::BTreeSet;

    const SCENE: &str = r#"
source = { distance = "1 m", spot = "0 um", energy = "30 keV" }
detector = { distance = "2 m", pixels = [8, 8], pitch = "1 mm" }
object = [
    { name = "a", material = "water", shape = { box = { size = ["4 mm", "6 mm", "4 mm"] } } },
    { name = "b", material = "gold", position = ["-5 mm", "0 mm", "0 mm"], shape = { sphere = { radius = "0.2 mm", sides = 24 } }, instances = { packing = "spheres", region = { sphere = { radius = "1.5 mm" } }, count = 20, diameter_spread = 0.2 } },
    { name = "c", material = "gold", position = ["5 mm", "0 mm", "0 mm"], shape = { cylinder = { radius = "1.3 mm", height = "3 mm", sides = 300 } } },
]
"#;

    /// Corners of all facets in the sample, by placed surface (0 for none) and triangle.
    fn facets(sample: &Sample) -> Vec<([usize; 2], [DVec3; 3])> {
        let own = sample.triangles.iter().enumerate().map(|(at, corners)| {
            ([0, at], corners.map(|v| DVec3::from_array(sample.vertices[v as usize])))
        });
        let of_placed = sample.placed.iter().enumerate().flat_map(|(number, placed)| {
            let prototype = &sample.prototypes[placed.prototype as usize];
            (0..prototype.triangles.len()).map(move |at| {
                let corners = prototype.corners(at).map(|it| placed.place.world_from_own(it));
                ([number + 1, at], corners)
            })
        });
        own.chain(of_placed).collect()
    }

    #[test]
    fn facets_that_a_fan_cuts_are_those_of_all() {
        let scene = beamlet_model::scene::Scene::from_toml(SCENE, ".").expect("a scene");
        let sample = beamlet_geometry::load(&scene).expect("a sample");
        let across = beamlet_geometry::across_edges(&sample);
        let tree = FacetTree::new(&Bvh::build(&sample, &across, 0.0).expect("a tree"));
        let all = facets(&sample);
        assert!(sample.placed.len() >= 12, "{} places", sample.placed.len());
        let mut draws = Draws::new(7, [0; 3], 0);
        let mut found = 0;
        for _ in 0..200 {
            let mut between = |low: f64, high: f64| low + (high - low) * draws.uniform();
            let low = between(-7e-3, 7e-3);
            let slopes = [low, low + between(0.0, 2e-3)];
            let source = DVec3::new(0.0, -1.0, 0.0);
            let fan = Fan::new(source, slopes, between(-3e-3, 3e-3));
            let is_cut = |corners: &[DVec3; 3]| {
                let above = corners.map(|corner| fan.height(corner) >= 0.0);
                let slope = corners.map(|corner| corner.x / (corner.y + 1.0));
                above.contains(&true)
                    && above.contains(&false)
                    && slope.iter().any(|it| (slopes[0]..slopes[1]).contains(it))
            };
            let mut visited = BTreeSet::new();
            tree.each(&sample, &fan, &mut |placed, own, triangle| {
                let number = placed.map_or(0, |placed| {
                    let same = |it: &Placed| std::ptr::eq(it, placed);
                    sample.placed.iter().position(same).expect("a place") + 1
                });
                let corners =
                    all.iter().find(|(at, _)| *at == [number, triangle]).expect("a facet").1;
                // Heights in the frame of a mesh are those in the sample.
                if let Some(placed) = placed {
                    let prototype = &sample.prototypes[placed.prototype as usize];
                    let heights = prototype.corners(triangle).map(|corner| own.height(corner));
                    let off =
                        heights.iter().zip(corners).map(|(it, corner)| it - fan.height(corner));
                    assert!(off.into_iter().all(|off| off.abs() < 1e-15));
                }
                assert!(visited.insert([number, triangle]), "{number} {triangle} twice");
            });
            for (at, corners) in &all {
                if is_cut(corners) {
                    found += 1;
                    assert!(visited.contains(at), "{at:?} is missed");
                }
            }
            assert!(visited.len() < all.len(), "all facets are visited");
        }
        assert!(found > 1000, "{found} facets");
    }
}
