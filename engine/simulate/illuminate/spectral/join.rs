//! Neighbouring cells of faint light joined to fewer.

use super::integrals::Integrals;
use super::sums::BandSums;

/// How far cells are joined.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// m.
    pub(super) width: f64,
    /// Deviation of the displacement from a straight line, standard deviation, m.
    pub(super) residual: f64,
    /// Change of the light, as a share of it.
    pub(super) change: f64,
}

/// Cells being joined: their light, its displacement, and straight lines for both.
#[derive(Debug, Default)]
pub(super) struct Joining {
    ends: Option<[f32; 2]>,
    sums: BandSums,
    light: Integrals,
    x: Integrals,
    /// Least and most light.
    range: [f64; 2],
}

impl Joining {
    /// Takes a cell, if it fits with those before it.
    pub(super) fn takes(&mut self, ends: [f32; 2], sums: &BandSums, limits: &Limits) -> bool {
        let [first, mut last] = self.ends.unwrap_or([ends[0]; 2]);
        let [light, x] = [sums.light(), sums.x()];
        let mut range = if self.ends.is_some() { self.range } else { [f64::INFINITY, 0.0] };
        range = [range[0].min(light[0]).min(light[2]), range[1].max(light[0]).max(light[2])];
        let at = ends.map(|end| f64::from(end) - f64::from(first));
        let mut line = self.x;
        line.add(at, [x[0], x[2]]);
        let fits = self.ends.is_none()
            || (last.to_bits() == ends[0].to_bits()
                && at[1] <= limits.width
                && range[1] - range[0] <= limits.change * range[1]
                && line.line(at[1]).1 <= limits.residual * limits.residual);
        if fits {
            last = ends[1];
            (self.ends, self.range, self.x) = (Some([first, last]), range, line);
            self.light.add(at, [light[0], light[2]]);
            self.sums.add(sums, at[1] - at[0]);
        }
        fits
    }

    /// The interval joined, with its sums per metre.
    pub(super) fn take(&mut self) -> Option<([f32; 2], BandSums)> {
        let Self { ends, sums, light, x, .. } = std::mem::take(self);
        let ends = ends?;
        let width = f64::from(ends[1]) - f64::from(ends[0]);
        let joined = sums.joined(width, light.line(width).0, x.line(width).0);
        (joined.light()[1] > 0.0).then_some((ends, joined))
    }
}
