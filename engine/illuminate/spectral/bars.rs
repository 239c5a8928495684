//! What the bars of the masks do to light of each energy, by its way through them.

#![allow(clippy::cast_precision_loss, reason = "rows are few")]

use super::Spectral;
use crate::gpu::interface::Strip;
use crate::illuminate::light::MaskShape;

/// Cells of light that leaks through bars are joined up to this share of the period where it is
/// as little as `LITTLE`, of open beam; less far where there is more.
const LEAK_SHARE: f64 = 1.0 / 12.0;
const LITTLE: f64 = 2e-3;
/// The light of groups below this is spread over the whole strip.
const FAINT: f64 = 1e-4;

/// What the masks do to the light of a column in a block of rows: by node and group, and how much
/// they shade.
pub(super) struct Bars {
    /// `[group][node]`.
    pub(super) shares: Vec<f64>,
    /// `[mask][node]`.
    pub(super) shades: [Vec<f64>; 2],
    /// `[group]`: how far cells of light that leaks through bars are joined, m.
    pub(super) joined: Vec<Option<f64>>,
    /// The shadows of bars meet: apertures have no effective width.
    pub(super) closed: bool,
}

/// A column, and a block of rows ([`Lattice::alike_rows`]).
pub(super) type Place = (u32, i64);

/// Share of light that takes a way through masks of these leaks, where there are masks.
pub(super) fn passing(leaks: [Option<f64>; 2], group: [bool; 2]) -> f64 {
    let through = |i: usize| leaks[i].map_or(1.0, |leak| if group[i] { leak } else { 1.0 - leak });
    through(0) * through(1)
}

impl Spectral {
    pub(super) fn place(&self, strip: &Strip) -> Place {
        (strip.column, i64::from(strip.row).div_euclid(self.lattice.alike_rows.into()))
    }

    pub(super) fn bars(&self, (column, block): Place) -> Bars {
        let slope = self.slopes[column as usize];
        let row = (block as f64 + 0.5) * f64::from(self.lattice.alike_rows);
        let slope_z = (row - self.middle_row) * self.row_slope;
        let secant = (1.0 + slope * slope + slope_z * slope_z).sqrt();
        let of_node = |n: usize| {
            let leaks = [0, 1].map(|i| self.masks[i].as_ref().map(|mask| mask[n].leak(secant)));
            self.groups.iter().map(move |group| self.weights[n] * passing(leaks, *group))
        };
        let by_node: Vec<f64> = (0..self.nodes()).flat_map(of_node).collect();
        let groups = self.groups.len();
        let shares: Vec<f64> = (0..groups)
            .flat_map(|group| by_node[group..].iter().step_by(groups).copied())
            .collect();
        let shade = |mask: &Option<Vec<MaskShape>>| {
            mask.iter().flatten().map(|shape| shape.shade(secant)).collect()
        };
        let joined = |(shares, leaks): (&[f64], &[bool; 2])| {
            let share: f64 = shares.iter().sum();
            leaks.contains(&true).then(|| {
                if share < FAINT {
                    f64::INFINITY
                } else {
                    self.lattice.period * LEAK_SHARE * (LITTLE / share).min(1.0)
                }
            })
        };
        let closed = |mask: &Option<Vec<MaskShape>>| {
            mask.iter().flatten().any(|shape| shape.thickness * slope.abs() > shape.narrowest())
        };
        Bars {
            joined: shares.chunks(self.nodes()).zip(&self.groups).map(joined).collect(),
            shares,
            shades: [shade(&self.masks[0]), shade(&self.masks[1])],
            closed: self.groups.is_empty() || self.masks.iter().any(closed),
        }
    }
}
