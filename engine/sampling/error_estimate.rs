//! Error of the quadrature over a patch: what recorded values may miss because each rectangle has
//! one ray.
//!
//! The law of a rectangle is linear, with slopes from its neighbours. Its error is taken from the
//! neighbours that it predicts worst: the change of the recorded light if the rectangle were like
//! that neighbour, times 1 / sqrt(12), the standard deviation of a place spread evenly over a step.
//! Errors of rectangles add up as independent ones.

use super::base_lattice::{BaseLattice, Found};
use super::patch::{Axis, Node, Patch, alike};
use super::response::{Opening, Response};
use crate::gpu::interface::Law;
use std::ops::Range;

/// Share of the light at a silhouette that may land in recorded rows from outside.
const THROWN: f32 = 0.05;
/// Neighbours are compared with a rectangle where their centres stand no farther aside than this
/// part of its size: as far as those of rectangles three times as large do.
const NEAR: f32 = 1.05;
/// Rectangles that would hold this part of the budget, were all like them, are not split.
const NEGLIGIBLE: f64 = 0.01;
/// Standard deviation of a place spread evenly over an interval, share of the interval.
const SPREAD: f32 = 0.288_675_13;
/// Part of the budget that refinement aims at.
const SAFETY: f64 = 0.5;
/// A silhouette among at most as many crossings may take or give all light of a rectangle.
const SILHOUETTE_CROSSINGS: f32 = 8.0;

/// What sampling may leave, by patch.
#[derive(Debug, Clone, Copy)]
pub struct ErrorBudget {
    /// Error of a recorded value, share of open beam.
    pub light: f64,
    /// Error of the mean displacement on the analyser where no silhouette crosses, m; infinite
    /// without a sample mask.
    pub displacement: f64,
    /// Most rays of a patch.
    pub max_rays: u32,
}

/// Estimated errors of the recorded values of patches: of each patch the largest over the mask
/// steps, share of open beam.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SamplingEstimate {
    /// Patches that the sample touches.
    pub patches: u64,
    /// Their rays.
    pub rays: u64,
    /// Rays of the patch with the most.
    pub most_rays: u32,
    /// Sum of the squared errors.
    pub square: f64,
    /// Largest error.
    pub worst: f64,
    /// Patches whose error exceeds the tolerance.
    pub beyond: u64,
}

impl SamplingEstimate {
    /// Adds a patch.
    pub(super) fn add(&mut self, light: f64, rays: u32, tolerance: f64) {
        self.join(&Self {
            patches: 1,
            rays: rays.into(),
            most_rays: rays,
            square: light * light,
            worst: light,
            beyond: u64::from(light > tolerance),
        });
    }

    /// Logs rays and errors; values that may miss the tolerance as a warning.
    pub(crate) fn log(&self, tolerance: f64) {
        if self.patches == 0 {
            return;
        }
        let patches = self.patches as f64;
        log::info!(
            "sampling: {:.1} rays per beamlet and row, at most {}; estimated error {:.1e} of open \
             beam (rms), {:.1e} (worst)",
            self.rays as f64 / patches,
            self.most_rays,
            (self.square / patches).sqrt(),
            self.worst
        );
        if self.beyond > 0 {
            log::warn!(
                "{} of {} beamlets and rows may miss the tolerance of {tolerance:.1e} of open beam",
                self.beyond,
                self.patches
            );
        }
    }

    /// Adds those of other patches.
    pub fn join(&mut self, other: &Self) {
        self.patches += other.patches;
        self.rays += other.rays;
        self.most_rays = self.most_rays.max(other.most_rays);
        self.square += other.square;
        self.worst = self.worst.max(other.worst);
        self.beyond += other.beyond;
    }
}

/// Slopes of optical depth and displacement along x (per m) and z (per row).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Slopes {
    pub(super) depth: [f32; 2],
    pub(super) displacement: [f32; 2],
}

/// Error of one rectangle, for a mask step that opens all of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct CellError {
    node: u32,
    /// Of the recorded light, share of open beam.
    light: f32,
    /// Light that passes the sample times the error of its displacement, m.
    moment: f32,
    /// Light that passes the sample, share of open beam.
    through: f32,
    /// A neighbour crossed other objects.
    silhouette: bool,
    axis: Axis,
}

/// Error of a patch, and where to split it.
#[derive(Debug, Default)]
pub(super) struct PatchError {
    /// Leaves to split, with the axis.
    pub(super) splits: Vec<(u32, Axis)>,
    /// Estimated error of the recorded value that has the largest, share of open beam.
    pub(super) light: f64,
}

/// Judges the patches of a view.
#[derive(Debug)]
pub(super) struct Estimator<'a> {
    pub(super) response: &'a Response,
    pub(super) budget: ErrorBudget,
    pub(super) base: &'a BaseLattice,
    /// First beamlet of the lattice.
    pub(super) first_beamlet: i64,
    /// Least width (m) and height (rows) of a rectangle.
    pub(super) least: [f32; 2],
    /// Height of a row in the cell plane, m: what counts as square.
    pub(super) row_height: f32,
    /// Row pitch on the detector, m, and distance from analyser to detector, m.
    pub(super) row_pitch: f32,
    pub(super) gap: f32,
    /// Rows whose light is recorded.
    pub(super) lit: Range<i64>,
}

/// Rectangles of a patch that must be split whatever their neighbours say: a component may hide
/// in wider or higher ones.
#[derive(Debug, Clone, Copy)]
pub(super) struct Narrow {
    pub(super) x: [f32; 2],
    pub(super) z: [f32; 2],
    pub(super) width: f32,
    pub(super) height: f32,
}

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

impl Estimator<'_> {
    /// The law of a base ray around a patch, at coordinates of the patch.
    fn around(&self, patch: &Patch, own: &Law, [x, z]: [f32; 2]) -> Option<Found> {
        let place = patch.place([x, z]);
        let at = |shift: f32| {
            let place = [place[0] + shift, place[1]];
            let mut found = self.base.at(patch.beamlet, patch.row, place)?;
            [found.x, found.z] = patch.coordinates([found.x, found.z]);
            Some(found)
        };
        let nearest = at(0.0)?;
        if (0.0..1.0).contains(&z) || alike(&nearest.law, own) {
            return Some(nearest);
        }
        // In the rows above and below rays stand far apart: a silhouette between two of them says
        // nothing of a narrow rectangle.
        let beside = [-self.base.width(), self.base.width()].into_iter().filter_map(at);
        Some(beside.into_iter().find(|found| alike(&found.law, own)).unwrap_or(nearest))
    }

    /// Coordinates beside a rectangle, three on each side: at lower and higher x, above and below.
    fn beside(&self, node: &Node) -> [[f32; 2]; 12] {
        let [x, z] = node.centre();
        let out = [0.25 * self.least[0], 0.25 * self.least[1]];
        let along = [-1.0 / 3.0, 0.0, 1.0 / 3.0];
        std::array::from_fn(|index| {
            let (side, along) = (index / 3, along[index % 3]);
            let edge = if side % 2 == 0 { -1.0 } else { 1.0 };
            if side < 2 {
                [x + edge * (0.5 * node.width() + out[0]), z + along * node.height()]
            } else {
                [x + along * node.width(), z + edge * (0.5 * node.height() + out[1])]
            }
        })
    }

    /// Neighbours of a rectangle, three on each side: at lower and higher x, above and below.
    pub(super) fn neighbours(&self, patch: &Patch, node: &Node) -> [Option<Found>; 12] {
        let [x, z] = node.centre();
        let [width, height] = [NEAR * node.width(), NEAR * node.height()];
        let places = self.beside(node);
        let mut last = None;
        std::array::from_fn(|index| {
            // Along straight silhouettes rectangles are narrow and their neighbours many.
            if !patch.straight && index % 3 != 1 {
                return None;
            }
            let at = places[index];
            // One neighbour along the whole side is taken once.
            let found = if patch.holds(at) {
                if last.is_some_and(|last: u32| patch.nodes[last as usize].holds(at)) {
                    return None;
                }
                let leaf = patch.leaf_at(at[0], at[1]);
                last = Some(leaf);
                let leaf = &patch.nodes[leaf as usize];
                let [x, z] = leaf.centre();
                Found { law: leaf.law, x, z }
            } else if index % 3 == 1 {
                self.around(patch, &node.law, at)?
            } else {
                return None;
            };
            // A much wider neighbour is compared with this rectangle from its own side.
            let near = if !patch.straight {
                true
            } else if index < 6 {
                (found.z - z).abs() <= height || !alike(&found.law, &node.law)
            } else {
                (found.x - x).abs() <= width
            };
            near.then_some(found)
        })
    }

    /// Leaves beside a rectangle in its own patch, whose errors follow its law.
    pub(super) fn leaves_beside<'p>(
        &self,
        patch: &'p Patch,
        node: &Node,
    ) -> impl Iterator<Item = u32> + 'p {
        let mut last = None;
        self.beside(node).into_iter().filter_map(move |at| {
            let known = last.is_some_and(|last: u32| patch.nodes[last as usize].holds(at));
            if known || !patch.holds(at) {
                return None;
            }
            last = Some(patch.leaf_at(at[0], at[1]));
            last
        })
    }

    /// Slopes of the law of a rectangle, from neighbours that crossed the same objects.
    pub(super) fn slopes(&self, node: &Node, neighbours: &[Option<Found>; 12]) -> Slopes {
        let centre = node.centre();
        let own = &node.law;
        let slope = |of: fn(&Law) -> f32| {
            let mut slopes = [0.0_f32; 2];
            // Neighbours of other sizes stand aslant: what the other axis explains is taken off.
            for axis in [1, 0, 1] {
                let along = [2 * axis, 2 * axis + 1].map(|side| {
                    let found = neighbours[3 * side..3 * side + 3].iter().flatten();
                    let apart = |found: &Found| [found.x - centre[0], found.z - centre[1]];
                    let nearest = found.filter(|found| alike(&found.law, own)).min_by(|a, b| {
                        let off = |found: &Found| apart(found)[1 - axis].abs();
                        off(a).total_cmp(&off(b))
                    })?;
                    let apart = apart(nearest);
                    let rise = of(&nearest.law) - of(own) - slopes[1 - axis] * apart[1 - axis];
                    Some(rise / apart[axis])
                });
                slopes[axis] = limited(along);
            }
            slopes
        };
        Slopes {
            depth: slope(|law| law.optical_depth),
            displacement: slope(|law| law.displacement_x),
        }
    }

    fn cell_error(&self, patch: &Patch, index: u32) -> CellError {
        let node = &patch.nodes[index as usize];
        let neighbours = self.neighbours(patch, node);
        let slopes = self.slopes(node, &neighbours);
        let column = usize::try_from(patch.beamlet - self.first_beamlet).unwrap_or(0);
        let own = &node.law;
        let centre = node.centre();
        let area = node.width() * node.height() * self.response.weight;
        let passed = (-own.optical_depth).exp();
        let x = patch.place(centre)[0];
        let at = self.response.landing(column, x, own.displacement_x);
        let half =
            0.5 * (self.response.magnification + slopes.displacement[0]).abs() * node.width();
        let landing_z = |law: &Law| law.displacement_z + self.gap * law.slope_z;
        let at_border = node.z[0] <= 0.0 || node.z[1] >= 1.0;
        // From a row beside the recorded ones, only light that lands there counts.
        let beside = (self.lit.start - patch.row).max(patch.row + 1 - self.lit.end).max(0);
        let reaches = |law: &Law| 2.0 * landing_z(law).abs() > beside as f32 * self.row_pitch;
        let mut change = [0.0_f32; 2];
        let mut silhouette = false;
        let mut moved: f32 = 0.0;
        for (number, found) in neighbours.iter().enumerate() {
            let Some(found) = found else { continue };
            let law = &found.law;
            let axis = number / 6;
            let light = if beside > 0 && !reaches(own) && !reaches(law) {
                if alike(own, law) { 0.0 } else { THROWN * passed.max((-law.optical_depth).exp()) }
            } else if alike(own, law) {
                let apart = [found.x - centre[0], found.z - centre[1]];
                let off = |of: fn(&Law) -> f32, slopes: [f32; 2]| {
                    of(law) - of(own) - slopes[0] * apart[0] - slopes[1] * apart[1]
                };
                let depth = off(|law| law.optical_depth, slopes.depth);
                let displacement = off(|law| law.displacement_x, slopes.displacement);
                moved = moved.max(displacement.abs());
                let other = [passed * (-depth).exp(), at + displacement];
                let mut light = self.response.change([passed, at], other, half);
                if at_border {
                    // Light that moves over the border of the row.
                    let down = (landing_z(law) - landing_z(own)).abs() / self.row_pitch;
                    light += passed * (down / node.height()).min(1.0);
                }
                light
            } else {
                silhouette = true;
                let there = (-law.optical_depth).exp();
                let moved = self.response.landing(column, x, law.displacement_x);
                let share = SILHOUETTE_CROSSINGS / own.crossings.max(law.crossings).max(1) as f32;
                let all = share.min(1.0) * passed.max(there);
                self.response.change([passed, at], [there, moved], half).max(all)
            };
            change[axis] = change[axis].max(light);
        }
        let [width, height] = [node.width(), node.height() * self.row_height];
        let axis = if change[0] > 2.0 * change[1] {
            Axis::X
        } else if change[1] > 2.0 * change[0] || height > width {
            Axis::Z
        } else {
            Axis::X
        };
        CellError {
            node: index,
            light: SPREAD * area * change[0].max(change[1]),
            moment: SPREAD * area * passed * moved,
            through: area * passed,
            silhouette,
            axis,
        }
    }

    /// The error of a patch. `openings`: of its beamlet. `narrow`: components that may hide.
    /// `known`: errors of its nodes; those that are not known are found.
    pub(super) fn judge(
        &self,
        patch: &Patch,
        openings: &[Opening],
        narrow: &[Narrow],
        known: &mut Vec<Option<CellError>>,
    ) -> PatchError {
        let steps = self.response.steps();
        known.resize(patch.nodes.len(), None);
        let error =
            |leaf: u32| *known[leaf as usize].get_or_insert_with(|| self.cell_error(patch, leaf));
        let errors: Vec<CellError> = patch.leaves().map(error).collect();
        let silhouette = errors.iter().any(|error| error.silhouette);
        // Share of each rectangle that each opening shows.
        let shares = |error: &CellError| {
            let node = &patch.nodes[error.node as usize];
            let width = node.width();
            let middle = patch.shear * (node.centre()[1] - 0.5);
            let slant = patch.shear * node.height();
            let heights: &[f32] =
                if slant.abs() > 0.1 * width { &[-1.0 / 3.0, 0.0, 1.0 / 3.0] } else { &[0.0] };
            openings.iter().filter_map(move |opening| {
                let at = |height: &f32| {
                    let x = node.x.map(|x| x + middle + slant * height);
                    (x[1].min(opening.x[1]) - x[0].max(opening.x[0])).max(0.0)
                };
                let share = heights.iter().map(at).sum::<f32>() / (heights.len() as f32 * width);
                (share > 0.0).then_some((opening.step, f64::from(share)))
            })
        };
        let mut light = vec![0.0_f64; steps];
        let mut moment = vec![0.0_f64; steps];
        let mut through = vec![0.0_f64; steps];
        for error in &errors {
            for (step, share) in shares(error) {
                light[step] += (share * f64::from(error.light)).powi(2);
                moment[step] += (share * f64::from(error.moment)).powi(2);
                through[step] += share * f64::from(error.through);
            }
        }
        let worst = light.iter().copied().fold(0.0, f64::max).sqrt();
        let mut result = PatchError { splits: Vec::new(), light: worst };
        let allowed = (SAFETY * self.budget.light).powi(2);
        let bounded = self.budget.displacement.is_finite() && !silhouette;
        // In shares of the budget, by step.
        let of_light =
            |step: usize, value: f64| value / allowed * f64::from(u8::from(light[step] > allowed));
        let of_moment = |step: usize, value: f64| {
            let allowed = (SAFETY * self.budget.displacement * through[step]).powi(2);
            if bounded && moment[step] > allowed { value / allowed } else { 0.0 }
        };
        let mut excess: Vec<f64> =
            (0..steps).map(|s| of_light(s, light[s]).max(of_moment(s, moment[s]))).collect();
        let mut scored: Vec<(f64, usize)> = Vec::new();
        for (number, error) in errors.iter().enumerate() {
            // Most rectangles err by next to nothing.
            let bound = f64::from(error.light).powi(2) / allowed;
            let may_move = bounded && error.moment > 0.0;
            if bound * (errors.len() as f64) < NEGLIGIBLE && !may_move && narrow.is_empty() {
                continue;
            }
            let score = shares(error).map(|(step, share)| {
                let square = |value: f32| (share * f64::from(value)).powi(2);
                of_light(step, square(error.light)).max(of_moment(step, square(error.moment)))
            });
            let score = score.fold(0.0, f64::max);
            let hides = self.may_hide(patch, error, narrow, shares(error).next().is_some());
            if let Some(axis) = hides {
                result.splits.push((error.node, axis));
            } else if score > 0.0 {
                scored.push((score, number));
            }
        }
        scored.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for (_, number) in scored {
            if excess.iter().all(|e| *e <= 1.0) {
                break;
            }
            let error = &errors[number];
            for (step, share) in shares(error) {
                let square = |value: f32| (share * f64::from(value)).powi(2);
                let part =
                    of_light(step, square(error.light)).max(of_moment(step, square(error.moment)));
                excess[step] -= (1.0 - 1.0 / 9.0) * part;
            }
            let other = if error.axis == Axis::X { Axis::Z } else { Axis::X };
            let possible = |axis: &Axis| patch.can_split(error.node, *axis, self.least);
            if let Some(axis) = [error.axis, other].into_iter().find(possible) {
                result.splits.push((error.node, axis));
            }
        }
        result
    }

    /// The axis along which a component may hide in a rectangle that some step sees.
    fn may_hide(
        &self,
        patch: &Patch,
        error: &CellError,
        narrow: &[Narrow],
        seen: bool,
    ) -> Option<Axis> {
        let node = &patch.nodes[error.node as usize];
        let worth = f64::from(SPREAD * error.through) > SAFETY * self.budget.light;
        if !seen || !worth {
            return None;
        }
        let slant = patch.shear.abs();
        let overlaps = |n: &&Narrow| {
            n.x[0] < node.x[1] + slant
                && n.x[1] > node.x[0] - slant
                && n.z[0] < node.z[1]
                && n.z[1] > node.z[0]
        };
        narrow.iter().filter(overlaps).find_map(|n| {
            let wide = node.width() > n.width && patch.can_split(error.node, Axis::X, self.least);
            let high = node.height() > n.height && patch.can_split(error.node, Axis::Z, self.least);
            if wide { Some(Axis::X) } else { high.then_some(Axis::Z) }
        })
    }
}
