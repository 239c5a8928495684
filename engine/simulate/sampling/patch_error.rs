//! Error of a patch: the errors of its rectangles at every mask step, and which of them to split.

use super::error_budget::safety;
use super::error_estimate::{CellError, Estimator, SPREAD};
use super::patch::{Axis, Even, Node, Patch};
use super::response::Opening;
use super::step_errors::{StepError, StepSums};
use super::step_shares::{StepRun, is_open, step_runs};
use super::unresolved::FIRST;
use beamlet_core::numbers::{self, single};

/// Rectangles that would hold this part of the budget at every mask step, were all like them, are
/// not split.
const NEGLIGIBLE: f64 = 0.01;
/// Fraction of the budget that refinement aims at for angles determined by rays: facets about as wide as the distance of rays hide between
/// them. With 0.45 prisms and fine balls err by 0.46 of 3 nrad, with 0.23 by 0.34
/// (`angles_hold_in_interior_pixels_beside_silhouettes_too`).
const SAFETY_OF_RAYS: f64 = 0.2;
/// Part of its square that the error of a rectangle keeps when it is split.
const LEFT: f64 = 1.0 / 9.0;

/// Error of a patch, and where to split it.
#[derive(Debug, Default)]
pub(super) struct PatchError {
    /// Leaves to split, with the axis.
    pub(super) splits: Vec<(u32, Axis)>,
    /// Number of evenly spread rays that the patch needs, if its rays do not resolve its content.
    pub(super) even: Option<(u32, Even)>,
    /// Estimated error of the recorded value that has the largest, share of open beam.
    pub(crate) light: f64,
    /// Estimated error of the displacement at the mask step that has the largest, share of the budget; 0
    /// where nothing bounds it.
    pub(crate) displacement: f64,
}

/// Rectangles of a patch that must be split whatever their neighbours say: a component may hide
/// in wider or higher ones.
#[derive(Debug, Clone, Copy)]
pub(super) struct NarrowComponent {
    pub(super) x: [f32; 2],
    pub(super) z: [f32; 2],
    pub(super) width: f32,
    pub(super) height: f32,
    /// Light that it may take at most, share of open beam.
    pub(crate) light: f64,
}

/// Known errors of the rectangles of a patch, by node.
#[derive(Debug, Default)]
pub(super) struct KnownErrors {
    errors: Vec<Option<CellError>>,
    /// Places of their runs in `runs`.
    seen: Vec<Option<[u32; 2]>>,
    /// Mask steps that light a rectangle.
    runs: Vec<StepRun>,
}

impl KnownErrors {
    /// Bytes of a node, about: few runs of steps see it.
    pub(super) const NODE: usize =
        size_of::<Option<CellError>>() + size_of::<Option<[u32; 2]>>() + 2 * size_of::<StepRun>();

    /// Forgets the error of a node: a neighbour has changed.
    pub(super) fn forget(&mut self, node: u32) {
        if let Some(error) = self.errors.get_mut(node as usize) {
            *error = None;
        }
    }

    /// The error of a leaf, and the steps that light it.
    fn of(&self, node: u32) -> Option<(&CellError, &[StepRun])> {
        let [first, end] = self.seen[node as usize]?;
        Some((self.errors[node as usize].as_ref()?, &self.runs[first as usize..end as usize]))
    }

    /// Leaves of a patch whose errors are known, with the steps that light them.
    fn leaves<'k>(
        &'k self,
        patch: &'k Patch,
    ) -> impl Iterator<Item = (&'k CellError, &'k Node, &'k [StepRun])> {
        patch.leaves().filter_map(|leaf| {
            let (error, runs) = self.of(leaf)?;
            Some((error, &patch.nodes[leaf as usize], runs))
        })
    }

    /// Bytes that it holds.
    pub(super) fn bytes(&self) -> usize {
        self.errors.capacity() * size_of::<Option<CellError>>()
            + self.seen.capacity() * size_of::<Option<[u32; 2]>>()
            + self.runs.capacity() * size_of::<StepRun>()
    }
}

/// Rays that draw their normals at rough surfaces are independent samples: whether neighbours agree is
/// chance. All of a patch share the variance of their light, so that none stands for a wide
/// rectangle because its neighbours happened to do as it did. `least`: what n draws that agree leave
/// open, a share of 1 / (n + 2).
fn pool_draws(errors: &mut [Option<CellError>], patch: &Patch) {
    let drawn = |leaf: u32| errors[leaf as usize].as_ref().and_then(|error| error.draws);
    let (mut squares, mut area, mut count) = (0.0, 0.0, 0_u32);
    for draws in patch.leaves().filter_map(drawn) {
        count += 1;
        if let Some(variance) = draws.variance {
            squares += f64::from(draws.area) * f64::from(variance);
            area += f64::from(draws.area);
        }
    }
    if count == 0 {
        return;
    }
    let seen = if area > 0.0 { single(squares / area) } else { 0.0 };
    let least = 0.25 / (count + 2) as f32;
    for leaf in patch.leaves() {
        let Some(error) = &mut errors[leaf as usize] else { continue };
        let Some(draws) = error.draws else { continue };
        let passed = error.through / draws.area.max(f32::MIN_POSITIVE);
        let variance = seen.max(least * passed * passed);
        error.light = draws.others.hypot(draws.area * variance.sqrt());
    }
}

/// A rectangle with the share of a budget that its split may win.
struct Scored<'k> {
    score: f64,
    error: &'k CellError,
    runs: &'k [StepRun],
}

impl Estimator<'_> {
    fn safety(&self) -> f64 {
        safety(self.response.steps())
    }

    /// Computes the missing errors of the leaves of a patch. `openings`: of its beamlet.
    fn complete(&self, patch: &Patch, openings: &[Opening], known_errors: &mut KnownErrors) {
        known_errors.errors.resize(patch.nodes.len(), None);
        known_errors.seen.resize(patch.nodes.len(), None);
        for leaf in patch.leaves() {
            let index = leaf as usize;
            if known_errors.errors[index].is_none() {
                known_errors.errors[index] = Some(self.cell_error(patch, leaf));
            }
            if known_errors.seen[index].is_none() {
                let first = known_errors.runs.len();
                step_runs(patch, leaf, openings, self.response.leaking(), &mut known_errors.runs);
                let range = [first, known_errors.runs.len()];
                known_errors.seen[index] = Some(range.map(|n| numbers::count(n)));
            }
        }
        pool_draws(&mut known_errors.errors, patch);
    }

    /// The error of a patch. `openings`: of its beamlet. `narrow`: components that may hide between rays.
    /// `known_errors`: known errors of its
    /// nodes; the others are computed.
    pub(super) fn patch_error(
        &self,
        patch: &Patch,
        openings: &[Opening],
        narrow: &[NarrowComponent],
        known_errors: &mut KnownErrors,
    ) -> PatchError {
        if patch.even.is_some() {
            return self.unresolved_error(patch, openings, narrow);
        }
        self.complete(patch, openings, known_errors);
        let known_errors = &*known_errors;
        let sums = self.step_sums(patch, known_errors);
        let mut result = PatchError {
            light: sums.steps.iter().map(|step| step.light).fold(0.0, f64::max).sqrt(),
            displacement: sums.displacement_share(self.budget.displacement),
            ..PatchError::default()
        };
        let excesses: Vec<f64> =
            (0..).zip(&sums.steps).map(|(step, all)| sums.excess(step, all)).collect();
        let exceeded = excesses.iter().any(|excess| *excess > 1.0);
        if !exceeded && narrow.is_empty() {
            return result;
        }
        if 2 * sums.silhouettes > sums.count && self.is_unresolved(patch) {
            result.even = Some((FIRST, Even::Trial));
            return result;
        }
        let scored = self.scored(patch, narrow, known_errors, &sums, &mut result.splits);
        self.split_worst(patch, &sums, scored, excesses, &mut result.splits);
        result
    }

    /// Sums of the errors of the rectangles of a patch.
    fn step_sums(&self, patch: &Patch, known_errors: &KnownErrors) -> StepSums {
        let mut steps = vec![StepError::default(); self.response.steps()];
        let (mut count, mut silhouettes) = (0_u32, 0_u32);
        let mut seen = false;
        for (error, _, runs) in known_errors.leaves(patch) {
            count += 1;
            seen |= error.silhouette && is_open(runs);
            silhouettes += u32::from(error.silhouette);
            for (step, share) in runs.iter().flat_map(StepRun::steps) {
                steps[step as usize].add(&StepError::of(self.response, error, share));
            }
        }
        StepSums {
            steps,
            count,
            silhouettes,
            light: (self.safety() * self.budget.light).powi(2),
            displacement: SAFETY_OF_RAYS * self.budget.displacement,
            bounded: self.budget.displacement.is_finite() && !seen,
        }
    }

    /// Rectangles whose split lowers an error that exceeds its budget, the best first. Rectangles in which a
    /// component may hide go to `splits`.
    fn scored<'k>(
        &self,
        patch: &'k Patch,
        narrow: &[NarrowComponent],
        known_errors: &'k KnownErrors,
        sums: &StepSums,
        splits: &mut Vec<(u32, Axis)>,
    ) -> Vec<Scored<'k>> {
        let StepSums { count, light, bounded, .. } = sums;
        let alike = !self.other_energies;
        let mut scored = Vec::new();
        for (error, _, runs) in known_errors.leaves(patch) {
            let may_move = *bounded && error.moment > 0.0;
            let part = |(_, share): (u32, f32)| StepError::of(self.response, error, share).light;
            let most = if alike {
                runs.iter().flat_map(StepRun::steps).map(part).fold(0.0, f64::max)
            } else {
                f64::from(error.light).powi(2)
            };
            // Narrow rectangles along a rim err alike where rays alone know them, each by too little
            // to be split: the bound is one on their sum.
            let all_alike = alike && self.is_exact && error.draws.is_none();
            let others = f64::from(*count) * if all_alike { f64::from(*count) } else { 1.0 };
            let negligible = most / light * others < NEGLIGIBLE;
            if negligible && !may_move && narrow.is_empty() {
                continue;
            }
            if let Some(axis) = self.may_hide(patch, error, narrow, is_open(runs)) {
                splits.push((error.node, axis));
                continue;
            }
            if negligible && !may_move {
                continue;
            }
            let of = |(step, share)| sums.excess(step, &StepError::of(self.response, error, share));
            let score = runs.iter().flat_map(StepRun::steps).map(of).fold(0.0, f64::max);
            if score > 0.0 {
                scored.push(Scored { score, error, runs });
            }
        }
        scored.sort_unstable_by(|a, b| {
            b.score.total_cmp(&a.score).then(a.error.node.cmp(&b.error.node))
        });
        scored
    }

    /// Splits rectangles in their order until no step exceeds its budget. `excesses`: of the steps.
    fn split_worst(
        &self,
        patch: &Patch,
        sums: &StepSums,
        scored: Vec<Scored<'_>>,
        mut excesses: Vec<f64>,
        splits: &mut Vec<(u32, Axis)>,
    ) {
        for Scored { error, runs, .. } in scored {
            if excesses.iter().all(|excess| *excess <= 1.0) {
                break;
            }
            for (step, share) in runs.iter().flat_map(StepRun::steps) {
                let own = sums.excess(step, &StepError::of(self.response, error, share));
                excesses[step as usize] -= (1.0 - LEFT) * own;
            }
            let other = if error.axis == Axis::X { Axis::Z } else { Axis::X };
            let possible = |axis: &Axis| patch.can_split(error.node, *axis, self.least);
            if let Some(axis) = [error.axis, other].into_iter().find(possible) {
                splits.push((error.node, axis));
            }
        }
    }

    /// The axis along which a component may hide in a rectangle. `open`: to some step.
    fn may_hide(
        &self,
        patch: &Patch,
        error: &CellError,
        narrow: &[NarrowComponent],
        open: bool,
    ) -> Option<Axis> {
        let node = &patch.nodes[error.node as usize];
        let lit = self.response.lit(if open { error.height } else { 0.0 });
        let worth = f64::from(SPREAD * lit * error.through) > self.safety() * self.budget.light;
        if !worth {
            return None;
        }
        let slant = patch.shear.abs();
        let overlaps = |n: &&NarrowComponent| {
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
