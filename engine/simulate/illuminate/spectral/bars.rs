//! Effect of the bars of the masks on light of each energy, by its way through them.

use super::join::Limits;
use super::{EnergyBinning, NEGLIGIBLE};
use crate::sampling::CellBatch;
use beamlet_core::numbers;
use beamlet_interface::CellRow;
use beamlet_model::optics::MaskShape;
use rayon::prelude::*;
use std::ops::Range;

/// Largest width of joined cells of leaked light, share of the period.
const LEAK_SHARE: f64 = 1.0 / 2.0;
/// Largest residual of their displacement about a straight line, share of the blur.
const LEAK_RESIDUAL: f64 = 0.3;
/// Light of groups as strong as this, of open beam, is not joined.
pub(super) const LITTLE: f64 = 0.02;
/// Largest change of their light.
const LEAK_CHANGE: f64 = 0.15;
/// The light of groups below this is spread over the whole cell row.
pub(super) const FAINT: f64 = 1e-3;

/// Effect of the masks on the light of a column in a block of rows: by node and group, with the
/// narrowing.
#[derive(Debug)]
pub(super) struct MaskTransmission {
    /// `[group][node]`.
    pub(crate) shares: Vec<f64>,
    /// `[node]`: shares of all groups together.
    pub(super) by_node: Vec<f64>,
    /// `[group]`: the nodes that have light which takes this way.
    pub(crate) nodes: Vec<Range<usize>>,
    /// `[node][mask]`.
    pub(super) narrowings: Vec<[f64; 2]>,
    /// `[group]`: how far cells of light that leaks through bars are joined.
    pub(crate) joined: Vec<Option<Limits>>,
    /// Energies do not share edges: light goes energy by energy.
    pub(crate) apart: bool,
}

/// A column, and a block of rows ([`Lattice::alike_rows`]).
pub(super) type BarPlace = (u32, i64);

/// What bars do at the places of the cell rows that were gathered last: the next ones are near.
#[derive(Debug, Default)]
pub(crate) struct MaskTransmissionCache {
    first_block: i64,
    /// `[block][column]`.
    table: Vec<Option<MaskTransmission>>,
}

impl MaskTransmissionCache {
    /// Knows the places of cell rows, and no others.
    pub(super) fn look_at(&mut self, spectral: &EnergyBinning, cell_rows: &CellBatch) {
        let columns = spectral.slopes.len();
        let block = |cell_row: &CellRow| spectral.place(cell_row).1;
        let first_block = cell_rows.cell_rows.iter().map(block).min().unwrap_or_default();
        let blocks =
            cell_rows.cell_rows.iter().map(|cell_row| block(cell_row) - first_block + 1).max();
        let mut wanted =
            vec![false; columns * numbers::narrow::<usize>(blocks.unwrap_or_default())];
        let mut before = std::mem::take(&mut self.table);
        let moved = (self.first_block - first_block) * columns as i64;
        *self = Self { first_block, table: Vec::new() };
        for cell_row in &cell_rows.cell_rows {
            wanted[self.index(spectral, cell_row)] = true;
        }
        let known = |(index, wanted): (usize, &bool)| {
            let at = usize::try_from(index as i64 - moved).ok().filter(|_| *wanted)?;
            before.get_mut(at)?.take()
        };
        let known: Vec<Option<MaskTransmission>> = wanted.iter().enumerate().map(known).collect();
        drop(before);
        let bars = |(index, (wanted, known)): (usize, (bool, Option<MaskTransmission>))| {
            let place =
                || (numbers::count(index % columns), first_block + (index / columns) as i64);
            wanted.then(|| known.unwrap_or_else(|| spectral.bars(place())))
        };
        self.table =
            wanted.into_par_iter().zip(known).enumerate().with_min_len(64).map(bars).collect();
    }

    fn index(&self, spectral: &EnergyBinning, cell_row: &CellRow) -> usize {
        let (column, block) = spectral.place(cell_row);
        numbers::narrow::<usize>(block - self.first_block) * spectral.slopes.len() + column as usize
    }

    /// Those at the place of a cell row, which was looked at.
    pub(super) fn at(&self, spectral: &EnergyBinning, cell_row: &CellRow) -> &MaskTransmission {
        self.table[self.index(spectral, cell_row)].as_ref().expect("the place was looked at")
    }
}

/// Share of light that takes a way through masks of these leaks, where there are masks.
pub(super) fn passing(leaks: [Option<f64>; 2], group: [bool; 2]) -> f64 {
    let through = |i: usize| leaks[i].map_or(1.0, |leak| if group[i] { leak } else { 1.0 - leak });
    through(0) * through(1)
}

/// Nodes of a group but for those at either end that have next to no light.
fn with_light(shares: &[f64]) -> Range<usize> {
    let dark = |shares: &mut dyn Iterator<Item = &f64>| {
        let mut sum = 0.0;
        let below = |share: &&f64| {
            sum += **share;
            sum < 0.5 * NEGLIGIBLE
        };
        shares.take_while(below).count()
    };
    let first = dark(&mut shares.iter());
    first..(shares.len() - dark(&mut shares.iter().rev())).max(first)
}

impl EnergyBinning {
    /// True if energies share no edges for rays of this dx/dy: shadows of bars touch, so that apertures
    /// have no effective width, or edges differ too much.
    fn is_apart(&self, slope: f64) -> bool {
        let closed = |shape: &MaskShape| shape.widest_shadow(slope) > shape.narrowest();
        self.masks.iter().flatten().flatten().any(closed) || !self.edges.are_close(slope)
    }

    pub(super) fn place(&self, cell_row: &CellRow) -> BarPlace {
        (cell_row.column, i64::from(cell_row.row).div_euclid(self.lattice.alike_rows.into()))
    }

    pub(super) fn bars(&self, (column, block): BarPlace) -> MaskTransmission {
        if self.groups.is_empty() {
            return MaskTransmission {
                shares: Vec::new(),
                by_node: Vec::new(),
                nodes: Vec::new(),
                narrowings: Vec::new(),
                joined: Vec::new(),
                apart: true,
            };
        }
        let slope = self.slopes[column as usize];
        let row = (block as f64 + 0.5) * f64::from(self.lattice.alike_rows);
        let slope_z = (row - self.middle_row) * self.row_slope;
        let secant = (1.0 + slope * slope + slope_z * slope_z).sqrt();
        let (mut by_node, mut narrowings) = (Vec::new(), Vec::with_capacity(self.nodes()));
        for node in 0..self.nodes() {
            let shapes = [0, 1].map(|i| self.masks[i].as_ref().map(|mask| &mask[node]));
            let leaks = shapes.map(|shape| shape.map(|shape| shape.leak(secant)));
            let narrowing = |i: usize| Some(shapes[i]?.narrowing(secant, leaks[i]?));
            narrowings.push([0, 1].map(|mask| narrowing(mask).unwrap_or_default()));
            let plates: f64 =
                shapes.iter().flatten().map(|shape| shape.through_substrate(secant)).product();
            let share = |group| self.weights[node] * plates * passing(leaks, group);
            by_node.extend(self.groups.iter().map(|group| share(*group)));
        }
        let groups = self.groups.len();
        let shares: Vec<f64> = (0..groups)
            .flat_map(|group| by_node[group..].iter().step_by(groups).copied())
            .collect();
        let joined = |(shares, leaks): (&[f64], &[bool; 2])| {
            let share: f64 = shares.iter().sum();
            (leaks.contains(&true) && share < LITTLE).then(|| {
                if share < FAINT {
                    let all = f64::INFINITY;
                    Limits { width: all, residual: all, change: all }
                } else {
                    Limits {
                        width: LEAK_SHARE * self.lattice.period,
                        residual: (LEAK_RESIDUAL * self.lattice.edge_blur).max(self.tolerance),
                        change: LEAK_CHANGE,
                    }
                }
            })
        };
        MaskTransmission {
            nodes: shares.chunks(self.nodes()).map(with_light).collect(),
            joined: shares.chunks(self.nodes()).zip(&self.groups).map(joined).collect(),
            by_node: by_node.chunks(groups).map(|shares| shares.iter().sum()).collect(),
            shares,
            narrowings,
            apart: self.is_apart(if self.lattice.heights {
                slope.abs().max(slope_z.abs())
            } else {
                slope
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_nodes_at_the_ends_are_left_out() {
        assert_eq!(with_light(&[0.0, 1e-12, 0.3, 0.0, 0.2, 1e-10]), 2..5);
        assert_eq!(with_light(&[0.3, 0.2]), 0..2);
        assert_eq!(with_light(&[4e-10, 4e-10]), 1..1);
        assert!(with_light(&[0.0, 0.0]).is_empty());
    }
}
