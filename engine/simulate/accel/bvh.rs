//! The software BVH: compressed wide nodes, and leaves in their order. Ray query gets its
//! triangles in the same order: drivers that split in input order need it.

use super::placed::{placed_record, shape_record};
use beamlet_core::numbers::{self, single};
use beamlet_core::{Error, Result};
use beamlet_geometry::{CornerNormals, Prototype, Sample, corner_normals};
use beamlet_interface as interface;
use beamlet_interface::{
    FACET_LEAF, KIND_CROSSED, KIND_FRUSTUM, KIND_MESH, KIND_SMOOTH, LEAF_MESH, LEAF_SHAPE, Leaf,
    NO_LEAF, Node, STACK, SURFACE_INDEX,
};
use bytemuck::Zeroable;
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

/// Radii around shapes are larger by this share, so that rounding leaves out no ray.
const PARTNER_ROOM: f64 = 1e-6;

/// Nodes and leaves as the shaders read them: a tree over the triangles of the sample and its placed
/// surfaces, then one over each prototype in its own frame.
#[derive(Debug, Clone, Default)]
pub struct Bvh {
    /// Nodes; the root of the sample is the first.
    pub nodes: Vec<Node>,
    /// Leaves in the order of the trees.
    pub leaves: Vec<Leaf>,
    /// Triangle of each leaf, of the sample or of its prototype; beyond the triangles of the sample the index of a
    /// placed surface.
    pub(crate) facets: Vec<u32>,
    /// Padded boxes of the leaves of the sample, low and high corner.
    pub boxes: Vec<[[f32; 3]; 2]>,
    /// For each leaf those across its edges opposite to a, b, c, counted from the first of its
    /// tree; [`NO_LEAF`] at an open edge.
    pub neighbours: Vec<[u32; 3]>,
    /// Normals of the corners of each leaf, zero where facets refract by their own; empty if all do.
    pub corner_normals: Vec<CornerNormals>,
    /// Places of the sample, by prototype, then in the order of the leaves: consecutive ones are adjacent
    /// in memory.
    pub placed: Vec<interface::Placed>,
    /// Surfaces that are placed.
    pub prototypes: Vec<interface::Prototype>,
    /// Analytic shapes.
    pub shapes: Vec<interface::AnalyticShape>,
    /// Lists of the shapes that cross a shape: the object around all of them, counted from 1, their
    /// number, and the place and the radii of each.
    pub partners: Vec<u32>,
    /// `KIND_` bits of the placed leaves.
    pub kinds: u32,
}

/// Padding of boxes, as a share of the largest coordinate: bound of the rounding of the box test.
const PADDING: f64 = 1.0 / (1 << 19) as f64;

impl Bvh {
    /// Builds the trees of a sample; the surface of a leaf is its component. `across`: the triangles
    /// across the edges of each, as [`beamlet_geometry::across_edges`] finds them. `displacement`: how
    /// far views move the sample, m.
    ///
    /// # Errors
    /// [`Error::Mesh`] where a tree would be deeper than the shaders' stack, or there are
    /// more surfaces or facets than shaders can name.
    pub(crate) fn build(sample: &Sample, across: &[[u32; 3]], displacement: f64) -> Result<Self> {
        if sample.is_empty() {
            return Ok(Self::default());
        }
        if sample.components.len() > SURFACE_INDEX as usize {
            return Err(Error::mesh("sample", "has too many separate surfaces", ""));
        }
        let reach = sample.reach() + displacement;
        let vertex = |v: u32| DVec3::from_array(sample.vertices[v as usize]);
        let boxes_of_placed = sample.placed.iter().map(|placed| {
            let [low, high] = sample.bounds_of_placed(placed);
            Aabb::new(low.as_vec3a(), high.as_vec3a())
        });
        let boxes = || boxes_of(&sample.triangles, vertex).chain(boxes_of_placed.clone()).collect();
        let mut bvh = Self::default();
        let order = bvh.append(boxes, reach * PADDING, true)?;
        let triangles = numbers::count(sample.triangles.len());
        let places = places_of(sample, order.iter().filter_map(|i| i.checked_sub(triangles)));
        bvh.leaves = order
            .par_iter()
            .map(|&i| match i.checked_sub(triangles) {
                None => {
                    let corners = sample.triangles[i as usize].map(vertex);
                    leaf(corners, sample.triangle_component[i as usize])
                }
                Some(placed) => {
                    let prototype = sample.placed[placed as usize].prototype as usize;
                    let is_shape = sample.prototypes[prototype].shape.is_some();
                    let kind = if is_shape { LEAF_SHAPE } else { LEAF_MESH };
                    Leaf { surface: kind | places[placed as usize], ..Leaf::zeroed() }
                }
            })
            .collect();
        bvh.append_neighbours(&order, across);
        bvh.facets.clone_from(&order);
        let smooth = sample.components.iter().any(|component| component.smooth);
        if smooth {
            let vertices: Vec<DVec3> =
                sample.vertices.iter().map(|v| DVec3::from_array(*v)).collect();
            let of = |t: usize| sample.components[sample.triangle_component[t] as usize].smooth;
            bvh.append_normals(&order, &corner_normals(&vertices, &sample.triangles, of));
            bvh.kinds |= KIND_SMOOTH;
        }
        bvh.append_prototypes(sample, &places, reach)?;
        bvh.append_partners(sample, &places);
        Ok(bvh)
    }

    /// Trees of prototypes, and their places. `places`: [`places_of`] the sample.
    fn append_prototypes(&mut self, sample: &Sample, places: &[u32], reach: f64) -> Result<()> {
        let mut primitive = self.leaves.len() as u64;
        let mut first = 0_u32;
        self.placed = vec![interface::Placed::zeroed(); places.len()];
        for same in sample.placed.chunk_by(|a, b| a.prototype == b.prototype) {
            let prototype = &sample.prototypes[same[0].prototype as usize];
            let record = if let Some(shape) = prototype.shape {
                let (root, shape) = (numbers::count(self.shapes.len()), shape_record(shape));
                self.kinds |= KIND_FRUSTUM << shape.kind;
                self.shapes.push(shape);
                interface::Prototype { root, ..Zeroable::zeroed() }
            } else {
                let scales = same.iter().map(|it| it.place.scale * it.place.stretch.min(1.0));
                self.append_mesh(prototype, reach / scales.fold(f64::INFINITY, f64::min))?
            };
            let each = u64::from(record.leaves);
            let end = primitive + each * same.len() as u64;
            if end > u64::from(FACET_LEAF) {
                let problem = format!("its instances have {end} facets; allowed: {FACET_LEAF}");
                return Err(Error::mesh(
                    "sample",
                    problem,
                    "use a coarser mesh, or fewer instances",
                ));
            }
            let mut last = None;
            for (&place, it) in places[first as usize..].iter().zip(same) {
                let number = primitive + each * u64::from(place - first);
                self.placed[place as usize] =
                    placed_record(it, numbers::low_word(number), &mut last);
            }
            self.prototypes.push(interface::Prototype {
                primitive: numbers::low_word(primitive),
                placed: first,
                ..record
            });
            primitive = end;
            first += numbers::count(same.len());
        }
        Ok(())
    }

    /// The tree of a mesh that is placed; `reach`: of the sample in its frame, m.
    fn append_mesh(&mut self, mesh: &Prototype, reach: f64) -> Result<interface::Prototype> {
        self.kinds |= KIND_MESH;
        let vertex = |v: u32| mesh.vertices[v as usize];
        let own = mesh.vertices.iter().fold(0.0_f64, |m, v| m.max(v.abs().max_element()));
        let [root, leaf_base] = [self.nodes.len(), self.leaves.len()].map(numbers::count);
        let boxes = || boxes_of(&mesh.triangles, vertex).collect();
        let order = self.append(boxes, (reach + own) * PADDING, false)?;
        self.leaves.extend(order.iter().map(|&i| {
            let corners = mesh.triangles[i as usize].map(vertex);
            leaf(corners, mesh.triangle_component[i as usize])
        }));
        self.append_neighbours(&order, &mesh.across);
        self.facets.extend_from_slice(&order);
        if self.kinds & KIND_SMOOTH != 0 {
            let of = |t: usize| mesh.components[mesh.triangle_component[t] as usize].smooth;
            self.append_normals(&order, &corner_normals(&mesh.vertices, &mesh.triangles, of));
        }
        let leaves = numbers::count(order.len());
        Ok(interface::Prototype { root, leaf_base, leaves, ..Zeroable::zeroed() })
    }

    /// Lists of the shapes that cross a shape. `places`: [`places_of`] the sample.
    fn append_partners(&mut self, sample: &Sample, places: &[u32]) {
        for (at, partners) in sample.partners.lists() {
            let placed = &sample.placed[at as usize];
            let around = sample.components[placed.component as usize].outside;
            let first = numbers::count(self.partners.len());
            self.placed[places[at as usize] as usize].partners = first;
            self.partners.extend([around.map_or(0, |it| it + 1), numbers::count(partners.len())]);
            for partner in partners {
                let placed = &sample.placed[*partner as usize];
                let shape = sample.prototypes[placed.prototype as usize].shape;
                let scales = placed.place.scales();
                let radii = shape.map_or([f64::INFINITY; 2], |it| it.radii(scales));
                let [ball, rod] = radii.map(|it| single(it * (1.0 + PARTNER_ROOM)).to_bits());
                self.partners.extend([places[*partner as usize], ball, rod]);
            }
            self.kinds |= KIND_CROSSED;
        }
    }

    /// Adds the nodes of a tree over boxes that are widened by `pad`, m; the order of its leaves,
    /// which are to follow. `keep`: the boxes are kept in that order.
    fn append(&mut self, boxes: impl Fn() -> Vec<Aabb>, pad: f64, keep: bool) -> Result<Vec<u32>> {
        let pad = Vec3A::splat(single(pad));
        let padded = || {
            let mut boxes = boxes();
            boxes.par_iter_mut().for_each(|it| *it = Aabb::new(it.min - pad, it.max + pad));
            boxes
        };
        let mut tree = wide_tree(padded());
        if depth(&tree.nodes) > STACK as usize {
            tree = balanced(&padded());
        }
        let depth = depth(&tree.nodes);
        if depth > STACK as usize {
            return Err(Error::mesh(
                "sample",
                format!("its BVH is {depth} levels deep; allowed: {STACK}"),
                "look for triangles that lie on one another, or extreme scales",
            ));
        }
        if keep {
            let boxes = padded();
            let corners = |i: &u32| {
                let it = &boxes[*i as usize];
                [it.min.to_array(), it.max.to_array()]
            };
            self.boxes = tree.primitive_indices.par_iter().map(corners).collect();
        }
        let (first, leaf) = (numbers::count(self.nodes.len()), numbers::count(self.leaves.len()));
        let nodes: Vec<Node> = bytemuck::cast_slice(&tree.nodes).to_vec();
        self.nodes.extend(nodes.into_iter().map(|node| Node {
            child_base: node.child_base + first,
            leaf_base: node.leaf_base + leaf,
            ..node
        }));
        Ok(tree.primitive_indices)
    }

    fn append_neighbours(&mut self, order: &[u32], across: &[[u32; 3]]) {
        let mut place = vec![NO_LEAF; across.len()];
        for (leaf, triangle) in (0..).zip(order) {
            if let Some(place) = place.get_mut(*triangle as usize) {
                *place = leaf;
            }
        }
        let leaf_of = |triangle: u32| place.get(triangle as usize).copied().unwrap_or(NO_LEAF);
        let of = |i: &u32| across.get(*i as usize).map_or([NO_LEAF; 3], |it| it.map(leaf_of));
        self.neighbours.extend(order.iter().map(of));
    }

    fn append_normals(&mut self, order: &[u32], of: &[CornerNormals]) {
        let none = CornerNormals::default();
        let in_order = order.iter().map(|i| of.get(*i as usize).copied().unwrap_or(none));
        self.corner_normals.extend(in_order);
    }
}

/// Order of the placed surfaces of a sample on the device: by prototype, as in the sample, and within one
/// in the order of their leaves.
fn places_of(sample: &Sample, leaves: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut next = vec![u32::MAX; sample.prototypes.len()];
    for (place, placed) in (0..).zip(&sample.placed) {
        let first = &mut next[placed.prototype as usize];
        *first = place.min(*first);
    }
    let mut places = vec![0; sample.placed.len()];
    for placed in leaves {
        let next = &mut next[sample.placed[placed as usize].prototype as usize];
        places[placed as usize] = *next;
        *next += 1;
    }
    places
}

fn boxes_of(triangles: &[[u32; 3]], vertex: impl Fn(u32) -> DVec3) -> impl Iterator<Item = Aabb> {
    triangles.iter().map(move |corners| {
        let [a, b, c] = corners.map(|v| vertex(v).as_vec3a());
        Aabb::new(a.min(b).min(c), a.max(b).max(c))
    })
}

fn leaf([a, b, c]: [DVec3; 3], surface: u32) -> Leaf {
    Leaf {
        a: a.as_vec3().to_array(),
        b: b.as_vec3().to_array(),
        c: c.as_vec3().to_array(),
        normal: normal(a, b, c).as_vec3().to_array(),
        surface,
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

/// Levels of the tree. Children follow their parents in the array.
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
        let scene = beamlet_model::scene::Scene::from_toml(SHAPES, ".").expect("a scene");
        let sample = beamlet_geometry::load(&scene).expect("a sample");
        let across = beamlet_geometry::across_edges(&sample);
        let bvh = Bvh::build(&sample, &across, 0.0).expect("a tree");
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
