//! Effect of the bars of the masks on light of each energy, by its way through them.

use super::{EnergyBinning, NEGLIGIBLE};
use beamlet_core::numbers::single;
use beamlet_interface::CellRow;
use beamlet_model::optics::MaskShape;
use rayon::prelude::*;
use std::ops::Range;

/// Largest width of joined cells of leaked light, share of the period.
const LEAK_SHARE: f64 = 1.0 / 2.0;
/// Largest residual of their displacement about a straight line, share of the blur.
const LEAK_RESIDUAL: f64 = 0.3;
/// Light of groups as strong as this, of open beam, is not joined.
const LITTLE: f64 = 0.02;
/// Largest change of their light.
const LEAK_CHANGE: f64 = 0.15;
/// The light of groups below this is spread over the whole cell row.
const FAINT: f64 = 1e-3;
/// A limit of anything; its square is a number of single precision, too.
const UNLIMITED: f64 = 1e15;

/// Effect of the masks on the light of a column in a block of rows.
#[derive(Debug)]
pub(super) struct MaskTransmission {
    /// As [`beamlet_interface::EnergyRow::bars`] has it.
    pub(super) words: Vec<f32>,
    /// Energies do not share edges: light goes energy by energy.
    pub(super) apart: bool,
}

/// A column, and a block of rows ([`Lattice::alike_rows`]).
pub(super) type BarPlace = (u32, i64);

/// Effect of bars at the places of the cell rows that were gathered last, sorted: the next ones are near.
#[derive(Debug, Default)]
pub(super) struct MaskTransmissionCache(Vec<(BarPlace, MaskTransmission)>);

impl MaskTransmissionCache {
    /// Takes the places of these cell rows instead of those before.
    pub(super) fn set_places(&mut self, binning: &EnergyBinning, cell_rows: &[CellRow]) {
        let mut places: Vec<BarPlace> = cell_rows.iter().map(|it| binning.place(it)).collect();
        places.sort_unstable();
        places.dedup();
        let mut before = std::mem::take(&mut self.0).into_iter().peekable();
        let known = |place: &BarPlace| {
            while before.next_if(|(other, _)| other < place).is_some() {}
            before.next_if(|(other, _)| other == place).map(|(_, known)| known)
        };
        let known: Vec<Option<MaskTransmission>> = places.iter().map(known).collect();
        let bars = |(place, known): (BarPlace, Option<MaskTransmission>)| {
            (place, known.unwrap_or_else(|| binning.bars(place)))
        };
        self.0 = places.into_par_iter().zip(known).with_min_len(64).map(bars).collect();
    }

    /// All places, sorted.
    pub(super) fn places(&self) -> &[(BarPlace, MaskTransmission)] {
        &self.0
    }

    /// Index of the place of a cell row.
    pub(super) fn index(&self, binning: &EnergyBinning, cell_row: &CellRow) -> usize {
        let place = binning.place(cell_row);
        self.0.partition_point(|(other, _)| *other < place)
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

    fn place(&self, cell_row: &CellRow) -> BarPlace {
        (cell_row.column, i64::from(cell_row.row).div_euclid(self.lattice.alike_rows.into()))
    }

    fn bars(&self, (column, block): BarPlace) -> MaskTransmission {
        let slope = self.slopes[column as usize];
        let row = (block as f64 + 0.5) * f64::from(self.lattice.alike_rows);
        let slope_z = (row - self.middle_row) * self.row_slope;
        let secant = (1.0 + slope * slope + slope_z * slope_z).sqrt();
        let (groups, nodes) = (self.groups.len(), self.nodes());
        let mut shares = vec![0.0; groups * nodes];
        let mut narrowings = Vec::with_capacity(2 * nodes);
        for node in 0..nodes {
            let shapes = [0, 1].map(|i| self.masks[i].as_ref().map(|mask| &mask[node]));
            let leaks = shapes.map(|shape| shape.map(|shape| shape.leak(secant)));
            let narrowing = |i: usize| Some(shapes[i]?.narrowing(secant, leaks[i]?));
            narrowings.extend([0, 1].map(|mask| narrowing(mask).unwrap_or_default()));
            let plates: f64 =
                shapes.iter().flatten().map(|shape| shape.through_substrate(secant)).product();
            for (group, leaky) in self.groups.iter().enumerate() {
                shares[group * nodes + node] = self.weights[node] * plates * passing(leaks, *leaky);
            }
        }
        let of_node = |node: usize| shares[node..].iter().step_by(nodes).sum();
        let by_node: Vec<f64> = (0..nodes).map(of_node).collect();
        let of_groups = shares.chunks(nodes).zip(&self.groups).flat_map(|(shares, leaks)| {
            let range = with_light(shares);
            let joined = self.joining_limits(shares.iter().sum(), leaks.contains(&true));
            [range.start as f64, range.end as f64].into_iter().chain(joined)
        });
        let all = shares.iter().copied().chain(by_node).chain(narrowings).chain(of_groups);
        MaskTransmission {
            words: all.map(single).collect(),
            apart: groups == 0
                || self.is_apart(if self.lattice.heights {
                    slope.abs().max(slope_z.abs())
                } else {
                    slope
                }),
        }
    }

    /// Limits of cells of a group that are joined: width, residual and change; a width below 0 where none are.
    fn joining_limits(&self, share: f64, leaks: bool) -> [f64; 3] {
        if !leaks || share >= LITTLE {
            return [-1.0; 3];
        }
        if share < FAINT {
            return [UNLIMITED; 3];
        }
        let residual = (LEAK_RESIDUAL * self.lattice.edge_blur).max(self.tolerance);
        [LEAK_SHARE * self.lattice.period, residual, LEAK_CHANGE]
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
