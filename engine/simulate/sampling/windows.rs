//! Windows on the analyser: the blurred apertures of the detector mask, or pixels, one to a period.

use beamlet_core::numbers::{self, single};
use beamlet_model::optics::Openings;
use std::ops::RangeInclusive;

/// Points of a table of windows per period of the windows.
const WINDOW_POINTS: usize = 512;
/// Half width of the table, periods.
const WINDOW_REACH: usize = 2;
/// Light farther than this beyond the end of a window does not pass it, standard deviations of the blur.
const FARTHEST: f64 = 6.0;

/// Windows of one width and period.
#[derive(Debug, Clone)]
pub(crate) struct Windows {
    /// Share of the light that they pass where they are open.
    pub(crate) share: f32,
    /// Integral of the light through one window over the landing point, m, at points from
    /// `-WINDOW_REACH` periods on.
    integral: Vec<f32>,
    /// Ends of the windows of a period, m, where they are sharper than points of the table show.
    sharp: Option<Vec<[f32; 2]>>,
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

/// Light as windows see it: spread over 2 `half` about a landing point, m.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seen {
    at: f32,
    half: f32,
    /// Number of the nearest window, and what passes that and the two beside it.
    home: f32,
    passed: [f32; 3],
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
        let is_sharp = blur * WINDOW_POINTS as f64 <= period;
        Self {
            share,
            integral: window_integral(openings, blur),
            reach: single(
                openings.ends().flatten().fold(0.0, |m: f64, end| m.max(end.abs()))
                    + FARTHEST * blur,
            ),
            sharp: is_sharp.then(|| openings.ends().map(|ends| ends.map(single)).collect()),
            period: single(period),
            aside,
            recorded: ends.map(recorded).collect(),
        }
    }

    /// Distance of the landing point of light from the centre of a window, m, given the distance `at`
    /// from the centre of an aperture of the detector mask.
    pub(crate) fn landing(&self, column: usize, at: f32) -> f32 {
        self.aside.get(column).map_or(at, |aside| at + aside)
    }

    /// Integral of the light through the window at 0 over the landing point.
    fn integral(&self, at: f32) -> f32 {
        if let Some(windows) = &self.sharp {
            return windows.iter().map(|[low, high]| at.clamp(*low, *high)).sum();
        }
        let points = WINDOW_POINTS as f32;
        let place = (at / self.period + WINDOW_REACH as f32) * points;
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
        let far = half + self.reach;
        let [low, high] = [at - far, at + far].map(|it| f64::from(it / self.period));
        let [first, last] = self.recorded[column];
        numbers::whole::<i64>(low.ceil()).max(first)..=numbers::whole::<i64>(high.floor()).min(last)
    }

    /// Share of light spread evenly over [at - half, at + half] that passes the window at 0.
    pub(crate) fn passed(&self, at: f32, half: f32) -> f32 {
        if at.abs() - half > self.reach {
            return 0.0;
        }
        (self.integral(at + half) - self.integral(at - half)) / (2.0 * half)
    }

    /// As [`Self::passed`], of light that changes linearly by 1 ± `slope` of its mean to either end: exact where the
    /// window is of third degree there.
    pub(crate) fn passed_sloped(&self, at: f32, half: f32, slope: f32) -> f32 {
        if at.abs() - half > self.reach {
            return 0.0;
        }
        let [low, middle, high] = [at - half, at, at + half].map(|at| self.integral(at));
        (high - low + 2.0 / 3.0 * slope * (low - 2.0 * middle + high)) / (2.0 * half)
    }

    /// Light of the beamlet at `column` that lands at `at`, spread over 2 `half`, as windows see it.
    pub(super) fn seen(&self, column: usize, [light, at]: [f32; 2], half: f32) -> Seen {
        let at = self.landing(column, at);
        // The table has no points within less; and the quotient below keeps its digits.
        let half = half.max(2.0 * self.period / WINDOW_POINTS as f32);
        let home = (at / self.period).round();
        Seen { at, half, home, passed: self.passed_near(light, at, home, half) }
    }

    /// Light that passes the window `home` and those beside it.
    fn passed_near(&self, light: f32, at: f32, home: f32, half: f32) -> [f32; 3] {
        [-1.0, 0.0, 1.0].map(|k| light * self.passed(at - (home + k) * self.period, half))
    }

    /// Largest change of the light in any window if `own` had another amount and landing point.
    pub(super) fn change(&self, column: usize, own: (&Seen, f32), [light, at]: [f32; 2]) -> f32 {
        let (seen, own_light) = own;
        let at = self.landing(column, at);
        let most = |a: [f32; 3], b: [f32; 3]| {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let near = most(seen.passed, self.passed_near(light, at, seen.home, seen.half));
        let home = (at / self.period).round();
        if (home - seen.home).abs() < 0.5 {
            return near;
        }
        let there = self.passed_near(own_light, seen.at, home, seen.half);
        near.max(most(there, self.passed_near(light, at, home, seen.half)))
    }
}

/// Integral of the windows of a period, blurred by a Gaussian, at the points of the table.
fn window_integral(openings: &Openings, blur: f64) -> Vec<f32> {
    let last = 2 * WINDOW_REACH * WINDOW_POINTS;
    // Second antiderivative of the Gaussian.
    let ramp = |x: f64| {
        let t = x / blur;
        if t.abs() > 8.0 {
            return x.max(0.0);
        }
        let density = libm::exp(-0.5 * t * t) / (2.0 * std::f64::consts::PI).sqrt();
        x * 0.5 * libm::erfc(-t * std::f64::consts::FRAC_1_SQRT_2) + blur * density
    };
    let at = |point: usize| {
        let x = (point as f64 / WINDOW_POINTS as f64 - WINDOW_REACH as f64) * openings.period[0];
        single(openings.ends().map(|[low, high]| ramp(x - low) - ramp(x - high)).sum())
    };
    (0..=last).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_model::optics::Mask;
    use beamlet_model::scene::{MaskBody, MaskSpec};

    #[test]
    fn the_integral_of_a_window_rises_by_its_width() {
        let body = MaskBody::Sheet { transmission: 0.0 };
        let spec = MaskSpec::new(1.0, 150e-6, 30e-6, body);
        let openings = Mask::new("detector_mask", &spec, 1, 1).openings(1.0);
        let table = window_integral(&openings, 6e-6);
        let rise = f64::from(table[table.len() - 1] - table[0]);
        assert!((rise - 30e-6).abs() < 1e-10, "{rise}");
        assert!(table.is_sorted());
    }
}
