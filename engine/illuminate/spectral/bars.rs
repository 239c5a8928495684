//! What the bars of the masks do to light of each energy, by its way through them.

#![allow(clippy::cast_precision_loss, reason = "rows are few")]

use super::join::Limits;
use super::{NEGLIGIBLE, Spectral};
use crate::gpu::interface::Strip;
use crate::illuminate::light::MaskShape;
use std::ops::Range;

/// Cells of light that leaks through bars are joined up to this share of the period,
const LEAK_SHARE: f64 = 1.0 / 2.0;
/// where their displacement leaves a straight line by no more than this share of the blur in groups
/// as strong as `LITTLE`, of open beam (less in stronger ones),
const LEAK_RESIDUAL: f64 = 0.3;
const LITTLE: f64 = 0.02;
/// and their light changes by no more than this.
const LEAK_CHANGE: f64 = 0.15;
/// The light of groups below this is spread over the whole strip.
const FAINT: f64 = 1e-3;

/// What the masks do to the light of a column in a block of rows: by node and group, and how much
/// they shade.
pub(super) struct Bars {
    /// `[group][node]`.
    pub(super) shares: Vec<f64>,
    /// `[group]`: the nodes that have light which takes this way.
    pub(super) nodes: Vec<Range<usize>>,
    /// `[node][mask]`.
    pub(super) shades: Vec<[f64; 2]>,
    /// `[group]`: how far cells of light that leaks through bars are joined.
    pub(super) joined: Vec<Option<Limits>>,
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

impl Spectral {
    /// Whether bars do the same to the light of every column, row and energy as in another scene.
    pub(super) fn bars_like(&self, other: &Self) -> bool {
        let mask = |(these, others): (&Option<Vec<MaskShape>>, &Option<Vec<MaskShape>>)| {
            let [these, others] = [these, others].map(|mask| mask.as_deref().unwrap_or_default());
            these.len() == others.len() && these.iter().zip(others).all(|(a, b)| a.shades_like(b))
        };
        self.lattice.alike_rows == other.lattice.alike_rows
            && self.row_slope.to_bits() == other.row_slope.to_bits()
            && self.middle_row.to_bits() == other.middle_row.to_bits()
            && self.slopes == other.slopes
            && self.slopes.iter().all(|&slope| self.is_closed(slope) == other.is_closed(slope))
            && self.masks.iter().zip(&other.masks).all(mask)
    }

    /// Whether shadows of bars meet for rays of this dx/dy.
    fn is_closed(&self, slope: f64) -> bool {
        let closed = |shape: &MaskShape| shape.thickness * slope.abs() > shape.narrowest();
        self.masks.iter().flatten().flatten().any(closed)
    }

    pub(super) fn place(&self, strip: &Strip) -> Place {
        (strip.column, i64::from(strip.row).div_euclid(self.lattice.alike_rows.into()))
    }

    pub(super) fn bars(&self, (column, block): Place) -> Bars {
        if self.groups.is_empty() {
            return Bars {
                shares: Vec::new(),
                nodes: Vec::new(),
                shades: Vec::new(),
                joined: Vec::new(),
                closed: true,
            };
        }
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
        let shade = |node: usize| {
            [0, 1].map(|mask| self.masks[mask].as_ref().map_or(0.0, |of| of[node].shade(secant)))
        };
        let joined = |(shares, leaks): (&[f64], &[bool; 2])| {
            let share: f64 = shares.iter().sum();
            leaks.contains(&true).then(|| {
                if share < FAINT {
                    let all = f64::INFINITY;
                    Limits { width: all, residual: all, change: all }
                } else {
                    let residual = LEAK_RESIDUAL * (LITTLE / share).min(1.0);
                    Limits {
                        width: LEAK_SHARE * self.lattice.period,
                        residual: (residual * self.lattice.edge_blur).max(self.tolerance),
                        change: LEAK_CHANGE,
                    }
                }
            })
        };
        Bars {
            nodes: shares.chunks(self.nodes()).map(with_light).collect(),
            joined: shares.chunks(self.nodes()).zip(&self.groups).map(joined).collect(),
            shares,
            shades: (0..self.nodes()).map(shade).collect(),
            closed: self.is_closed(slope),
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
