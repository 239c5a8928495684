//! Neighbours of a rectangle, and the slopes of its result that follow from them.

use super::base_lattice::Found;
use super::error_estimate::Estimator;
use super::patch::{Node, Patch, Slopes, alike, is_drawn};
use beamlet_interface::RayResult;

/// Slope from those to two neighbours on either side (van Leer): none where they disagree in sign.
fn limited(slopes: [Option<f32>; 2]) -> f32 {
    match slopes {
        [Some(a), Some(b)] => {
            if a * b > 0.0 {
                2.0 * a * b / (a + b)
            } else {
                0.0
            }
        }
        [Some(slope), None] | [None, Some(slope)] => slope,
        [None, None] => 0.0,
    }
}

/// Coordinates at lower and higher x, as far from a rectangle as a silhouette there may bow into it;
/// none where none bows.
pub(super) fn behind(patch: &Patch, node: &Node) -> impl Iterator<Item = [f32; 2]> + use<> {
    let [x, z] = node.centre();
    let sagitta = patch.sagitta(node);
    let off = 0.5 * node.width() + sagitta;
    [x - off, x + off].into_iter().filter(move |_| sagitta > 0.0).map(move |x| [x, z])
}

impl Estimator<'_> {
    /// The result of a base ray around a patch, at coordinates of the patch.
    fn around(&self, patch: &Patch, own: &RayResult, [x, z]: [f32; 2]) -> Option<Found> {
        let place = patch.place([x, z]);
        let at = |shift: f32| {
            let place = [place[0] + shift, place[1]];
            let mut found = self.base.at(patch.beamlet, patch.row, place)?;
            [found.x, found.z] = patch.coordinates([found.x, found.z]);
            Some(found)
        };
        let nearest = at(0.0)?;
        if (0.0..1.0).contains(&z) || alike(&nearest.result, own) {
            return Some(nearest);
        }
        // Rays in the rows above and below are far apart: a silhouette between two of them is unrelated
        // to a narrow rectangle.
        let beside = [-self.base.width(), self.base.width()].into_iter().filter_map(at);
        Some(beside.into_iter().find(|found| alike(&found.result, own)).unwrap_or(nearest))
    }

    /// Coordinates beside a rectangle. `side`: at lower or higher x, above or below; `along`: from its middle, as a
    /// share of the side.
    fn beside(&self, node: &Node, side: usize, along: f32) -> [f32; 2] {
        let [x, z] = node.centre();
        let edge = if side.is_multiple_of(2) { -1.0 } else { 1.0 };
        if side < 2 {
            let off = 0.5 * node.width() + 0.25 * self.least[0];
            [x + edge * off, z + along * node.height()]
        } else {
            let off = 0.5 * node.height() + 0.25 * self.least[1];
            [x + along * node.width(), z + edge * off]
        }
    }

    /// Neighbours of a rectangle: at lower and higher x, above and below.
    pub(super) fn neighbours(&self, patch: &Patch, node: &Node) -> [Option<Found>; 4] {
        std::array::from_fn(|side| {
            let at = self.beside(node, side, 0.0);
            if !patch.holds(at) {
                return self.around(patch, &node.result, at);
            }
            let leaf = &patch.nodes[patch.leaf_at(at[0], at[1]) as usize];
            let [x, z] = leaf.centre();
            Some(Found { result: leaf.result, x, z })
        })
    }

    /// Leaves beside a rectangle in its own patch, whose errors follow its result.
    pub(super) fn leaves_beside<'p>(
        &self,
        patch: &'p Patch,
        node: &Node,
    ) -> impl Iterator<Item = u32> + 'p {
        let along = [-1.0 / 3.0, 0.0, 1.0 / 3.0];
        let beside = |side| along.map(|along| self.beside(node, side, along));
        let places = [0, 1, 2, 3].map(beside);
        let mut last = None;
        places.into_iter().flatten().chain(behind(patch, node)).filter_map(move |at| {
            let known = last.is_some_and(|last: u32| patch.nodes[last as usize].holds(at));
            if known || !patch.holds(at) {
                return None;
            }
            last = Some(patch.leaf_at(at[0], at[1]));
            last
        })
    }

    /// Slopes of the result of a rectangle, from neighbours that crossed the same components.
    pub(super) fn slopes(&self, node: &Node, neighbours: &[Option<Found>; 4]) -> Slopes {
        let centre = node.centre();
        let own = &node.result;
        // Between rays that draw their normals nothing is interpolated.
        if is_drawn(own) {
            return Slopes::default();
        }
        let comparable = |result: &RayResult| alike(result, own) && !is_drawn(result);
        let slope = |of: &dyn Fn(&RayResult) -> f32| {
            let mut slopes = [0.0_f32; 2];
            // Neighbours of other sizes lie diagonally: subtract the change along the other axis.
            for axis in [1, 0, 1] {
                let along = [2 * axis, 2 * axis + 1].map(|side| {
                    let found = neighbours[side].as_ref().filter(|it| comparable(&it.result))?;
                    let apart = [found.x - centre[0], found.z - centre[1]];
                    let rise = of(&found.result) - of(own) - slopes[1 - axis] * apart[1 - axis];
                    Some(rise / apart[axis])
                });
                slopes[axis] = limited(along);
            }
            slopes
        };
        Slopes {
            depth: slope(&|result| result.optical_depth),
            displacement: slope(&|result| result.displacement_x),
            landing: match self.heights {
                true => slope(&|result| result.landing_z(self.gap)),
                false => [0.0; 2],
            },
        }
    }
}
