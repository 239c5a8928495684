//! The software BVH: compressed wide nodes, and leaves in their order. Ray query gets its
//! triangles in the same order: drivers that split in input order need it.

use crate::geometry::Sample;
use crate::interface::{Leaf, NO_LEAF, Node, STACK, SURFACE_INDEX};
use crate::numbers::{self, single};
use crate::{Error, Result};
use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::ploc::PlocBuilder;
use rayon::prelude::*;

/// Triangles of a leaf: the most that the wide nodes can count.
const MOST_IN_LEAF: u32 = 3;

/// Nodes and leaves as the shaders read them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bvh {
    /// Nodes; the root is the first.
    pub nodes: Vec<Node>,
    /// Triangles in the order of the BVH.
    pub leaves: Vec<Leaf>,
    /// Padded boxes of the leaves, low and high corner.
    pub boxes: Vec<[[f32; 3]; 2]>,
    /// For each leaf those across its edges opposite to a, b, c; [`NO_LEAF`] at an open edge.
    pub neighbours: Vec<[u32; 3]>,
}

impl Bvh {
    /// Builds the BVH of a sample; the surface of a leaf is its component. `across`: the triangles
    /// across the edges of each, as [`crate::geometry::across_edges`] finds them.
    ///
    /// # Errors
    /// [`Error::Mesh`] where the tree would be deeper than the shaders' stack, or there are
    /// more surfaces than a leaf can name.
    pub(crate) fn build(sample: &Sample, across: &[[u32; 3]]) -> Result<Self> {
        if sample.triangles.is_empty() {
            return Ok(Self::default());
        }
        if sample.components.len() > SURFACE_INDEX as usize {
            return Err(Error::mesh("sample", "has too many separate surfaces", ""));
        }
        let corners = |t: &[u32; 3]| t.map(|v| DVec3::from_array(sample.vertices[v as usize]));
        // Boxes are padded by what the box test may lose to rounding at this distance.
        let reach = sample.vertices.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        let pad = Vec3A::splat(single(reach) * 2.0_f32.powi(-19));
        let padded = |t: &[u32; 3]| {
            let [a, b, c] = corners(t).map(|v| v.as_vec3a());
            Aabb::new(a.min(b).min(c) - pad, a.max(b).max(c) + pad)
        };
        let leaf_box = |i: &u32| {
            let b = padded(&sample.triangles[*i as usize]);
            [b.min.to_array(), b.max.to_array()]
        };
        let boxes = || sample.triangles.par_iter().map(padded).collect();
        let mut bvh = wide_tree(boxes());
        if depth(&bvh.nodes) > STACK as usize {
            bvh = balanced(&boxes());
        }
        let depth = depth(&bvh.nodes);
        if depth > STACK as usize {
            return Err(Error::mesh(
                "sample",
                format!("its BVH is {depth} levels deep, {STACK} are allowed"),
                "triangles that lie on one another, or extreme scales",
            ));
        }
        let leaves = bvh
            .primitive_indices
            .par_iter()
            .map(|&i| {
                let [a, b, c] = corners(&sample.triangles[i as usize]);
                Leaf {
                    a: a.as_vec3().to_array(),
                    b: b.as_vec3().to_array(),
                    c: c.as_vec3().to_array(),
                    normal: normal(a, b, c).as_vec3().to_array(),
                    surface: sample.triangle_component[i as usize],
                }
            })
            .collect();
        let boxes = bvh.primitive_indices.par_iter().map(leaf_box).collect();
        let mut place = vec![NO_LEAF; across.len()];
        for (leaf, triangle) in (0..).zip(&bvh.primitive_indices) {
            place[*triangle as usize] = leaf;
        }
        let leaf_of = |triangle: u32| place.get(triangle as usize).copied().unwrap_or(NO_LEAF);
        let neighbours =
            bvh.primitive_indices.iter().map(|i| across[*i as usize].map(leaf_of)).collect();
        Ok(Self { nodes: bytemuck::cast_slice(&bvh.nodes).to_vec(), leaves, boxes, neighbours })
    }
}

/// A BVH that halves its triangles at every level. Costs more to search than one built by
/// surface area, but stays shallow where that one becomes a chain: the slivers of a fan, as a
/// disc of a thousand sides is often cut into, lie in one another's boxes.
fn balanced(boxes: &[Aabb]) -> CwBvh {
    let mut order: Vec<u32> = (0..numbers::count(boxes.len())).collect();
    let mut nodes = vec![Bvh2Node::new(Aabb::empty(), 0, 0)];
    let mut open = vec![(0_usize, 0..boxes.len())];
    while let Some((index, range)) = open.pop() {
        let mine = &mut order[range.clone()];
        let of = |i: u32| &boxes[i as usize];
        let all = mine.iter().fold(Aabb::empty(), |all, &i| all.union(of(i)));
        if let [_] = mine {
            nodes[index] = Bvh2Node::new(all, 1, numbers::count(range.start));
            continue;
        }
        let centres: Vec<Vec3A> = mine.iter().map(|&i| of(i).center()).collect();
        let axis = Aabb::from_points(&centres).largest_axis();
        let half = mine.len() / 2;
        let key = |i: u32| of(i).center_axis(axis);
        mine.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let first = nodes.len();
        nodes.extend([nodes[index]; 2]);
        nodes[index] = Bvh2Node::new(all, 0, numbers::count(first));
        open.push((first, range.start..range.start + half));
        open.push((first + 1, range.start + half..range.end));
    }
    let binary = Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() };
    bvh2_to_cwbvh(&binary, MOST_IN_LEAF, true, false)
}

/// As `obvhs::cwbvh::builder::build_cwbvh`, but the boxes go before the tree is made wide: that
/// takes more memory than anything else in a run with millions of triangles.
fn wide_tree(boxes: Vec<Aabb>) -> CwBvh {
    // Pre-splitting would put a triangle into several leaves and count it twice.
    let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
    let indices = (0..u32::MAX).take(boxes.len()).collect();
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        &boxes,
        indices,
        params.sort_precision,
        params.search_depth_threshold,
    );
    drop(boxes);
    ReinsertionOptimizer::default().run(&mut tree, params.reinsertion_batch_ratio, None);
    bvh2_to_cwbvh(&tree, MOST_IN_LEAF, true, false)
}

fn normal(a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

/// Levels of the tree. Children stand behind their parents in the array.
fn depth(nodes: &[CwBvhNode]) -> usize {
    let mut levels = vec![0_usize; nodes.len()];
    let mut deepest = 0;
    let mut stack = vec![(0_usize, 1_usize)];
    while let Some((index, level)) = stack.pop() {
        if levels[index] != 0 {
            continue;
        }
        levels[index] = level;
        deepest = deepest.max(level);
        let node = &nodes[index];
        for child in 0..node.imask.count_ones() {
            stack.push(((node.child_base_idx + child) as usize, level + 1));
        }
    }
    deepest
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: &str = r#"
source = { distance = "1 m", spot = "0 um", energy = "30 keV" }
detector = { distance = "2 m", pixels = [8, 8], pitch = "1 mm" }
object = [
    { name = "a", material = "water", shape = { box = { size = ["4 mm", "6 mm", "4 mm"] } } },
    { name = "b", material = "gold", shape = { cylinder = { radius = "1.3 mm", height = "3 mm", sides = 3000 } } },
    { name = "c", material = "gold", shape = { sphere = { radius = "1 mm", sides = 64 } } },
]
"#;

    #[test]
    fn neighbours_share_the_edge_that_they_are_named_for() {
        let scene = crate::scene::Scene::from_toml(SHAPES, ".").expect("a scene");
        let sample = crate::geometry::load(&scene).expect("a sample");
        let bvh = Bvh::build(&sample, &crate::geometry::across_edges(&sample)).expect("a tree");
        for (leaf, around) in bvh.leaves.iter().zip(&bvh.neighbours) {
            let corners = [leaf.a, leaf.b, leaf.c];
            for (edge, &other) in around.iter().enumerate() {
                let there = bvh.leaves[other as usize];
                let there = [there.a, there.b, there.c];
                let shared = [corners[(edge + 1) % 3], corners[(edge + 2) % 3]];
                assert!(shared.iter().all(|c| there.contains(c)), "{corners:?} and {there:?}");
                assert!(!there.contains(&corners[edge]));
            }
        }
    }

    #[test]
    fn chain_of_nested_boxes_is_halved() {
        // Slivers of a fan: a shared apex, and rim points on a circle.
        let boxes: Vec<Aabb> = (0..5000)
            .map(|i| {
                let at = |i: f32| (std::f32::consts::TAU * i / 5000.0).sin_cos();
                let ((y, x), (v, u)) = (at(i as f32), at(i as f32 + 1.0));
                Aabb::from_points(
                    &[[1.0, 0.0], [x, y], [u, v]].map(|p| Vec3A::new(p[0], p[1], 0.0)),
                )
            })
            .collect();
        let bvh = balanced(&boxes);
        assert!(depth(&bvh.nodes) <= 13, "{} levels", depth(&bvh.nodes));
        let mut found = bvh.primitive_indices.clone();
        found.sort_unstable();
        assert!(found.iter().enumerate().all(|(i, &f)| i == f as usize) && found.len() == 5000);
    }
}
