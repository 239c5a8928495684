//! Whole periods of the sample mask that a scan is away from 0: curves repeat with them, and
//! centres in f32 lose digits to them.

use beamlet_model::optics::Optics;
use beamlet_model::scene::Scene;

/// Least and greatest mask offset of a scene, m.
pub(super) fn ends(scene: &Scene) -> [f64; 2] {
    ends_of(&scene.scan.mask_offsets)
}

fn ends_of(offsets: &[f64]) -> [f64; 2] {
    let wider = |[low, high]: [f64; 2], at: &f64| [low.min(*at), high.max(*at)];
    offsets.iter().fold([f64::INFINITY, f64::NEG_INFINITY], wider)
}

/// Period of the illumination curves of a scene, m; infinite without a sample mask.
pub(super) fn period(scene: &Scene) -> f64 {
    Optics::of(scene).curve_period()
}

/// The number of periods, and their length.
#[derive(Debug, Clone, Copy)]
pub(super) struct WholePeriods {
    count: f64,
    /// m.
    period: f64,
}

impl WholePeriods {
    /// Periods nearest to the middle of a scene's mask offsets; none without a sample mask.
    pub(super) fn of(scene: &Scene) -> Self {
        let ([low, high], period) = (ends(scene), period(scene));
        let count = (f64::midpoint(low, high) / period).round();
        if count.is_finite() && period.is_finite() {
            Self { count, period }
        } else {
            Self { count: 0.0, period: 0.0 }
        }
    }

    /// Periods that take the middle of other offsets nearest to that of the flat's without its own.
    pub(super) fn nearest_to(self, flat: &[f64], other: &[f64]) -> Self {
        let middle = |offsets| {
            let [low, high] = ends_of(offsets);
            f64::midpoint(low, high)
        };
        let more = ((middle(other) - middle(flat)) / self.period).round();
        match more.is_finite() {
            true => Self { count: self.count + more, ..self },
            false => self,
        }
    }

    /// Their length, m.
    pub(super) fn length(self) -> f64 {
        self.count * self.period
    }

    /// Offsets without them, m.
    pub(super) fn without(self, offsets: &[f64]) -> Vec<f64> {
        offsets.iter().map(|offset| libm::fma(-self.count, self.period, *offset)).collect()
    }
}
