//! Error of a rectangle that is known by one ray: how its recorded light would change if it were
//! like the neighbour that it predicts worst.

use super::base_lattice::Found;
use super::error_estimate::{CellError, Draws, Estimator, SPREAD, THROWN};
use super::hardening::Hardening;
use super::neighbours::behind;
use super::patch::{Axis, Node, Patch, Slopes, alike, is_drawn, no_silhouette_between};
use beamlet_interface::RayResult;

/// Least displacement along z by which light enters the recorded rows, half rows.
const LEAST_REACH: f32 = 0.01;
/// Crossings up to which one silhouette may take or add all light of a rectangle.
const SILHOUETTE_CROSSINGS: f32 = 8.0;

/// Area that a body may take of a rectangle, over the part of a side that it takes.
const ENTERED: f32 = 1.0;

/// A rectangle that is known by a ray.
struct ByRay<'a> {
    /// Row of its patch.
    row: i64,
    node: &'a Node,
    slopes: Slopes,
    /// Column of its beamlet in the lattice.
    column: usize,
    /// Share of its light that passes the sample.
    passed: f32,
    /// x of its ray from the centre of the beamlet, and where it lands, m.
    x: f32,
    at: f32,
    /// Half the width over which its light lands, m.
    half: f32,
    /// Rows between it and the recorded rows; `None` within them.
    beside: Option<f32>,
}

/// Changes towards a neighbour.
#[derive(Default)]
struct Change {
    /// Change of the recorded light if the rectangle were like the neighbour, share of its light.
    light: f32,
    /// Part of it by light that crosses a border of the row.
    over: f32,
    /// Error of the displacement that the rectangle predicts there, m.
    moved: f32,
    /// The neighbour crosses other surfaces.
    silhouette: bool,
}

/// Light that a silhouette which bows into a rectangle from behind its neighbours may take or give, share
/// of its light; nothing where none does.
fn bowed(patch: &Patch, node: &Node, hardening: &Hardening) -> Option<f32> {
    let leaf = |at: [f32; 2]| &patch.nodes[patch.leaf_at(at[0], at[1]) as usize];
    let beyond = behind(patch, node)
        .filter(|at| patch.holds(*at))
        .map(|at| &leaf(at).result)
        .find(|result| !no_silhouette_between(result, &node.result))?;
    let passed = hardening.light(node.result.optical_depth.min(beyond.optical_depth));
    Some((patch.sagitta(node) / node.width()).min(1.0) * passed)
}

impl Estimator<'_> {
    /// Error of a rectangle that is known by a ray.
    pub(super) fn ray_error(&self, patch: &Patch, index: u32) -> CellError {
        let node = &patch.nodes[index as usize];
        let neighbours = self.neighbours(patch, node);
        let by_ray = self.by_ray(patch, node, self.slopes(node, &neighbours));
        let mut change = [0.0_f32; 2];
        let mut silhouette = false;
        let (mut moved, mut over) = (0.0_f32, 0.0_f32);
        let drawn = is_drawn(&node.result);
        let mut squares = (0.0_f32, 0_u32);
        for (number, found) in neighbours.iter().enumerate() {
            let Some(found) = found else { continue };
            let axis = number / 2;
            if drawn && is_drawn(&found.result) {
                squares.0 += self.change_by_draw(&by_ray, &found.result).powi(2);
                squares.1 += 1;
                continue;
            }
            let shown = self.change_to(&by_ray, found);
            change[axis] = change[axis].max(shown.light);
            moved = moved.max(shown.moved);
            over = over.max(shown.over);
            silhouette |= shown.silhouette;
        }
        if !silhouette && let Some(all) = self.entered(patch, node) {
            silhouette = true;
            change = change.map(|change| change.max(all));
        }
        if !silhouette && let Some(all) = bowed(patch, node, &self.response.hardening) {
            silhouette = true;
            change[1] = change[1].max(all);
        }
        let [width, height] = [node.width(), node.height() * self.row_height];
        // Rays that draw their normals form columns: rectangles one above the other err together at an
        // upright silhouette.
        let axis = if change[0] > 2.0 * change[1] {
            Axis::X
        } else if change[1] > 2.0 * change[0] || (height > width && !drawn) {
            Axis::Z
        } else {
            Axis::X
        };
        let area = node.width() * node.height() * self.response.weight;
        let light = area * SPREAD * change[0].max(change[1]);
        // Two draws differ by twice the variance of one.
        let variance = (squares.1 > 0).then_some(0.5 * squares.0 / squares.1 as f32);
        CellError {
            node: index,
            light,
            over: area * SPREAD * over,
            moment: SPREAD * area * by_ray.passed * moved,
            through: area * by_ray.passed,
            height: 1.0,
            silhouette: silhouette || drawn,
            axis,
            draws: drawn.then_some(Draws { area, others: light, variance }),
        }
    }

    fn by_ray<'a>(&self, patch: &Patch, node: &'a Node, slopes: Slopes) -> ByRay<'a> {
        let column = self.column(patch.beamlet);
        let x = patch.place(node.centre())[0];
        let growth = (self.response.magnification + slopes.displacement[0]).abs();
        // A slanting one has other x at its ends.
        let slant = self.response.magnification * (patch.shear * node.height()).abs();
        ByRay {
            row: patch.row,
            node,
            slopes,
            column,
            passed: self.light(&node.result),
            x,
            at: self.response.landing(column, x, node.result.displacement_x),
            half: 0.5 * (growth * node.width() + slant),
            beside: self.rows_beside(patch.row, node),
        }
    }

    /// Rows between a rectangle and the recorded rows; `None` within them.
    fn rows_beside(&self, row: i64, node: &Node) -> Option<f32> {
        let rows = &self.recorded_rows;
        let above = (rows.start - row) as f32 - node.z[1];
        let below = (row - rows.end) as f32 + node.z[0];
        (!rows.contains(&row)).then_some(above.max(below).max(0.0))
    }

    /// Light that a body which enters a rectangle between its ray and those in the middles of its neighbours may
    /// take or give, share of its light; nothing where no ray shows one.
    fn entered(&self, patch: &Patch, node: &Node) -> Option<f32> {
        let out = self.least.map(|least| 0.25 * least);
        let (part, result) = match patch.unlike_witness(node) {
            Some(witness) => (1.0, &witness.result),
            None => patch.unlike_beside(node, out)?,
        };
        let depth = node.result.optical_depth.min(result.optical_depth);
        Some((ENTERED * part).min(1.0) * self.response.hardening.light(depth))
    }

    /// Change of a rectangle towards a neighbour.
    fn change_to(&self, by_ray: &ByRay<'_>, found: &Found) -> Change {
        let own = &by_ray.node.result;
        let result = &found.result;
        // From a row beside the recorded ones, only light that lands there counts.
        let reaches = |result: &RayResult| {
            let rows = by_ray.beside.unwrap_or_default().max(LEAST_REACH);
            2.0 * result.landing_z(self.gap).abs() > rows * self.row_pitch
        };
        if by_ray.beside.is_some() && !reaches(own) && !reaches(result) {
            let there = self.light(result);
            let light = if alike(own, result) { 0.0 } else { THROWN * by_ray.passed.max(there) };
            Change { light, ..Change::default() }
        } else if alike(own, result) {
            self.change_on_surface(by_ray, found)
        } else {
            Change {
                light: self.change_over_silhouette(by_ray, result),
                silhouette: true,
                ..Change::default()
            }
        }
    }

    /// Change of the recorded light if a rectangle whose ray draws its normals had the draw of a
    /// neighbour.
    fn change_by_draw(&self, by_ray: &ByRay<'_>, result: &RayResult) -> f32 {
        let ByRay { node, column, passed, at, half, .. } = by_ray;
        let own = &node.result;
        let there = self.light(result);
        let moved = at + result.displacement_x - own.displacement_x;
        let light = self.response.change(*column, [*passed, *at], [there, moved], *half);
        let fall = (result.landing_z(self.gap) - own.landing_z(self.gap)).abs();
        light.hypot(passed * (fall / self.row_pitch).min(1.0))
    }

    /// True if a rectangle touches a border of its row, or its light crosses one if it lands up to `fall`
    /// rows elsewhere.
    fn crosses_border(&self, row: i64, node: &Node, fall: f32) -> bool {
        let down = self.down(&node.result);
        let lands = [node.z[0] + down - fall, node.z[1] + down + fall];
        node.z[0] <= 0.0
            || node.z[1] >= 1.0
            || lands[0].floor() < lands[1].floor()
            || self.lands_at_edge(row, lands)
    }

    /// Error of the linear result at a neighbour on the same surfaces.
    fn change_on_surface(&self, by_ray: &ByRay<'_>, found: &Found) -> Change {
        let ByRay { node, slopes, column, passed, at, half, .. } = by_ray;
        let (own, result, centre) = (&node.result, &found.result, node.centre());
        let apart = [found.x - centre[0], found.z - centre[1]];
        let off = |of: fn(&RayResult) -> f32, slopes: [f32; 2]| {
            of(result) - of(own) - slopes[0] * apart[0] - slopes[1] * apart[1]
        };
        let depth = off(|result| result.optical_depth, slopes.depth);
        let displacement = off(|result| result.displacement_x, slopes.displacement);
        // A slope between rays close to each other may predict any depth.
        let there = self.light(result);
        let expected = self.response.hardening.light(own.optical_depth + depth);
        let other = [expected.min(2.0 * passed.max(there)), at + displacement];
        let mut light = self.response.change(*column, [*passed, *at], other, *half);
        // Light that moves over the border of a row.
        let fall = result.landing_z(self.gap) - own.landing_z(self.gap);
        // Behind apertures that end along z cells have the slope over z.
        let known = if self.heights { slopes.landing[1] * apart[1] } else { 0.0 };
        let fall = (fall - known).abs() / self.row_pitch;
        let mut over = 0.0;
        if self.crosses_border(by_ray.row, node, fall) {
            over = passed * (fall / node.height()).min(1.0);
            light += over;
        }
        Change { light, over, moved: displacement.abs(), silhouette: false }
    }

    /// Change of the recorded light if the silhouette towards a neighbour were on the other side.
    fn change_over_silhouette(&self, by_ray: &ByRay<'_>, result: &RayResult) -> f32 {
        let ByRay { node, column, passed, x, at, half, .. } = *by_ray;
        let there = self.light(result);
        let moved = self.response.landing(column, x, result.displacement_x);
        let crossings = node.result.crossings.max(result.crossings).max(1);
        let all = (SILHOUETTE_CROSSINGS / crossings as f32).min(1.0) * passed.max(there);
        self.response.change(column, [passed, at], [there, moved], half).max(all)
    }
}
