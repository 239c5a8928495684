//! Windows on the analyser: the blurred apertures of the detector mask, or pixels, one to a period.

use beamlet_core::numbers::{self, single};
use beamlet_interface::NO_LIGHT;
use beamlet_model::optics::Openings;
use std::ops::RangeInclusive;

/// Points of a table of windows per period of the windows.
const WINDOW_POINTS: usize = 512;
/// Least half width of light in sharp windows, parts of a period: single numbers resolve its place by about as much.
const SHARP_POINTS: f64 = 8_388_608.0;

/// Windows of one width and period.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Windows {
    /// Share of the light that they pass where they are open.
    pub(crate) share: f32,
    /// Integral of the light through one window over the landing point, m, at points from `-table_reach` periods on.
    integral: Vec<f32>,
    /// Half width of the table, periods: that of the light that passes.
    table_reach: f32,
    /// Ends of the windows of a period, m.
    pub(super) ends: Vec<[f32; 2]>,
    /// True if the windows are sharper than points of the table show.
    is_sharp: bool,
    /// Narrower light counts as wide as this to either side, m: the table has no points within less.
    least_half: f32,
    /// Light farther than this from the centre of a window does not pass it, m.
    reach: f32,
    /// Period on the analyser, m.
    pub(crate) period: f32,
    /// Distance from the centre of the nearest of these windows to the centre of the nearest aperture of
    /// the detector mask, m, by beamlet of the lattice; empty if they are those apertures.
    aside: Vec<f32>,
    /// Numbers of the first and last window on the detector, by beamlet of the lattice.
    recorded: Vec<[i64; 2]>,
}

/// Light that lands on the analyser.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Landed {
    /// Share of the light on the sample.
    pub light: f32,
    /// Its place, m from the centre of an aperture of the detector mask.
    pub at: f32,
}

impl Windows {
    /// Windows behind a blur, m, that pass a share of the light. `ends`: of the detector from the centre of the window 0, m,
    /// by beamlet of the lattice.
    pub(super) fn new(
        openings: &Openings,
        blur: f64,
        share: f32,
        aside: Vec<f32>,
        ends: impl Iterator<Item = [f64; 2]>,
    ) -> Self {
        let period = openings.period[0];
        let recorded = |[low, high]: [f64; 2]| {
            [numbers::whole((low / period).ceil()), numbers::whole((high / period).floor())]
        };
        let points = WINDOW_POINTS as f64;
        let is_sharp = blur * points <= period;
        let end = openings.ends().flatten().fold(0.0, |m: f64, end| m.max(end.abs()));
        let reach = end + NO_LIGHT * blur;
        let table_reach = (reach / period).ceil();
        Self {
            share,
            integral: window_integral(openings, blur, numbers::whole(table_reach)),
            table_reach: single(table_reach),
            reach: single(reach),
            least_half: single(if is_sharp { period / SHARP_POINTS } else { period / points }),
            ends: openings.ends().map(|ends| ends.map(single)).collect(),
            is_sharp,
            period: single(period),
            aside,
            recorded: ends.map(recorded).collect(),
        }
    }

    /// Windows of the openings of a strip at the places of these, behind the same blur, m.
    pub(super) fn of_strip(&self, openings: &Openings, blur: f64) -> Self {
        let Self { share, aside, recorded, .. } = self.clone();
        let own = Self::new(openings, blur, share, aside, std::iter::empty());
        Self { recorded, ..own }
    }

    /// These windows with another share of the light.
    pub(super) fn with_share(&self, share: f32) -> Self {
        Self { share, ..self.clone() }
    }

    /// Distance of the landing point of light from the centre of a window, m, given the distance `at`
    /// from the centre of an aperture of the detector mask.
    pub(crate) fn landing(&self, column: usize, at: f32) -> f32 {
        self.aside.get(column).map_or(at, |aside| at + aside)
    }

    /// Integral of the light through the window at 0, which is not sharp, over the landing point.
    fn integral(&self, at: f32) -> f32 {
        let points = WINDOW_POINTS as f32;
        let place = (at / self.period + self.table_reach) * points;
        if place <= 0.0 {
            self.integral[0]
        } else if place >= (self.integral.len() - 1) as f32 {
            self.integral[self.integral.len() - 1]
        } else {
            let index = numbers::whole::<usize>(f64::from(place));
            let (a, b) = (self.integral[index], self.integral[index + 1]);
            a + (b - a) * (place - index as f32)
        }
    }

    /// Numbers of the windows on the detector that light of the beamlet at `column` passes, spread over [at - half,
    /// at + half].
    pub(crate) fn numbers(&self, column: usize, at: f32, half: f32) -> RangeInclusive<i64> {
        let far = half.max(self.least_half) + self.reach;
        let [low, high] = [at - far, at + far].map(|it| f64::from(it / self.period));
        let [first, last] = self.recorded[column];
        numbers::whole::<i64>(low.ceil()).max(first)..=numbers::whole::<i64>(high.floor()).min(last)
    }

    /// Share of light spread over [at - half, at + half] that passes the window at 0; it changes linearly by 1 ± `slope`
    /// of its mean to either end: exact in sharp windows, and where the window is of third degree there.
    pub(crate) fn passed(&self, at: f32, half: f32, slope: f32) -> f32 {
        let half = half.max(self.least_half);
        if at.abs() - half > self.reach {
            return 0.0;
        }
        if self.is_sharp {
            let before = |end: f32| {
                let xi = ((end - at) / half).clamp(-1.0, 1.0);
                0.5 * (xi + 1.0) + 0.25 * slope * (xi * xi - 1.0)
            };
            return self.ends.iter().map(|[low, high]| before(*high) - before(*low)).sum();
        }
        let [low, high] = [at - half, at + half].map(|at| self.integral(at));
        let bend = if slope.abs() > 0.0 { low - 2.0 * self.integral(at) + high } else { 0.0 };
        (high - low + 2.0 / 3.0 * slope * bend) / (2.0 * half)
    }

    /// Largest change of the light in any window on the detector if light of the beamlet at `column`, spread over
    /// 2 `half`, had another amount and landing point.
    pub(super) fn change(&self, column: usize, [a, b]: [Landed; 2], half: f32) -> f32 {
        let [a, b] = [a, b].map(|it| Landed { at: self.landing(column, it.at), ..it });
        let passed = |it: Landed, number: i64| {
            it.light * self.passed(it.at - number as f32 * self.period, half, 0.0)
        };
        let [of_a, of_b] = [a, b].map(|it| self.numbers(column, it.at, half));
        let others = of_b.filter(|number| !of_a.contains(number));
        let change = |number: i64| (passed(a, number) - passed(b, number)).abs();
        of_a.clone().chain(others).map(change).fold(0.0, f32::max)
    }
}

/// Integral of the windows of a period, blurred by a Gaussian, at the points of a table over `reach` periods to either
/// side.
fn window_integral(openings: &Openings, blur: f64, reach: usize) -> Vec<f32> {
    let last = 2 * reach * WINDOW_POINTS;
    // Second antiderivative of the Gaussian.
    let ramp = |x: f64| {
        let t = x / blur;
        if t.abs() > NO_LIGHT {
            return x.max(0.0);
        }
        let density = libm::exp(-0.5 * t * t) / (2.0 * std::f64::consts::PI).sqrt();
        x * 0.5 * libm::erfc(-t * std::f64::consts::FRAC_1_SQRT_2) + blur * density
    };
    let at = |point: usize| {
        let x = (point as f64 / WINDOW_POINTS as f64 - reach as f64) * openings.period[0];
        single(openings.ends().map(|[low, high]| ramp(x - low) - ramp(x - high)).sum())
    };
    (0..=last).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_model::optics::Mask;
    use beamlet_model::scene::{MaskBody, MaskSpec};

    /// Apertures of 30 um in a period of 150 um on a detector of ten, behind a blur, m.
    fn windows(width: f64, blur: f64) -> Windows {
        let body = MaskBody::Sheet { transmission: 0.0 };
        let spec = MaskSpec::new(1.0, 150e-6, width, body);
        let openings = Mask::new("detector_mask", &spec, 1, 1).openings(1.0);
        Windows::new(&openings, blur, 1.0, Vec::new(), std::iter::once([-750e-6, 750e-6]))
    }

    #[test]
    fn the_integral_of_a_window_rises_by_its_width() {
        let Windows { integral, .. } = windows(30e-6, 6e-6);
        let rise = f64::from(integral[integral.len() - 1] - integral[0]);
        assert!((rise - 30e-6).abs() < 1e-10, "{rise}");
        assert!(integral.is_sorted());
    }

    /// Light over seven windows that moves by a period changes in the outer ones alone.
    #[test]
    fn light_over_many_windows_changes_where_it_ends() {
        let landed = |at: f32| Landed { light: 1.0, at };
        for blur in [1e-9, 6e-6] {
            let change = windows(30e-6, blur).change(0, [0.0, 150e-6].map(landed), 525e-6);
            assert!((change - 30.0 / 1050.0).abs() < 1e-4, "{change}");
        }
        // Beside the detector nothing is recorded.
        let change = windows(30e-6, 6e-6).change(0, [1500e-6, 1650e-6].map(landed), 10e-6);
        assert_eq!(change.to_bits(), 0.0_f32.to_bits());
    }

    /// A spot of two pixels: of light at a place the windows pass all, also those more than two pixels away, and a
    /// change is largest in one of these.
    #[test]
    fn a_wide_blur_takes_light_to_windows_far_away() {
        let windows = windows(150e-6, 300e-6);
        let passed: f32 = (-15..=15).map(|k| windows.passed(k as f32 * 150e-6, 1e-6, 0.0)).sum();
        assert!((passed - 1.0).abs() < 1e-4, "{passed}");
        let far = windows.passed(450e-6, 1e-6, 0.0);
        // The density of the spot at 1.5 standard deviations, times half of one.
        assert!((far / (0.5 * 0.1295) - 1.0).abs() < 0.03, "{far}");
    }
}
