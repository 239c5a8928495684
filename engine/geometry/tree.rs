//! A balanced tree of boxes over triangles or parts, built by all threads.
//!
//! Long thin triangles, as caps are cut into, fill the boxes of one another. Nodes of such
//! triangles that lie side by side in one plane have a *band* as well: a slab across them. So do
//! the sides of thousands of thin teeth, which lie one behind the other: nodes of triangles that
//! are larger than the distance between them have a *plate*, a slab along their normals.

mod build;
pub(crate) mod pairs;
mod query;
mod slab;

use beamlet_core::numbers;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::surface::{Surface, bounds_of};
use build::{Builder, nodes_of};
pub(crate) use query::Query;
use slab::Slab;

/// Members of a leaf at most.
pub(super) const LEAF: usize = 4;
/// Most nodes from which the search of adjacent leaves begins.
const STARTS: usize = 64;
/// Where a search of the whole tree begins.
const ROOT: [u32; 1] = [0];
/// In place of a vertex.
const NONE: u32 = u32::MAX;

/// The tree: nodes before their children, the left child right behind its parent.
#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<BoundsNode>,
    /// Members in the order of the leaves.
    order: Vec<u32>,
}

#[derive(Debug, Clone, Default)]
pub(super) struct BoundsNode {
    low: Vec3,
    high: Vec3,
    /// Leaf: its first member in the order. Inner node: its right child.
    next: u32,
    /// Members of a leaf; 0 for an inner node.
    count: u32,
    band: Option<Box<Band>>,
    plate: Option<Box<Slab>>,
}

/// Common properties of the triangles of a node that lie side by side.
#[derive(Debug, Clone)]
struct Band {
    /// Where they lie across their longest sides.
    slab: Slab,
    /// Vertices that all of them have.
    shared: [u32; 3],
}

impl Tree {
    /// The tree over the triangles of a surface.
    pub(super) fn of_triangles(surface: &Surface) -> Self {
        let bounds = |triangle: u32| bounds_of(surface.corners(triangle as usize).into_iter());
        Self::new(surface.triangles.len(), bounds, Some(surface))
    }

    /// The tree over boxes.
    pub(super) fn of_boxes(boxes: &[[DVec3; 2]]) -> Self {
        Self::new(boxes.len(), |member| boxes[member as usize], None)
    }

    fn new(
        count: usize,
        bounds: impl Fn(u32) -> [DVec3; 2] + Sync,
        surface: Option<&Surface>,
    ) -> Self {
        let mut members: Vec<(Vec3, u32)> = (0..numbers::count(count))
            .into_par_iter()
            .map(|member| {
                let [low, high] = bounds(member);
                (low.midpoint(high).as_vec3(), member)
            })
            .collect();
        let mut nodes = vec![BoundsNode::default(); nodes_of(count)];
        if count > 0 {
            let builder = Builder { bounds: &bounds, surface };
            builder.build(&mut members, &mut nodes, [0; 2]);
        }
        let order = members.par_iter().map(|(_, member)| *member).collect();
        Self { nodes, order }
    }

    /// Calls `visit` with members near `query`, until it returns false. Some may be further away.
    pub(super) fn near(&self, query: &Query, mut visit: impl FnMut(u32) -> bool) {
        let reaches = |node: &BoundsNode| query.reaches(node);
        self.walk(&ROOT, 0, reaches, |_, members| members.iter().all(|it| visit(*it)));
    }

    /// Calls `visit` with members of the leaves that overlap a box.
    pub(super) fn within(&self, [low, high]: [DVec3; 2], mut visit: impl FnMut(u32)) {
        let [low, high] = outwards([low, high], 0.0);
        let meets = |node: &BoundsNode| low.cmple(node.high).all() && node.low.cmple(high).all();
        self.walk(&ROOT, 0, meets, |_, members| {
            members.iter().for_each(|it| visit(*it));
            true
        });
    }

    /// Calls `visit` with members whose boxes, rounded outwards, enclose `inner`.
    pub(super) fn around(&self, inner: [DVec3; 2], mut visit: impl FnMut(u32)) {
        let encloses = |node: &BoundsNode| {
            let (low, high) = (node.low.as_dvec3(), node.high.as_dvec3());
            low.cmple(inner[0]).all() && inner[1].cmple(high).all()
        };
        self.walk(&ROOT, 0, encloses, |_, members| {
            members.iter().for_each(|it| visit(*it));
            true
        });
    }

    /// Calls `visit` with candidates of a ray, until it returns false; returns whether it never did. No
    /// part of the direction is 0.
    pub(super) fn along(
        &self,
        point: DVec3,
        direction: DVec3,
        mut visit: impl FnMut(u32) -> bool,
    ) -> bool {
        let inverse = direction.recip();
        let meets = |node: &BoundsNode| {
            let a = (node.low.as_dvec3() - point) * inverse;
            let b = (node.high.as_dvec3() - point) * inverse;
            let (mut enter, mut leave) = (a.min(b).max_element(), a.max(b).min_element());
            if let Some(band) = &node.band {
                let [low, high] = band.slab.along(point, direction);
                // NaN, where the ray runs along the border of the band, bounds nothing.
                enter = enter.max(low.min(high));
                leave = leave.min(low.max(high));
            }
            leave >= 0.0 && enter <= leave * (1.0 + 1e-12)
        };
        self.walk(&ROOT, 0, meets, |_, members| members.iter().all(|it| visit(*it)))
    }

    /// The leaves, in the order of the members.
    pub(super) fn leaves(&self) -> Vec<u32> {
        (0..numbers::count(self.nodes.len()))
            .filter(|node| self.nodes[*node as usize].count > 0)
            .collect()
    }

    /// Triangles of one of the [`Tree::leaves`].
    pub(super) fn triangles(&self, leaf: u32) -> &[u32] {
        self.members(&self.nodes[leaf as usize])
    }

    /// Start nodes of the search within `margin` of some of the [`Tree::leaves`], in the order of the
    /// nodes: adjacent leaves share the upper nodes.
    pub(super) fn start(&self, leaves: &[u32], margin: f64) -> Vec<u32> {
        let (low, high) = leaves
            .iter()
            .map(|leaf| &self.nodes[*leaf as usize])
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), node| {
                (low.min(node.low), high.max(node.high))
            });
        let [low, high] = outwards([low.as_dvec3(), high.as_dvec3()], margin);
        let meets = |at: &u32| {
            let node = &self.nodes[*at as usize];
            low.cmple(node.high).all() && node.low.cmple(high).all()
        };
        let mut start = vec![0];
        loop {
            let below: Vec<u32> = start
                .iter()
                .flat_map(|at| match &self.nodes[*at as usize] {
                    BoundsNode { count: 0, next, .. } => [Some(at + 1), Some(*next)],
                    _ => [Some(*at), None],
                })
                .flatten()
                .filter(meets)
                .collect();
            if below.len() > STARTS || below == start {
                return start;
            }
            start = below;
        }
    }

    fn members(&self, leaf: &BoundsNode) -> &[u32] {
        &self.order[leaf.next as usize..(leaf.next + leaf.count) as usize]
    }

    /// Visits the leaves of the nodes to enter, below the nodes `start` and from the node `from`
    /// on, until a visit returns false; whether none did.
    fn walk<'a>(
        &'a self,
        start: &[u32],
        from: u32,
        enter: impl Fn(&BoundsNode) -> bool,
        mut visit: impl FnMut(&'a BoundsNode, &'a [u32]) -> bool,
    ) -> bool {
        if self.nodes.is_empty() {
            return true;
        }
        // One entry per level, and nodes halve their members.
        let mut stack = [0_u32; 64 + STARTS];
        let before = start.partition_point(|at| *at <= from).saturating_sub(1);
        let mut height = 0;
        for at in start[before..].iter().rev() {
            stack[height] = *at;
            height += 1;
        }
        while height > 0 {
            height -= 1;
            let at = stack[height];
            let node = &self.nodes[at as usize];
            if !enter(node) {
                continue;
            }
            if node.count == 0 {
                stack[height] = node.next;
                stack[height + 1] = at + 1;
                height += if node.next > from { 2 } else { 1 };
            } else if !visit(node, self.members(node)) {
                return false;
            }
        }
        true
    }
}

/// A box rounded outwards to f32.
fn outwards([low, high]: [DVec3; 2], margin: f64) -> [Vec3; 2] {
    let down = (low - margin).as_vec3().to_array().map(f32::next_down);
    let up = (high + margin).as_vec3().to_array().map(f32::next_up);
    [down.into(), up.into()]
}
