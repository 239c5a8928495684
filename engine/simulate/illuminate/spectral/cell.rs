//! Cells from results at energy nodes and from their sums.

use super::node_result::NodeResult;
use super::sums::BandSums;
use super::{EnergyBinning, FULL_SHARE};
use beamlet_core::numbers::single;
use beamlet_interface::{Cell, CellRow};

impl EnergyBinning {
    /// How much more than the widest cell of full accuracy a cell may err: it has less light.
    pub(super) fn tolerance_scale(&self, x: [f32; 2]) -> f64 {
        let width = f64::from(x[1] - x[0]);
        (self.lattice.period * FULL_SHARE / width).max(1.0)
    }

    /// The cell of a band of energies with these sums.
    pub(super) fn of_band(&self, cell_row: &CellRow, x: [f32; 2], sums: &BandSums) -> Cell {
        let end = |i: usize| NodeResult {
            depth: -sums.light()[i].ln(),
            x: sums.x()[i],
            z: sums.z(),
            slope_x: sums.slope_x(),
        };
        Cell {
            displacement_variance: single(sums.displacement_variance()),
            sample_narrowing: single(sums.narrowing(0)),
            detector_narrowing: single(sums.narrowing(1)),
            sample_covariance: single(sums.covariance(0)),
            detector_covariance: single(sums.covariance(1)),
            ..self.cell(cell_row, x, [end(0), end(2)])
        }
    }

    /// The growth and the slope of light along z behind apertures that end there, for energies of one cell: as of
    /// `cell`, times the means of refraction and depth ([`Self::means_of`]), which are not computed for slits.
    pub(super) fn along_z(
        &self,
        cell: &Cell,
        made: Cell,
        means: impl FnOnce() -> [f64; 2],
    ) -> Cell {
        if !self.lattice.heights {
            return made;
        }
        let [delta_ratio, depth] = means();
        let own = 0.5 * (f64::from(cell.depth_low) + f64::from(cell.depth_high));
        let ratio = if own > 0.0 { depth / own } else { 0.0 };
        Cell {
            share_above: cell.share_above * single(delta_ratio),
            share_below: cell.share_below * single(ratio),
            ..made
        }
    }

    /// Means over the light of energies: refraction, where the cell has 1, and depth.
    pub(super) fn means_of(&self, nodes: impl Iterator<Item = (usize, f64, f64)>) -> [f64; 2] {
        let mut sums = [f64::MIN_POSITIVE, 0.0, 0.0];
        for (node, light, depth) in nodes {
            sums[0] += light;
            sums[1] += light * self.delta_ratio[node];
            sums[2] += light * depth;
        }
        [sums[1] / sums[0], sums[2] / sums[0]]
    }

    /// The cell with these results at its ends.
    pub(super) fn cell(
        &self,
        cell_row: &CellRow,
        x: [f32; 2],
        [low, high]: [NodeResult; 2],
    ) -> Cell {
        let mean = |f: fn(&NodeResult) -> f64| 0.5 * (f(&low) + f(&high));
        let z = mean(|l| l.z);
        let down = -z / self.row_pitch;
        let [above, below] = if self.lattice.heights {
            [0.0; 2]
        } else {
            self.lattice.row_shares(cell_row.top.into(), cell_row.bottom.into(), down)
        };
        Cell {
            x_low: x[0],
            x_high: x[1],
            depth_low: single(low.depth),
            depth_high: single(high.depth),
            displacement_low: single(low.x),
            displacement_high: single(high.x),
            displacement_z: single(z),
            share_above: above,
            share_below: below,
            pixel_shift: single(
                mean(|l| l.x) * (1.0 - self.ratio) - mean(|l| l.slope_x) * self.gap * self.ratio,
            ),
            ..bytemuck::Zeroable::zeroed()
        }
    }
}
