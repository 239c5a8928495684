//! Cells of light of lines near grazing, for the illumination of rays.

use super::columns::SAME;
use super::grazing::GrazingPart;
use super::lines::Patch;
use crate::sampling::{CellBatch, CellMoments, Lattice, empty_cell_row};
use beamlet_core::numbers::single;
use beamlet_interface::{Cell, CellRow};
use beamlet_model::optics::Optics;

/// Lattice of the cells, and the light of each energy.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CellPlaces<'a> {
    /// Lattice of cells; a beamlet of lines may hold several of its beamlets.
    pub lattice: &'a Lattice,
    /// Optics of the scene.
    pub optics: &'a Optics,
    /// Share of the light of each energy.
    pub weights: &'a [f64],
}

impl CellPlaces<'_> {
    /// Adds the cells of a patch of the lattice of lines to the lists of all energies; their light, as a share of
    /// the light of the patch.
    pub(super) fn add(&self, lists: &mut [CellBatch], lines: &Lattice, patch: &Patch) -> f64 {
        if patch.heights.light().all(|line| line.grazing.is_empty()) {
            return 0.0;
        }
        let beside = [-1, 1]
            .map(|down| patch.heights.weights(|ends| self.lattice.linear_in_row(ends, 0.0, down)));
        let centre = lines.centre(patch.beamlet);
        let period = [-0.5, 0.5].map(|half| centre + half * lines.period);
        let mut light = 0.0;
        for (at, line) in patch.heights.light().enumerate() {
            if line.grazing.is_empty() {
                continue;
            }
            let ends = patch.heights.nearest(at);
            let height = ends[1] - ends[0];
            let mut shares = self.lattice.row_shares(ends[0], ends[1], 0.0);
            if shares[0] >= 0.0 {
                // Of light that is linear between lines.
                shares = [0, 1].map(|side: usize| single((beside[side][at] / height).max(0.0)));
            }
            for beamlet in self.lattice.beamlets_of(period) {
                let middle = self.lattice.centre(beamlet);
                let half = 0.5 * self.lattice.period;
                // Empty, but for rounding, in beamlets beside.
                let own = [period[0].max(middle - half), period[1].min(middle + half)];
                let column = beamlet - self.lattice.beamlets.start;
                let [top, bottom] = ends.map(single);
                let row = CellRow { top, bottom, ..empty_cell_row(column, patch.row) };
                let mut cells = vec![Vec::new(); lists.len()];
                for it in &line.grazing {
                    let x = it.x.map(|x| (centre + x).max(own[0]).min(own[1]));
                    if x[1] - x[0] <= SAME {
                        continue;
                    }
                    let passed = f64::from(it.result.optical_depth).exp().recip();
                    let share = (x[1] - x[0]) / lines.period * height;
                    light += self.weights[it.energy] * passed * share;
                    lists[it.energy].landed_off += u64::from(self.leaves_row(it));
                    cells[it.energy].push(self.cell(it, x.map(|x| x - middle), shares));
                }
                for (list, cells) in lists.iter_mut().zip(&cells) {
                    list.push(row, cells, &CellMoments::default());
                }
            }
        }
        light
    }

    /// True if light lands a row or more from its own; it stays there.
    fn leaves_row(&self, part: &GrazingPart) -> bool {
        let z = part.result.landing_z(single(self.optics.gap()));
        f64::from(z).abs() > self.optics.detector.pitch[1]
    }

    /// Cell of a part of a line; `x`: from the centre of its beamlet, m. Shares: in the row above and below.
    fn cell(&self, part: &GrazingPart, x: [f64; 2], [share_above, share_below]: [f32; 2]) -> Cell {
        let result = &part.result;
        let ratio = single(self.optics.analyser / self.optics.detector.distance);
        let gap = single(self.optics.gap());
        Cell {
            x_low: single(x[0]),
            x_high: single(x[1]),
            depth_low: result.optical_depth,
            depth_high: result.optical_depth,
            displacement_low: result.displacement_x,
            displacement_high: result.displacement_x,
            displacement_variance: result.displacement_variance,
            share_above,
            share_below,
            pixel_shift: result.pixel_shift(gap, ratio),
            ..bytemuck::Zeroable::zeroed()
        }
    }
}
