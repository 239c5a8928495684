//! Light of a spectrum: cells of all energies gathered into few (docs/developers/numerics.md, "Cells of all energies").
//!
//! A photon passes each mask either through an aperture or through the bars. Light that took the same way
//! (a group, at most four) is gathered over the energies into one cell with its mean displacement; the
//! spread of the displacement over the energies is added to the blur. Cells for which that is not enough
//! go energy by energy.

mod bars;
mod cell;
mod edges;
mod exact;
mod integrals;
mod join;
mod node_result;
mod set_up;
mod sums;

use crate::sampling::{CellBatch, CellMoments, Lattice};
use crate::trace::Tracer;
use bars::{MaskTransmission, passing};
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_interface::{Cell, CellRow, MOMENTS_PER_MATERIAL};
use beamlet_model::optics::MaskShape;
use edges::SharedEdges;
use exact::Repeated;
use join::Joining;
use node_result::NodeResult;
use rayon::prelude::*;
use std::ops::Range;
use sums::{BandSums, Terms};

pub(crate) use bars::MaskTransmissionCache;

/// Groups with less light than this, of open beam, are left out, and nodes at the ends of the
/// spectrum with less in a group.
const NEGLIGIBLE: f64 = 1e-9;
/// The displacement may spread over this share of the blur at a tolerance of 1e-3: the third moment that is left out
/// then moves 2e-4 of the light at an edge. It goes with the third power of the spread.
const SPREAD_SHARE: f64 = 0.15;
/// The displacement along z may spread over this share of a row in any case: light of a line reaches over more.
const SPREAD_OF_ROW: f64 = 0.02;
/// Part of the tolerance of displacements that gathering energies may take.
const DISPLACEMENT_SHARE: f64 = 1.0 / 6.0;
/// Bend of the logarithm of light over a whole beamlet that parts energies.
const DEPTH_TOLERANCE: f64 = 2e-5;
/// A cell of this share of the period may deviate by the tolerances; narrower ones by more, in
/// proportion, since they carry less light.
const FULL_SHARE: f64 = 1.0 / 40.0;
/// Cell rows gathered one after the other by a thread.
const STRIPS_AT_ONCE: usize = 1 << 6;

/// Inputs of the gathering from a scene.
#[derive(Debug, Clone)]
pub(crate) struct EnergyBinning {
    weights: Vec<f64>,
    /// `[node][material]`, behind the nodes the mean constants.
    mu: Vec<f64>,
    delta: Vec<f64>,
    /// Materials that do anything to light.
    acting: Vec<usize>,
    /// How much more strongly the sample refracts than at the mean constants, by node.
    delta_ratio: Vec<f64>,
    /// Share of the grazing incidence below which exact transport is repeated in a cell of [`FULL_SHARE`], by node.
    exact_retrace_threshold: Vec<f64>,
    materials: usize,
    words: usize, // of a ray's moments
    /// Pairs of materials whose delta differs, where surfaces are rough, and the word of the variance between them in
    /// the moments of a ray.
    pairs: Vec<([usize; 2], usize)>,
    /// Variance of angles per length, `[node][material]`, and the words of the moments of it by material.
    scattering: Vec<f64>,
    scattering_words: Range<usize>,
    /// Masks by node: the sample mask, the detector mask.
    masks: [Option<Vec<MaskShape>>; 2],
    edges: SharedEdges,
    /// Which masks the light of each group leaks through.
    groups: Vec<[bool; 2]>,
    lattice: Lattice,
    /// dx/dy of the centre ray of each beamlet.
    slopes: Vec<f64>,
    /// Tolerance of displacements on the analyser, m.
    tolerance: f64,
    /// Standard deviation of the displacement over the energies of a cell, at most, m: along x on the analyser, along z
    /// on the detector.
    spread: [f64; 2],
    gap: f64,
    ratio: f64,
    row_pitch: f64,
    row_slope: f64,
    middle_row: f64,
}

/// Moments of a ray in a material.
fn of_material(moments: &[f32], material: usize) -> [f64; MOMENTS_PER_MATERIAL] {
    let first = material * MOMENTS_PER_MATERIAL;
    std::array::from_fn(|i| moments[first + i].into())
}

/// Buffers of gathering, kept from cell row to cell row.
#[derive(Default)]
struct Scratch {
    /// First-order results at either end of a cell, by node, and the light there.
    first_order: [Vec<(NodeResult, f64)>; 2],
    /// Results at both ends, by node.
    results: Vec<[NodeResult; 2]>,
    /// Light there.
    light: Vec<[f64; 2]>,
    /// Variance of the displacement by rough surfaces and by materials, by node.
    variances: Vec<f64>,
    /// Light of a cell, by node.
    terms: Vec<Terms>,
    waiting: Vec<Range<usize>>,
    /// Light of the groups that is joined.
    joining: Vec<Joining>,
    lists: Vec<Vec<Cell>>,
}

impl EnergyBinning {
    fn nodes(&self) -> usize {
        self.weights.len()
    }

    /// Share of the light of a node along the axis that takes a way through the masks.
    fn passes(&self, node: usize, group: [bool; 2]) -> f64 {
        passing([0, 1].map(|i| self.masks[i].as_ref().map(|mask| mask[node].leak(1.0))), group)
    }

    /// Cells of cell rows with moments, as light: one list per group, then one per node.
    /// `tracer`: repeats exact transport at each node; `None` for cells without a sample. `known`: findings about the
    /// cell rows before.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(crate) fn lists(
        &self,
        tracer: Option<&Tracer>,
        known: &mut MaskTransmissionCache,
        cell_rows: &CellBatch,
    ) -> Result<Vec<CellBatch>> {
        let repeated = tracer.map(|it| self.repeat(it, cell_rows)).transpose()?.unwrap_or_default();
        known.look_at(self, cell_rows);
        let gathered: Vec<Vec<CellBatch>> = cell_rows
            .cell_rows
            .par_chunks(STRIPS_AT_ONCE)
            .map_init(Scratch::default, |scratch, some| {
                let mut lists = vec![CellBatch::default(); self.groups.len() + self.nodes()];
                for cell_row in some {
                    self.bin_energies(
                        cell_rows,
                        cell_row,
                        &repeated,
                        known.at(self, cell_row),
                        scratch,
                    );
                    for (list, cells) in lists.iter_mut().zip(&scratch.lists) {
                        list.push(*cell_row, cells, &CellMoments::default());
                    }
                }
                lists
            })
            .collect();
        let mut parts = vec![Vec::with_capacity(gathered.len()); self.groups.len() + self.nodes()];
        for some in gathered {
            parts.iter_mut().zip(some).for_each(|(list, part)| list.push(part));
        }
        let list = |parts| {
            let mut list = CellBatch::concat(parts);
            list.balance();
            list
        };
        Ok(parts.into_par_iter().map(list).collect())
    }

    /// Cells of a cell row for every list, in the scratch.
    fn bin_energies(
        &self,
        cell_rows: &CellBatch,
        cell_row: &CellRow,
        repeated: &Repeated,
        bars: &MaskTransmission,
        scratch: &mut Scratch,
    ) {
        let groups = self.groups.len();
        scratch.lists.resize_with(groups + self.nodes(), Vec::new);
        scratch.lists.iter_mut().for_each(Vec::clear);
        scratch.joining.resize_with(groups, Joining::default);
        let words = 2 * self.words;
        let first = cell_row.first_cell as usize;
        let exact = &cell_rows.moments.exact;
        let mut at = exact.partition_point(|e| (e.cell as usize) < first);
        let mut before: &[f32] = &[];
        for index in first..first + cell_row.cell_count as usize {
            let cell = &cell_rows.cells[index];
            let ends = &cell_rows.moments.ends[index * words..(index + 1) * words];
            let [low, high] = [&ends[..words / 2], &ends[words / 2..]];
            self.variances([low, high], &mut scratch.variances);
            // Neighbours share a ray.
            if low == before {
                scratch.first_order.swap(0, 1);
            } else {
                self.results(low, &mut scratch.first_order[0]);
            }
            self.results(high, &mut scratch.first_order[1]);
            before = high;
            let [low_results, high_results] = &scratch.first_order;
            scratch.results.clear();
            scratch.light.clear();
            for (low, high) in low_results.iter().zip(high_results) {
                scratch.results.push([low.0, high.0]);
                scratch.light.push([low.1, high.1]);
            }
            if exact.get(at).is_some_and(|e| e.cell as usize == index) {
                self.correct(&exact[at], [low, high], &mut scratch.results);
                repeated.replace(self, at, &mut scratch.results);
                at += 1;
                for (light, results) in scratch.light.iter_mut().zip(&scratch.results) {
                    *light = results.map(|result| result.light());
                }
            }
            if bars.apart {
                self.push_nodes(cell_row, cell, scratch);
            } else {
                self.push_groups(cell_row, cell, bars, scratch);
            }
        }
        for group in 0..groups {
            self.push_joined(cell_row, group, scratch);
        }
    }

    /// Variance of the displacement by node: by rough surfaces, where that of each pair of materials grows with the step,
    /// and by materials that scatter.
    fn variances(&self, ends: [&[f32]; 2], variance: &mut Vec<f64>) {
        variance.clear();
        variance.resize(self.nodes(), 0.0);
        for &([a, b], word) in &self.pairs {
            let [low, high] = ends.map(|end| f64::from(end[word]));
            let of_pair = 0.5 * (low + high);
            for (variance, delta) in variance.iter_mut().zip(self.delta.chunks(self.materials)) {
                *variance += of_pair * (delta[a] - delta[b]).powi(2);
            }
        }
        for (material, word) in self.scattering_words.clone().enumerate() {
            let [low, high] = ends.map(|end| f64::from(end[word]));
            let moment = 0.5 * (low + high);
            for (variance, scattering) in
                variance.iter_mut().zip(self.scattering.chunks(self.materials))
            {
                *variance += moment * scattering[material];
            }
        }
        if !self.scattering_words.is_empty() {
            // Rounded.
            variance.iter_mut().for_each(|it| *it = it.max(0.0));
        }
    }

    /// A cell for each node.
    fn push_nodes(&self, cell_row: &CellRow, cell: &Cell, scratch: &mut Scratch) {
        let results = scratch.results.iter().zip(&self.delta_ratio).zip(&scratch.variances);
        let lists = &mut scratch.lists[self.groups.len()..];
        for (((results, delta_ratio), variance), list) in results.zip(lists) {
            let displacement_variance =
                cell.displacement_variance * single(delta_ratio * delta_ratio) + single(*variance);
            let x = [cell.x_low, cell.x_high];
            let made = Cell { displacement_variance, ..self.cell(cell_row, x, *results) };
            let depth = || 0.5 * (results[0].depth + results[1].depth);
            list.push(self.along_z(cell, made, || [*delta_ratio, depth()]));
        }
    }

    /// First-order results at all nodes, and the light.
    fn results(&self, moments: &[f32], results: &mut Vec<(NodeResult, f64)>) {
        results.clear();
        results.resize(self.nodes(), (NodeResult::default(), 1.0));
        for &material in &self.acting {
            let m = of_material(moments, material);
            // Few of the materials are on the way of a ray.
            if m.iter().any(|m| *m != 0.0) {
                for (node, (result, _)) in results.iter_mut().enumerate() {
                    self.add_result(node * self.materials + material, &m, result);
                }
            }
        }
        results.iter_mut().for_each(|(result, light)| *light = result.light());
    }

    /// Adds the results of the moments in a material (behind the nodes before).
    fn add_result(
        &self,
        constants: usize,
        m: &[f64; MOMENTS_PER_MATERIAL],
        result: &mut NodeResult,
    ) {
        let (mu, delta) = (self.mu[constants], self.delta[constants]);
        result.depth += mu * m[0];
        result.x += delta * m[1];
        result.z += delta * (m[2] + m[4] * self.gap);
        result.slope_x += delta * m[3];
    }

    /// Ends the cell that light of a group is joined to.
    fn push_joined(&self, cell_row: &CellRow, group: usize, scratch: &mut Scratch) {
        if let Some((x, sums)) = scratch.joining[group].take() {
            scratch.lists[group].push(self.of_band(cell_row, x, &sums));
        }
    }

    /// First-order result at a node.
    fn result(&self, node: usize, moments: &[f32]) -> NodeResult {
        let mut result = NodeResult::default();
        for &material in &self.acting {
            let m = of_material(moments, material);
            self.add_result(node * self.materials + material, &m, &mut result);
        }
        result
    }

    /// Light of a cell by group: one cell, or the number that keeps the energies in each close enough.
    fn push_groups(
        &self,
        cell_row: &CellRow,
        cell: &Cell,
        bars: &MaskTransmission,
        scratch: &mut Scratch,
    ) {
        let x = [cell.x_low, cell.x_high];
        let nodes = self.nodes();
        scratch.terms.clear();
        let ends = scratch.results.iter().zip(&scratch.light);
        scratch.terms.extend(ends.enumerate().map(|(node, (results, light))| {
            let spread = f64::from(cell.displacement_variance)
                * self.delta_ratio[node]
                * self.delta_ratio[node]
                + scratch.variances[node];
            Terms::new(results, *light, spread, bars.narrowings[node])
        }));
        let of_node = bars.by_node.iter().zip(&scratch.terms);
        let all: f64 = of_node.map(|(share, term)| share * term.light()).sum();
        let scale = self.tolerance_scale(x);
        // The effect of the third moment grows with the light of the cell.
        let [spread_x, spread_z] = self.spread.map(|spread| spread * libm::cbrt(scale));
        for group in 0..self.groups.len() {
            let shares = &bars.shares[group * nodes..][..nodes];
            let all_nodes = &bars.nodes[group];
            let mut next = Some(all_nodes.clone());
            while let Some(band) = next.take().or_else(|| scratch.waiting.pop()) {
                let sums = BandSums::over(band.clone(), shares, &scratch.terms);
                let light = sums.light();
                if !light.iter().all(|light| *light > 0.0) {
                    continue;
                }
                let part = light[1] / all;
                let is_resolved = part * sums.depth_curvature() <= DEPTH_TOLERANCE * scale
                    && part * sums.drift() <= self.tolerance * scale;
                if let (true, Some(limits)) =
                    (is_resolved && band == *all_nodes, &bars.joined[group])
                {
                    if !scratch.joining[group].takes(x, &sums, limits) {
                        self.push_joined(cell_row, group, scratch);
                        scratch.joining[group].takes(x, &sums, limits);
                    }
                    continue;
                }
                // Cells of a cell row are sorted: the joined cells lie before this one.
                self.push_joined(cell_row, group, scratch);
                let is_narrow = part * sums.displacement_variance() <= spread_x * spread_x
                    && part * sums.variance_z() <= spread_z * spread_z;
                if (is_resolved && is_narrow) || band.len() == 1 {
                    let node = |n: usize| {
                        let depth =
                            0.5 * (scratch.results[n][0].depth + scratch.results[n][1].depth);
                        (n, shares[n] * scratch.terms[n].light(), depth)
                    };
                    let made = self.of_band(cell_row, x, &sums);
                    let made = self.along_z(cell, made, || self.means_of(band.map(node)));
                    scratch.lists[group].push(made);
                    continue;
                }
                let mut below = 0.0;
                let half = band.clone().find(|&n| {
                    below += shares[n] * scratch.terms[n].light();
                    below >= 0.5 * light[1]
                });
                let cut = half.unwrap_or(band.start).clamp(band.start + 1, band.end - 1);
                scratch.waiting.extend([cut..band.end, band.start..cut]);
            }
        }
    }
}
