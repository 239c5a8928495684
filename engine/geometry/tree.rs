//! A balanced tree of boxes over triangles or parts, built by all threads.
//!
//! Long thin triangles, as caps are cut into, fill the boxes of one another. Nodes of such
//! triangles that lie side by side have a band as well: a direction across them, and how far they
//! reach along it.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::surface::{Surface, bounds_of};

/// Members of a leaf at most.
const LEAF: usize = 4;
/// Fewer members than this are not worth a task of their own.
const TASK: usize = 4096;
/// A band must be this much narrower than the box, seen along its direction.
const WORTH: f64 = 4.0;
/// Share of the coordinates by which bands and boxes of queries are wider, against rounding.
const ROUNDING: f64 = 1e-14;
/// In place of a vertex.
const NONE: u32 = u32::MAX;

/// The tree: nodes before their children, the left child right behind its parent.
#[derive(Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// Members in the order of the leaves.
    order: Vec<u32>,
}

#[derive(Debug, Clone, Default)]
pub(super) struct Node {
    low: Vec3,
    high: Vec3,
    /// Leaf: its first member in the order. Inner node: its right child.
    next: u32,
    /// Members of a leaf; 0 for an inner node.
    count: u32,
    band: Option<Box<Band>>,
}

/// What the triangles of a node have in common if they lie side by side.
#[derive(Debug, Clone)]
struct Band {
    /// Unit vector across them.
    across: DVec3,
    /// Where they are along it, m.
    reach: [f64; 2],
    /// Vertices that all of them have.
    shared: [u32; 3],
}

/// A triangle, or another set of three points, that looks for what is near.
pub(super) struct Query {
    corners: [DVec3; 3],
    vertices: [u32; 3],
    margin: f64,
    low: Vec3,
    high: Vec3,
    /// Across a long thin triangle, and where it is along that.
    band: Option<(DVec3, [f64; 2])>,
    /// Whether it is the box, not the corners, that looks.
    whole: bool,
}

impl Query {
    /// What comes within `margin` of `corners`. Members that have a vertex in common with
    /// `vertices` are found if the opposite side comes near them, or if theirs comes near the
    /// query: see [`Tree::pairs`].
    pub(super) fn new(corners: [DVec3; 3], vertices: Option<[u32; 3]>, margin: f64) -> Self {
        let [low, high] = outwards(bounds_of(corners.into_iter()), margin);
        let band = across(corners).and_then(|across| {
            let reach = range(across, corners);
            worth(across, reach, [low, high]).then(|| (across, widened(reach, margin)))
        });
        Self {
            corners,
            vertices: vertices.unwrap_or([NONE; 3]),
            margin,
            low,
            high,
            band,
            whole: false,
        }
    }

    fn of_box(bounds: [DVec3; 2], margin: f64) -> Self {
        let [low, high] = outwards(bounds, margin);
        let middle = [bounds[0].midpoint(bounds[1]); 3];
        Self { corners: middle, vertices: [NONE; 3], margin, low, high, band: None, whole: true }
    }

    fn reaches(&self, node: &Node) -> bool {
        if !(self.low.cmple(node.high).all() && node.low.cmple(self.high).all()) {
            return false;
        }
        if let Some((across, reach)) = self.band {
            let (low, high) = (node.low.as_dvec3(), node.high.as_dvec3());
            let (middle, half) =
                (across.dot(low.midpoint(high)), across.abs().dot(high - low) / 2.0);
            if middle - half > reach[1] || middle + half < reach[0] {
                return false;
            }
        }
        let Some(band) = &node.band else { return true };
        if self.whole {
            let (low, high) = (self.low.as_dvec3(), self.high.as_dvec3());
            let middle = band.across.dot(low.midpoint(high));
            let half = band.across.abs().dot(high - low) / 2.0;
            return middle - half <= band.reach[1] && middle + half >= band.reach[0];
        }
        let common = |vertex: &u32| *vertex != NONE && band.shared.contains(vertex);
        let apart = |points: &[DVec3]| {
            let reach = points.iter().map(|point| band.across.dot(*point));
            let (low, high) = reach.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
            low > band.reach[1] + self.margin || high < band.reach[0] - self.margin
        };
        match self.vertices.iter().position(common) {
            None => !apart(&self.corners),
            Some(k) => {
                let side = [self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]];
                let [low, high] = outwards(bounds_of(side.into_iter()), self.margin);
                low.cmple(node.high).all() && node.low.cmple(high).all() && !apart(&side)
            }
        }
    }
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
        let mut members: Vec<(Vec3, u32)> = (0..u32::try_from(count).unwrap_or(u32::MAX))
            .into_par_iter()
            .map(|member| {
                let [low, high] = bounds(member);
                (low.midpoint(high).as_vec3(), member)
            })
            .collect();
        let mut nodes = vec![Node::default(); nodes_of(count)];
        if count > 0 {
            let builder = Builder { bounds: &bounds, surface };
            builder.build(&mut members, &mut nodes, [0; 2]);
        }
        let order = members.par_iter().map(|(_, member)| *member).collect();
        Self { nodes, order }
    }

    /// Calls `visit` with members near `query`, until it returns false. Some may be further away.
    pub(super) fn near(&self, query: &Query, mut visit: impl FnMut(u32) -> bool) {
        self.walk(0, |node| query.reaches(node), |_, members| members.iter().all(|it| visit(*it)));
    }

    /// Calls `visit` with members whose boxes, rounded outwards, enclose `inner`.
    pub(super) fn around(&self, inner: [DVec3; 2], mut visit: impl FnMut(u32)) {
        let encloses = |node: &Node| {
            let (low, high) = (node.low.as_dvec3(), node.high.as_dvec3());
            low.cmple(inner[0]).all() && inner[1].cmple(high).all()
        };
        self.walk(0, encloses, |_, members| {
            members.iter().for_each(|it| visit(*it));
            true
        });
    }

    /// Calls `visit` with members that a ray may meet, until it returns false; whether it never
    /// did. No part of the direction is 0.
    pub(super) fn along(
        &self,
        point: DVec3,
        direction: DVec3,
        mut visit: impl FnMut(u32) -> bool,
    ) -> bool {
        let inverse = direction.recip();
        let meets = |node: &Node| {
            let a = (node.low.as_dvec3() - point) * inverse;
            let b = (node.high.as_dvec3() - point) * inverse;
            let (mut enter, mut leave) = (a.min(b).max_element(), a.max(b).min_element());
            if let Some(band) = &node.band {
                let (start, slope) = (band.across.dot(point), band.across.dot(direction));
                let [low, high] = band.reach.map(|at| (at - start) / slope);
                // NaN, where the ray runs along the border of the band, bounds nothing.
                enter = enter.max(low.min(high));
                leave = leave.min(low.max(high));
            }
            leave >= 0.0 && enter <= leave * (1.0 + 1e-12)
        };
        self.walk(0, meets, |_, members| members.iter().all(|it| visit(*it)))
    }

    /// The leaves, in the order of the members.
    pub(super) fn leaves(&self) -> Vec<u32> {
        (0..u32::try_from(self.nodes.len()).unwrap_or(u32::MAX))
            .filter(|node| self.nodes[*node as usize].count > 0)
            .collect()
    }

    /// Calls `visit` with triangles of one of the [`Tree::leaves`] and others that come within
    /// `margin` of them, until it returns false. Of all leaves every pair is visited; some of those
    /// with a vertex in common twice.
    ///
    /// Two triangles with one vertex in common meet beyond it only where the opposite side of one
    /// meets the other, so in leaves of long thin ones only those are looked for: the thousands
    /// of a fan all meet in one vertex.
    pub(super) fn pairs(
        &self,
        surface: &Surface,
        leaf: u32,
        margin: f64,
        mut visit: impl FnMut(u32, u32) -> bool,
    ) {
        let node = &self.nodes[leaf as usize];
        let own = self.members(node);
        if node.band.is_none() {
            let bounds = |one: u32| bounds_of(surface.corners(one as usize).into_iter());
            let boxes: Vec<[Vec3; 2]> =
                own.iter().map(|one| outwards(bounds(*one), margin)).collect();
            let query = Query::of_box([node.low.as_dvec3(), node.high.as_dvec3()], margin);
            self.walk(
                leaf,
                |node| query.reaches(node),
                |other, members| {
                    let same = std::ptr::eq(node, other);
                    members.iter().enumerate().all(|(k, second)| {
                        let [low, high] = outwards(bounds(*second), 0.0);
                        let ones = own.iter().zip(&boxes).take(if same { k } else { own.len() });
                        ones.filter(|(_, it)| it[0].cmple(high).all() && low.cmple(it[1]).all())
                            .all(|(first, _)| visit(*first, *second))
                    })
                },
            );
            return;
        }
        for first in own {
            let vertices = surface.triangles[*first as usize];
            let query = Query::new(surface.corners(*first as usize), Some(vertices), margin);
            self.walk(
                0,
                |node| query.reaches(node),
                |other, members| {
                    // Leaves stand behind the nodes before them.
                    let later = other.next >= node.next;
                    members.iter().filter(|second| *second != first).all(|second| {
                        let common = || {
                            let others = surface.triangles[*second as usize];
                            others.iter().any(|vertex| vertices.contains(vertex))
                        };
                        !(later || common()) || visit(*first, *second)
                    })
                },
            );
        }
    }

    fn members(&self, leaf: &Node) -> &[u32] {
        &self.order[leaf.next as usize..(leaf.next + leaf.count) as usize]
    }

    /// Visits the leaves of the nodes to enter, from the node `from` on, until a visit returns
    /// false; whether none did.
    fn walk(
        &self,
        from: u32,
        enter: impl Fn(&Node) -> bool,
        mut visit: impl FnMut(&Node, &[u32]) -> bool,
    ) -> bool {
        if self.nodes.is_empty() {
            return true;
        }
        // One entry per level, and nodes halve their members.
        let mut stack = [0_u32; 64];
        let mut height = 1;
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

/// Nodes of a tree over so many members.
const fn nodes_of(members: usize) -> usize {
    (2 * members.div_ceil(LEAF)).saturating_sub(1)
}

struct Builder<'a, B> {
    bounds: &'a B,
    surface: Option<&'a Surface>,
}

impl<B: Fn(u32) -> [DVec3; 2] + Sync> Builder<'_, B> {
    /// Builds the node that is the first of `nodes`, and what is below it. `start`: places of
    /// the first node and the first member in the tree.
    fn build(&self, members: &mut [(Vec3, u32)], nodes: &mut [Node], start: [u32; 2]) {
        let number = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
        let [first_node, first_member] = start;
        if members.len() <= LEAF {
            nodes[0] = self.leaf(members, first_member);
            return;
        }
        let (low, high) =
            members.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), (at, _)| {
                (low.min(*at), high.max(*at))
            });
        let axis = (high - low).max_position();
        // Whole leaves on the left.
        let half = members.len().div_ceil(LEAF) / 2 * LEAF;
        members.select_nth_unstable_by(half, |(a, m), (b, n)| {
            a[axis].total_cmp(&b[axis]).then(m.cmp(n))
        });
        let (left, right) = members.split_at_mut(half);
        let (node, below) = nodes.split_at_mut(1);
        let (left_nodes, right_nodes) = below.split_at_mut(nodes_of(half));
        let next = first_node + 1 + number(left_nodes.len());
        let starts = [[first_node + 1, first_member], [next, first_member + number(half)]];
        if left.len() > TASK {
            rayon::join(
                || self.build(left, left_nodes, starts[0]),
                || self.build(right, right_nodes, starts[1]),
            );
        } else {
            self.build(left, left_nodes, starts[0]);
            self.build(right, right_nodes, starts[1]);
        }
        let (a, b) = (&left_nodes[0], &right_nodes[0]);
        let (low, high) = (a.low.min(b.low), a.high.max(b.high));
        let band = match (&a.band, &b.band) {
            (Some(a), Some(b)) => {
                let across = a.across + b.across * a.across.dot(b.across).signum();
                let shared = a.shared.map(|it| if b.shared.contains(&it) { it } else { NONE });
                self.band(members, across.normalize_or_zero(), shared, [low, high])
            }
            _ => None,
        };
        node[0] = Node { low, high, next, count: 0, band };
    }

    fn leaf(&self, members: &[(Vec3, u32)], first: u32) -> Node {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = members.iter().fold(empty, |(low, high), (_, member)| {
            let bounds = (self.bounds)(*member);
            (low.min(bounds[0]), high.max(bounds[1]))
        });
        let [low, high] = outwards([low, high], 0.0);
        let band = self.surface.and_then(|surface| {
            let corners = |(_, member): &(Vec3, u32)| surface.corners(*member as usize);
            let across = across(corners(members.first()?))?;
            let mut shared = surface.triangles[members[0].1 as usize];
            for (_, member) in &members[1..] {
                let others = surface.triangles[*member as usize];
                shared = shared.map(|it| if others.contains(&it) { it } else { NONE });
            }
            self.band(members, across, shared, [low, high])
        });
        Node { low, high, next: first, count: u32::try_from(members.len()).unwrap_or(0), band }
    }

    /// The band of triangles, if it is worth having.
    fn band(
        &self,
        members: &[(Vec3, u32)],
        across: DVec3,
        shared: [u32; 3],
        [low, high]: [Vec3; 2],
    ) -> Option<Box<Band>> {
        let surface = self.surface?;
        let corners = members.iter().flat_map(|(_, member)| surface.corners(*member as usize));
        let reach = range(across, corners);
        let largest = low.abs().max(high.abs()).max_element();
        let reach = widened(reach, ROUNDING * f64::from(largest));
        worth(across, reach, [low, high]).then(|| Box::new(Band { across, reach, shared }))
    }
}

/// Unit vector in the plane of a long thin triangle across its longest side.
fn across(corners: [DVec3; 3]) -> Option<DVec3> {
    let [a, b, c] = corners;
    let longest = [b - a, c - b, a - c]
        .into_iter()
        .max_by(|p, q| p.length_squared().total_cmp(&q.length_squared()))?;
    let normal = (b - a).cross(c - a);
    let thin = WORTH * normal.length() < longest.length_squared();
    if thin { normal.cross(longest).try_normalize() } else { None }
}

fn range(across: DVec3, points: impl IntoIterator<Item = DVec3>) -> [f64; 2] {
    points.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], point| {
        let at = across.dot(point);
        [low.min(at), high.max(at)]
    })
}

/// Whether a band tells more than the box.
fn worth(across: DVec3, reach: [f64; 2], [low, high]: [Vec3; 2]) -> bool {
    WORTH * (reach[1] - reach[0]) < across.abs().dot((high - low).as_dvec3())
}

fn widened([low, high]: [f64; 2], by: f64) -> [f64; 2] {
    [low - by, high + by]
}

/// A box rounded outwards to f32.
fn outwards([low, high]: [DVec3; 2], margin: f64) -> [Vec3; 2] {
    let down = (low - margin).as_vec3().to_array().map(f32::next_down);
    let up = (high + margin).as_vec3().to_array().map(f32::next_up);
    [down.into(), up.into()]
}
