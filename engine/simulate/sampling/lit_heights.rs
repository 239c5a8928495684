//! Parts of a row that apertures of the sample mask which end along z leave open.

use beamlet_model::optics::Optics;

/// Deviations of the blur that the source adds to an aperture on either side.
const REACH: f64 = 2.0;

/// Apertures of the sample mask along z, in rows as seen from the source.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LitHeights {
    /// Rows from a period to the next.
    pub(crate) period: f64,
    /// Upper ends of an aperture, row coordinates in some period, at each different step along z.
    pub(crate) tops: Vec<f64>,
    /// Height of an aperture with its blur, rows.
    pub(crate) height: f64,
}

impl LitHeights {
    /// The apertures of optics at a list of mask offsets; `None` where none ends along z.
    pub(crate) fn of(optics: &Optics, list: usize) -> Option<Self> {
        let plane = optics.cell_plane;
        let strips = optics.sample_mask.as_ref()?.strips(plane, 1)?;
        let row = |z: f64| optics.detector.row_at(z, plane);
        let [low, high] = [strips.strips.first()?.z[0], strips.strips.last()?.z[1]];
        let reach = lit_reach(optics);
        let at = |offset: f64| row(strips.centre + high + reach + offset);
        let mut tops: Vec<f64> =
            optics.offsets.lists_z()[list].iter().map(|offset| at(*offset)).collect();
        if tops.is_empty() {
            tops.push(at(0.0));
        }
        tops.sort_unstable_by(f64::total_cmp);
        tops.dedup();
        let height = row(low - reach) - row(high + reach);
        Some(Self { period: row(0.0) - row(strips.period), tops, height })
    }

    /// Largest part of the interval between two places, rows from the upper end of a row, that the mask opens at a
    /// step.
    pub(super) fn open(&self, row: i64, [low, high]: [f32; 2]) -> f32 {
        let [low, high] = [low, high].map(|at| row as f64 + f64::from(at));
        let open = |top: &f64| {
            let first = ((low - top - self.height) / self.period).floor();
            let mut from = top + first * self.period;
            let mut sum = 0.0;
            while from < high {
                sum += ((from + self.height).min(high) - from.max(low)).max(0.0);
                from += self.period;
            }
            sum / (high - low)
        };
        beamlet_core::numbers::single(self.tops.iter().map(open).fold(0.0, f64::max).min(1.0))
    }
}

/// How far the source blurs the edges of the sample mask along z, m in the cell plane.
pub(super) fn lit_reach(optics: &Optics) -> f64 {
    let spot = optics.spot.reach()[1] / 6.0;
    REACH * spot * (optics.rotation - optics.cell_plane) / optics.rotation
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_open_part_is_the_largest_overlap_of_the_steps() {
        let lit = LitHeights { period: 2.0, tops: vec![0.25, 0.5], height: 0.5 };
        let near = |row: i64, ends: [f32; 2], want: f32| {
            let got = lit.open(row, ends);
            assert!((got - want).abs() < 1e-6, "{row} {ends:?}: {got} for {want}");
        };
        near(0, [0.0, 1.0], 0.5);
        near(0, [0.75, 1.0], 1.0);
        near(0, [0.0, 0.5], 0.5);
        near(1, [0.0, 1.0], 0.0);
        near(2, [0.5, 0.75], 1.0);
    }
}
