//! Building the tree.

use glam::{DVec3, Vec3};

use super::slab::{self, Slab};
use super::{Band, BoundsNode, LEAF, NONE, outwards};
use crate::surface::Surface;
use beamlet_core::numbers;

/// Fewer members than this are not worth a task of their own.
const TASK: usize = 4096;
/// Triangles of a leaf are larger than the distance between them where the leaf is at most this
/// much larger than the largest of them.
const CROWDED: f64 = 1.5;

/// Nodes of a tree over `members` members.
pub(super) const fn nodes_of(members: usize) -> usize {
    (2 * members.div_ceil(LEAF)).saturating_sub(1)
}

pub(super) struct Builder<'a, B> {
    pub(super) bounds: &'a B,
    pub(super) surface: Option<&'a Surface>,
}

impl<B: Fn(u32) -> [DVec3; 2] + Sync> Builder<'_, B> {
    /// Builds the first node of `nodes` and its descendants. `start`: indices of the first node and the
    /// first member in the tree.
    pub(super) fn build(
        &self,
        members: &mut [(Vec3, u32)],
        nodes: &mut [BoundsNode],
        start: [u32; 2],
    ) {
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
        let next = first_node + 1 + numbers::count(left_nodes.len());
        let starts = [[first_node + 1, first_member], [next, first_member + numbers::count(half)]];
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
                let shared = a.shared.map(|it| if b.shared.contains(&it) { it } else { NONE });
                self.slab(members, a.slab.between(&b.slab), [low, high])
                    .map(|slab| Box::new(Band { slab, shared }))
            }
            _ => None,
        };
        let plate = match (&a.plate, &b.plate) {
            (Some(a), Some(b)) => self.slab(members, a.between(b), [low, high]).map(Box::new),
            _ => None,
        };
        node[0] = BoundsNode { low, high, next, count: 0, band, plate };
    }

    fn leaf(&self, members: &[(Vec3, u32)], first: u32) -> BoundsNode {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = members.iter().fold(empty, |(low, high), (_, member)| {
            let bounds = (self.bounds)(*member);
            (low.min(bounds[0]), high.max(bounds[1]))
        });
        let [low, high] = outwards([low, high], 0.0);
        let band = self.surface.and_then(|surface| {
            let across = slab::across(surface.corners(members.first()?.1 as usize))?;
            let mut shared = surface.triangles[members[0].1 as usize];
            for (_, member) in &members[1..] {
                let others = surface.triangles[*member as usize];
                shared = shared.map(|it| if others.contains(&it) { it } else { NONE });
            }
            self.slab(members, across, [low, high]).map(|slab| Box::new(Band { slab, shared }))
        });
        let plate = self
            .normal(members, [low, high])
            .and_then(|normal| self.slab(members, normal, [low, high]))
            .map(Box::new);
        let count = u32::try_from(members.len()).unwrap_or(0);
        BoundsNode { low, high, next: first, count, band, plate }
    }

    /// The mean normal of the triangles of a leaf, either way round, if they fill the boxes of one
    /// another.
    fn normal(&self, members: &[(Vec3, u32)], [low, high]: [Vec3; 2]) -> Option<DVec3> {
        let surface = self.surface?;
        let largest = members.iter().fold(DVec3::ZERO, |largest, (_, member)| {
            let [low, high] = (self.bounds)(*member);
            largest.max(high - low)
        });
        // Boxes are rounded outwards.
        let slack =
            DVec3::splat(f64::from(8.0 * f32::EPSILON * low.abs().max(high.abs()).max_element()));
        if members.len() < 2 || (high - low).as_dvec3().cmpgt(CROWDED * largest + slack).any() {
            return None;
        }
        let normals = members.iter().map(|(_, member)| {
            let [a, b, c] = surface.corners(*member as usize);
            (b - a).cross(c - a)
        });
        let sum = normals.fold(DVec3::ZERO, |sum, normal| {
            if sum.dot(normal) < 0.0 { sum - normal } else { sum + normal }
        });
        sum.try_normalize()
    }

    /// The slab of triangles along a direction, if it is worth having.
    fn slab(&self, members: &[(Vec3, u32)], across: DVec3, bounds: [Vec3; 2]) -> Option<Slab> {
        let surface = self.surface?;
        let corners = members.iter().flat_map(|(_, member)| surface.corners(*member as usize));
        Slab::around(across, corners, bounds, 0.0)
    }
}
