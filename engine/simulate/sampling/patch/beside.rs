//! Surfaces in a rectangle or beside it that its own ray does not show.

use super::{Node, Patch, no_silhouette_between};
use beamlet_interface::RayResult;

/// A ray beside the rays of rectangles.
#[derive(Debug, Clone, Copy)]
pub(in crate::sampling) struct Witness {
    /// Coordinates.
    pub(in crate::sampling) at: [f32; 2],
    pub(in crate::sampling) result: RayResult,
}

impl Patch {
    /// A witness in a rectangle that crossed other surfaces than its ray.
    pub(in crate::sampling) fn unlike_witness(&self, node: &Node) -> Option<&Witness> {
        self.witnesses.iter().find(|witness| {
            node.holds(witness.at) && !no_silhouette_between(&witness.result, &node.result)
        })
    }

    /// Leaves along the sides of a rectangle whose rays crossed other surfaces: the largest part of a
    /// side that they take, and the result of one; `None` without such leaves. `out`: search distance
    /// beyond the sides.
    pub(in crate::sampling) fn unlike_beside(
        &self,
        node: &Node,
        out: [f32; 2],
    ) -> Option<(f32, &RayResult)> {
        let sides = [[0, 0], [0, 1], [1, 0], [1, 1]];
        let unlike = |[axis, end]: [usize; 2]| {
            let own = [node.x, node.z];
            let (range, step) = (own[1 - axis], out[1 - axis]);
            let beyond = if end == 0 { -out[axis] } else { out[axis] };
            let (mut at, mut part, mut found) = (range[0], 0.0, None);
            while at < range[1] {
                let mut place = [own[axis][end] + beyond; 2];
                place[1 - axis] = at + step;
                if !self.holds(place) {
                    break;
                }
                let leaf = &self.nodes[self.leaf_at(place[0], place[1]) as usize];
                let next = [leaf.x, leaf.z][1 - axis][1].max(at + step).min(range[1]);
                if !no_silhouette_between(&leaf.result, &node.result) {
                    part += next - at;
                    found = Some(&leaf.result);
                }
                at = next;
            }
            Some((part / (range[1] - range[0]), found?))
        };
        sides.into_iter().filter_map(unlike).max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// How far a silhouette may bow between the middle of a rectangle and its ends of z, m.
    pub(in crate::sampling) fn sagitta(&self, node: &Node) -> f32 {
        0.125 * self.bow * node.height() * node.height()
    }
}
