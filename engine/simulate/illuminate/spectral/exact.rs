//! Exact transport under a spectrum: computed once, repeated at the energies that it does not determine.

use super::EnergyBinning;
use super::node_result::NodeResult;
use crate::sampling::{CellBatch, ExactCell};
use crate::trace::Tracer;
use beamlet_core::{Result, numbers};
use beamlet_interface::{Cell, CellRow, FLAG_NOT_FINITE, Ray, RayResult};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::Transport;
use rayon::prelude::*;

/// Share of the grazing incidence below which the first order leaves 1e-9 rad, where the second order
/// leaves as much: beyond it the error grows by delta^2 / c^3.
const SEVERE: f64 = 0.2154;

/// Exact transport repeated at some nodes.
#[derive(Debug, Default)]
pub(super) struct Repeated {
    /// Which of the exact cells, ascending.
    cells: Vec<u32>,
    nodes: Vec<AtNode>,
}

/// Places of the results of two ends.
type Places = Vec<Option<[usize; 2]>>;

/// Exact transport at a node.
#[derive(Debug, Default)]
struct AtNode {
    results: Vec<RayResult>,
    /// For each of the cells above the results of its two ends, where they were repeated here.
    places: Places,
}

impl AtNode {
    fn at(&self, cell: usize) -> Option<[&RayResult; 2]> {
        Some(self.places[cell]?.map(|place| &self.results[place]))
    }
}

impl Repeated {
    /// Results at the ends of an exact cell, by node, where it was repeated at some.
    pub(super) fn of(&self, cell: usize) -> Option<impl Iterator<Item = Option<[&RayResult; 2]>>> {
        let at = self.cells.binary_search_by_key(&cell, |cell| *cell as usize).ok()?;
        Some(self.nodes.iter().map(move |node| node.at(at)))
    }
}

impl EnergyBinning {
    /// Repeats exact transport at the nodes where it does not follow from that at the mean constants.
    pub(super) fn repeat(&self, tracer: &mut Tracer, cell_rows: &CellBatch) -> Result<Repeated> {
        let exact = &cell_rows.moments.exact;
        let asks = |(index, cell): (usize, &ExactCell)| {
            let grazing = cell.grazing();
            let nodes: Vec<bool> =
                self.exact_retrace_threshold.iter().map(|least| grazing < *least).collect();
            nodes.contains(&true).then_some((numbers::count(index), nodes))
        };
        let (cells, asked): (Vec<u32>, Vec<Vec<bool>>) =
            exact.par_iter().enumerate().filter_map(asks).unzip();
        let at_node = |node: usize| {
            let mut rays: Vec<Ray> = Vec::new();
            let mut place = |ray: Ray| {
                // Neighbours share a ray.
                let last = rays.len().saturating_sub(2);
                if let Some(at) = rays[last..].iter().position(|r| *r == ray) {
                    return last + at;
                }
                rays.push(ray);
                rays.len() - 1
            };
            let ends = |(cell, nodes): (&u32, &Vec<bool>)| {
                nodes[node].then(|| exact[*cell as usize].ends.map(&mut place))
            };
            let places = cells.iter().zip(&asked).map(ends).collect();
            (rays, places)
        };
        let (rays, places): (Vec<Vec<Ray>>, Vec<Places>) =
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
            let exact_result = self.exact_result(exact.results.each_ref(), exact.range[end]);
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

    /// Result between the ends that were traced exactly.
    fn exact_result(&self, ends: [&RayResult; 2], at: f32) -> NodeResult {
        let [a, b] = ends.map(|result| NodeResult {
            depth: result.optical_depth.into(),
            x: result.displacement_x.into(),
            z: f64::from(result.displacement_z) + f64::from(result.slope_z) * self.gap,
            slope_x: result.slope_x.into(),
        });
        let mix = |f: fn(&NodeResult) -> f64| f(&a) + (f(&b) - f(&a)) * f64::from(at);
        NodeResult {
            depth: mix(|l| l.depth),
            x: mix(|l| l.x),
            z: mix(|l| l.z),
            slope_x: mix(|l| l.slope_x),
        }
    }

    /// The cell of a repeated walk at one node. If its ends crossed other surfaces the result is constant
    /// on either side.
    pub(super) fn push_exact(
        &self,
        list: &mut Vec<Cell>,
        cell_row: &CellRow,
        cell: &Cell,
        ends: [&RayResult; 2],
        range: [f32; 2],
    ) {
        if ends.iter().any(|result| result.flags & FLAG_NOT_FINITE != 0) {
            return;
        }
        if ends[0].signature == ends[1].signature {
            let results = range.map(|at| self.exact_result(ends, at));
            list.push(self.cell(cell_row, [cell.x_low, cell.x_high], results));
            return;
        }
        let width = cell.x_high - cell.x_low;
        let share = ((0.5 - range[0]) / (range[1] - range[0])).clamp(0.0, 1.0);
        let middle = cell.x_low + share * width;
        for (x, at) in [([cell.x_low, middle], 0.0), ([middle, cell.x_high], 1.0)] {
            if x[1] > x[0] {
                let result = self.exact_result(ends, at);
                list.push(self.cell(cell_row, x, [result, result]));
            }
        }
    }
}

/// Share of the grazing incidence that rays were flagged by, below which exact transport at the
/// reference constants does not determine that at a node.
pub(super) fn exact_retrace_threshold(
    transport: Transport,
    media: &MaterialTable,
    reference: &[Constants],
) -> Vec<f64> {
    if transport == Transport::Exact {
        // A node that was traced is known: another walk of it finds the same.
        let walks = |node: &Vec<Constants>| if node == reference { 0.0 } else { f64::INFINITY };
        return media.constants.iter().map(walks).collect();
    }
    let strongest = |node: &[Constants]| node.iter().fold(0.0_f64, |m, c| m.max(c.delta.abs()));
    let (exact_result, flagged) = (strongest(reference), media.strongest());
    // The third order is delta^3 / c^5, and counts by the light of the node.
    let share = |(node, weight): (&Vec<Constants>, &f64)| {
        if flagged <= 0.0 || node == reference {
            return 0.0;
        }
        let delta_ratio = strongest(node).max(exact_result) / flagged;
        SEVERE * libm::pow(weight * delta_ratio.powi(3), 0.2)
    };
    media.constants.iter().zip(&media.weights).map(share).collect()
}
