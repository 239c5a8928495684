//! Exact transport under a spectrum: computed once, repeated at the energies that it does not determine.

use super::EnergyBinning;
use super::node_result::NodeResult;
use crate::sampling::{CellBatch, ExactCell};
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_interface::{FLAG_NOT_FINITE, Ray, RayResult};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::Transport;
use rayon::prelude::*;

/// Share of the grazing incidence at which the third order turns light by `FIRST_ORDER_ERROR`, as the second order does
/// at grazing incidence.
const SEVERE: f64 = 0.2154;
/// Optical depth of rays that could not be followed.
const DARK: f64 = 1e4;

/// Exact transport repeated at some nodes.
#[derive(Debug, Default)]
pub(super) struct Repeated {
    /// Which of the exact cells, ascending.
    cells: Vec<u32>,
    nodes: Vec<AtNode>,
}

/// Exact transport at a node.
#[derive(Debug, Default)]
struct AtNode {
    results: Vec<RayResult>,
    /// For each of the cells above the place of its result, where it was repeated here.
    places: Vec<Option<usize>>,
}

impl AtNode {
    fn at(&self, cell: usize) -> Option<&RayResult> {
        Some(&self.results[self.places[cell]?])
    }
}

impl Repeated {
    /// Puts the results of an exact cell in the place of those at the nodes where it was repeated.
    pub(super) fn replace(
        &self,
        binning: &EnergyBinning,
        cell: usize,
        results: &mut [[NodeResult; 2]],
    ) {
        let Ok(cell) = self.cells.binary_search_by_key(&cell, |cell| *cell as usize) else {
            return;
        };
        for (node, results) in self.nodes.iter().zip(results) {
            if let Some(result) = node.at(cell) {
                *results = binning.exact_result(result).with_change_of(results);
            }
        }
    }
}

impl EnergyBinning {
    /// Repeats exact transport at the nodes where it does not follow from that at the mean constants.
    pub(super) fn repeat(&self, tracer: &Tracer, cell_rows: &CellBatch) -> Result<Repeated> {
        let exact = &cell_rows.moments.exact;
        let asks = |(index, cell): (usize, &ExactCell)| {
            let it = &cell_rows.cells[cell.cell as usize];
            // The third order goes with the fifth power of the incidence.
            let scale = self.tolerance_scale([it.x_low, it.x_high]);
            let grazing = cell.grazing() * libm::pow(scale, 0.2);
            let nodes: Vec<bool> =
                self.exact_retrace_threshold.iter().map(|least| grazing < *least).collect();
            nodes.contains(&true).then_some((numbers::count(index), nodes))
        };
        let (cells, asked): (Vec<u32>, Vec<Vec<bool>>) =
            exact.par_iter().enumerate().filter_map(asks).unzip();
        let at_node = |node: usize| {
            let mut rays: Vec<Ray> = Vec::new();
            let place = |(cell, nodes): (&u32, &Vec<bool>)| {
                nodes[node].then(|| {
                    rays.push(exact[*cell as usize].ray);
                    rays.len() - 1
                })
            };
            let places = cells.iter().zip(&asked).map(place).collect();
            (rays, places)
        };
        let (rays, places): (Vec<Vec<Ray>>, Vec<Vec<Option<usize>>>) =
            (0..self.nodes()).into_par_iter().map(at_node).unzip();
        let results = tracer.walk_at_nodes(&rays)?;
        let nodes =
            results.into_iter().zip(places).map(|(results, places)| AtNode { results, places });
        Ok(Repeated { cells, nodes: nodes.collect() })
    }

    /// Adds to the results of the nodes what exact transport found beyond the first order: that is
    /// of second order, so it grows with the square of delta.
    pub(super) fn correct(
        &self,
        exact: &ExactCell,
        moments: [&[f32]; 2],
        results: &mut [[NodeResult; 2]],
    ) {
        let reference = self.nodes();
        for end in 0..2 {
            let exact_result = self.exact_result(&exact.results[end]);
            let first = self.result(reference, moments[end]);
            for (node, results) in results.iter_mut().enumerate() {
                let delta_ratio = self.delta_ratio[node];
                let result = &mut results[end];
                // A path that changes by refraction: linear in delta, and in mu.
                if first.depth > 0.0 {
                    result.depth += (exact_result.depth - first.depth) * delta_ratio * result.depth
                        / first.depth;
                }
                if exact.is_drawn() {
                    // Drawn normals bend in proportion.
                    result.x = exact_result.x * delta_ratio;
                    result.z = exact_result.z * delta_ratio;
                    result.slope_x = exact_result.slope_x * delta_ratio;
                } else {
                    result.x += (exact_result.x - first.x) * delta_ratio * delta_ratio;
                }
            }
        }
    }

    /// Result of a ray that was traced exactly.
    fn exact_result(&self, result: &RayResult) -> NodeResult {
        if result.flags & FLAG_NOT_FINITE != 0 {
            return NodeResult { depth: DARK, ..NodeResult::default() };
        }
        NodeResult {
            depth: result.optical_depth.into(),
            x: result.displacement_x.into(),
            z: f64::from(result.displacement_z) + f64::from(result.slope_z) * self.gap,
            slope_x: result.slope_x.into(),
        }
    }
}

/// Share of the grazing incidence that rays were flagged by, below which exact transport at the reference constants
/// does not determine that at a node, in a cell of `FULL_SHARE`: there the third order displaces light by more
/// than `spare`, over what `FIRST_ORDER_ERROR` displaces it by.
pub(super) fn exact_retrace_threshold(
    transport: Transport,
    media: &MaterialTable,
    reference: &[Constants],
    spare: f64,
) -> Vec<f64> {
    if transport == Transport::Exact {
        // A node that was traced is known: another walk of it finds the same.
        let walks = |node: &Vec<Constants>| if node == reference { 0.0 } else { f64::INFINITY };
        return media.constants.iter().map(walks).collect();
    }
    let strongest = |node: &[Constants]| node.iter().fold(0.0_f64, |m, c| m.max(c.delta.abs()));
    let (exact_result, flagged) = (strongest(reference), media.strongest());
    let nodes = media.weights.len() as f64;
    // The third order is delta^3 / c^5, and counts by the light of the node, over the mean light of one.
    let share = |(node, weight): (&Vec<Constants>, &f64)| {
        if flagged <= 0.0 || node == reference {
            return 0.0;
        }
        let delta_ratio = strongest(node).max(exact_result) / flagged;
        SEVERE * libm::pow(nodes * weight * delta_ratio.powi(3) / spare, 0.2)
    };
    media.constants.iter().zip(&media.weights).map(share).collect()
}
