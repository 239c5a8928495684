//! Light of a spectrum: cells of all energies gathered into few (docs/developers/numerics.md, "Cells of all energies").
//!
//! A photon passes each mask either through an aperture or through the bars. Light that took the same way
//! (a group, at most four) is gathered over the energies into one cell with its mean displacement; the
//! spread of the displacement over the energies is added to the blur. Cells for which that is not enough
//! go energy by energy. Kernels gather (`shaders/light/energies.comp`, `gather.comp`); these files hold what they need:
//!
//! - `set_up`: constants and limits of a scene; `edges`: where energies share edges of bars;
//! - `bars`: effect of the masks at a place;
//! - `exact`: exact transport that is repeated at single energies;
//! - `gatherer`: buffers and dispatches.

mod bars;
mod edges;
mod exact;
mod gatherer;
mod set_up;

use crate::sampling::{CellBatch, Lattice};
use bars::passing;
use beamlet_interface::{
    CellRow, EnergyParams, MOMENTS_LEVER, MOMENTS_PER_MATERIAL, MOMENTS_SLOPE,
};
use beamlet_model::optics::MaskShape;
use edges::SharedEdges;

pub(crate) use gatherer::Gatherer;
pub(super) use gatherer::{Dispatches, Gathering};

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
/// A cell of this share of the period may deviate by the tolerances; narrower ones by more, in
/// proportion, since they carry less light.
const FULL_SHARE: f64 = 1.0 / 40.0;

/// Inputs of the gathering from a scene.
#[derive(Debug, Clone)]
pub(crate) struct EnergyBinning {
    weights: Vec<f64>,
    /// Limits for kernels; without addresses.
    params: EnergyParams,
    /// Constants for kernels, as [`EnergyParams::constants`] has them.
    constants: Vec<f32>,
    /// Largest delta of each material.
    strongest: Vec<f64>,
    /// Share of the grazing incidence below which exact transport is repeated in a cell of [`FULL_SHARE`], by node.
    exact_retrace_threshold: Vec<f64>,
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
    row_slope: f64,
    middle_row: f64,
}

impl EnergyBinning {
    fn nodes(&self) -> usize {
        self.weights.len()
    }

    /// Share of the light of a node along the axis that takes a way through the masks.
    fn passes(&self, node: usize, group: [bool; 2]) -> f64 {
        passing([0, 1].map(|i| self.masks[i].as_ref().map(|mask| mask[node].leak(1.0))), group)
    }

    /// How much more than the widest cell of full accuracy a cell of this width may err: it has less light.
    fn tolerance_scale(&self, width: f64) -> f64 {
        (self.lattice.period * FULL_SHARE / width).max(1.0)
    }

    /// True if light of a cell row may land farther than in its row and the two beside it, at any energy: by a bound of
    /// the displacement along z of rays of first order. `exact`: of each cell, not 0 of one that was traced exactly.
    fn may_land_far(&self, cells: &CellBatch, exact: &[u32], cell_row: &CellRow) -> bool {
        let words = 2 * self.params.moment_words as usize;
        let first = cell_row.first_cell as usize;
        let end = first + cell_row.cell_count as usize;
        if self.lattice.heights || exact[first..end].iter().any(|number| *number != 0) {
            return !self.lattice.heights;
        }
        let gap = f64::from(self.params.gap);
        let farthest = |ray: &[f32]| {
            let materials = ray.chunks(MOMENTS_PER_MATERIAL).zip(&self.strongest);
            let of = |(m, delta): (&[f32], &f64)| {
                let [lever, slope] = [MOMENTS_LEVER, MOMENTS_SLOPE].map(|at| f64::from(m[at + 1]));
                delta * (lever + gap * slope).abs()
            };
            materials.map(of).sum::<f64>()
        };
        let ends = cells.moments.ends.get(words * first..words * end).unwrap_or_default();
        let rays = ends.chunks(words / 2);
        let down = rays.map(farthest).fold(0.0, f64::max) / f64::from(self.params.row_pitch);
        let [top, bottom] = [cell_row.top, cell_row.bottom].map(f64::from);
        !self.lattice.lands_beside(top - down, bottom + down)
    }
}
