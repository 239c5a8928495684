//! Whole periods of the sample mask in its displacements: light and curves repeat with them, and
//! numbers in f32 lose digits to them.

/// Least and greatest of some values, such as mask offsets; infinite without any.
#[must_use]
pub fn ends<'a>(values: impl IntoIterator<Item = &'a f64>) -> [f64; 2] {
    let wider = |[low, high]: [f64; 2], at: &f64| [low.min(*at), high.max(*at)];
    values.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], wider)
}

fn middle(offsets: &[f64]) -> f64 {
    let [low, high] = ends(offsets);
    f64::midpoint(low, high)
}

/// The number of periods, and their length.
#[derive(Debug, Clone, Copy)]
pub struct WholePeriods {
    count: f64,
    /// m.
    period: f64,
}

impl WholePeriods {
    /// Periods nearest to an offset, m; of two equally near numbers the even one. None in an infinite
    /// period.
    pub(super) fn in_offset(offset: f64, period: f64) -> Self {
        let whole = offset - libm::remainder(offset, period);
        Self::new((whole / period).round(), period)
    }

    /// Periods nearest to the middle of the offsets of a scan, m; of two equally near numbers the one farther
    /// from 0. None in an infinite period.
    #[must_use]
    pub fn in_scan(offsets: &[f64], period: f64) -> Self {
        Self::new((middle(offsets) / period).round(), period)
    }

    fn new(count: f64, period: f64) -> Self {
        if count.is_finite() && period.is_finite() {
            Self { count, period }
        } else {
            Self { count: 0.0, period: 0.0 }
        }
    }

    /// Periods that take the middle of other offsets nearest to the middle of the flat's reduced offsets.
    #[must_use]
    pub fn nearest_to(self, flat: &[f64], other: &[f64]) -> Self {
        let more = ((middle(other) - middle(flat)) / self.period).round();
        match more.is_finite() {
            true => Self { count: self.count + more, ..self },
            false => self,
        }
    }

    /// Length of the periods, m.
    #[must_use]
    pub fn length(self) -> f64 {
        self.count * self.period
    }

    /// Offset less these periods, m; exact where the rest is at most half a period.
    #[must_use]
    pub fn reduced(self, offset: f64) -> f64 {
        libm::fma(-self.count, self.period, offset)
    }

    /// Offsets less these periods, m.
    #[must_use]
    pub fn without(self, offsets: &[f64]) -> Vec<f64> {
        offsets.iter().map(|offset| self.reduced(*offset)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rest of a single offset is the remainder of IEEE 754, halves of a period included.
    #[test]
    fn offsets_less_their_nearest_periods_are_exact_remainders() {
        for period in [80e-6, 98e-6, 1.0 / 3.0, 7.0] {
            for eighth in -800..=800 {
                let offset = period * f64::from(eighth) / 8.0;
                for offset in [offset.next_down(), offset, offset.next_up()] {
                    let rest = WholePeriods::in_offset(offset, period).reduced(offset);
                    // All bits but the sign of zero.
                    let off = (rest - libm::remainder(offset, period)).abs();
                    assert_eq!(off.to_bits(), 0, "{offset} of {period}");
                }
            }
        }
        let rest = WholePeriods::in_offset(-0.3, f64::INFINITY).reduced(-0.3);
        assert_eq!(rest.to_bits(), (-0.3_f64).to_bits());
    }

    #[test]
    fn offsets_of_a_scan_are_reduced_together() {
        let periods = WholePeriods::in_scan(&[19.0, 20.0, 22.0], 8.0);
        assert_eq!(periods.without(&[19.0, 20.0, 22.0]), [-5.0, -4.0, -2.0]);
        let nearest = periods.nearest_to(&[19.0, 20.0, 22.0], &[3.0, 4.0, 6.0]);
        assert_eq!(nearest.without(&[3.0, 4.0, 6.0]), [-5.0, -4.0, -2.0]);
        assert_eq!(WholePeriods::in_scan(&[19.0], f64::INFINITY).length().to_bits(), 0);
    }
}
