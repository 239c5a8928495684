//! Exact transport under a spectrum: computed once, repeated at the energies that it does not determine.

use super::EnergyBinning;
use crate::sampling::CellBatch;
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::numbers::count;
use beamlet_interface::RayResult;
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::scene::Transport;

/// Share of the grazing incidence at which the third order turns light by `FIRST_ORDER_ERROR`, as the second order does
/// at grazing incidence.
const SEVERE: f64 = 0.2154;
impl EnergyBinning {
    /// Results of exact cells, `[exact cell][end]` at the mean constants and those of exact transport that is repeated at
    /// the nodes where it does not follow from these; and `[exact cell][node]` the index of its result where it was
    /// repeated, else 0. `tracer`: `None` for cells without a sample.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(super) fn exact_results(
        &self,
        tracer: Option<&Tracer>,
        cells: &CellBatch,
    ) -> Result<(Vec<RayResult>, Vec<u32>)> {
        let (exact, nodes) = (&cells.moments.exact, self.nodes());
        let mut rays: Vec<RayResult> = exact.iter().flat_map(|it| it.results).collect();
        let mut repeated = vec![0; exact.len() * nodes];
        let (mut asked, mut places) = (vec![Vec::new(); nodes], vec![Vec::new(); nodes]);
        for (index, it) in exact.iter().enumerate() {
            let cell = &cells.cells[it.cell as usize];
            // The third order goes with the fifth power of the incidence.
            let scale = self.tolerance_scale(f64::from(cell.x_high) - f64::from(cell.x_low));
            let grazing = it.grazing() * libm::pow(scale, 0.2);
            for (node, least) in self.exact_retrace_threshold.iter().enumerate() {
                if grazing < *least {
                    asked[node].push(it.ray);
                    places[node].push(index * nodes + node);
                }
            }
        }
        if let Some(tracer) = tracer {
            for (found, places) in tracer.walk_at_nodes(&asked)?.iter().zip(&places) {
                for (result, place) in found.iter().zip(places) {
                    repeated[*place] = count(rays.len());
                    rays.push(*result);
                }
            }
        }
        Ok((rays, repeated))
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
