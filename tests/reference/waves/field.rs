//! Grids along x in the plane of the mask, and propagation of fields by FFT.

use super::body::Body;
use super::setup::{Setup, Slits};
use rustfft::num_complex::Complex;
use rustfft::{FftDirection, FftPlanner};
use std::f64::consts::PI;

/// Samples along x about 0.
#[derive(Debug, Clone, Copy)]
pub struct Grid {
    /// Number of samples.
    pub count: usize,
    /// Spacing, m.
    pub spacing: f64,
    /// The field repeats: light that leaves at one end enters at the other. Otherwise light that
    /// diffraction throws farther than half of the grid is dropped.
    pub repeats: bool,
}

impl Grid {
    /// Grid of 2^17 samples of 5 nm, 655 um long, dark beyond its ends.
    pub const FINE: Self = Self { count: 1 << 17, spacing: 5e-9, repeats: false };

    /// Length, m.
    pub fn length(&self) -> f64 {
        self.count as f64 * self.spacing
    }

    /// Low end of the first sample, m.
    pub fn start(&self) -> f64 {
        -0.5 * self.length()
    }

    /// Centre of a sample, m.
    pub fn x(&self, i: usize) -> f64 {
        self.start() + (i as f64 + 0.5) * self.spacing
    }

    /// Frequency of a coefficient of the FFT, cycles per metre.
    pub fn frequency(&self, i: usize) -> f64 {
        let wrapped = if 2 * i < self.count { i as f64 } else { i as f64 - self.count as f64 };
        wrapped / self.length()
    }

    /// Samples whose centres lie in `low..high`, within the grid.
    fn samples(&self, low: f64, high: f64) -> std::ops::Range<usize> {
        let index = |x: f64| ((x - self.start()) / self.spacing - 0.5).ceil().max(0.0) as usize;
        index(low).min(self.count)..index(high).min(self.count)
    }

    /// Transform in place, without a factor.
    pub fn transform(values: &mut [Complex<f64>], direction: FftDirection) {
        thread_local!(static PLANNER: std::cell::RefCell<FftPlanner<f64>> = FftPlanner::new().into());
        PLANNER
            .with_borrow_mut(|planner| planner.plan_fft(values.len(), direction))
            .process(values);
    }

    /// Field behind slits in the light of a unit wave: means over samples, so that edges lie where
    /// they are.
    pub fn behind(&self, slits: &Slits) -> Vec<Complex<f64>> {
        let mut field = vec![slits.bars; self.count];
        let count = self.count as f64;
        for opening in &slits.openings {
            let [low, high] = opening.map(|x| (x - self.start()) / self.spacing);
            let ends = if self.repeats { [low, high] } else { [low.max(0.0), high.min(count)] };
            let mut cell = ends[0].floor();
            while cell < ends[1] {
                let share = ends[1].min(cell + 1.0) - ends[0].max(cell);
                field[cell.rem_euclid(count) as usize] += (1.0 - slits.bars) * share;
                cell += 1.0;
            }
        }
        field
    }

    /// Amplitude exp(−τ/2 − ikδL) behind a sample that is seen from a source at `source` (m).
    pub fn through(&self, setup: &Setup, sample: &[Body], source: f64) -> Vec<Complex<f64>> {
        let mut values = vec![Complex::ZERO; self.count];
        for body in sample {
            let constants = Complex::new(-0.5 * body.mu, -setup.wavenumber() * body.delta);
            let [low, high] = body.outline.ends().map(|x| setup.in_mask(x, source));
            for i in self.samples(low, high) {
                let x = setup.in_sample(self.x(i), source);
                values[i] += constants * body.outline.path(x)[0];
            }
        }
        values.iter_mut().for_each(|value| *value = value.exp());
        values
    }

    /// Propagates a field over an effective distance (m).
    pub fn propagate(&self, field: &mut [Complex<f64>], wavelength: f64, distance: f64) {
        if distance == 0.0 {
            return;
        }
        let farthest = if self.repeats {
            f64::INFINITY
        } else {
            0.5 * self.length() / (wavelength * distance.abs())
        };
        Self::transform(field, FftDirection::Forward);
        for (i, value) in field.iter_mut().enumerate() {
            let f = self.frequency(i);
            let transfer = Complex::from_polar(1.0, -PI * wavelength * distance * f * f);
            *value *=
                if f.abs() <= farthest { transfer / self.count as f64 } else { Complex::ZERO };
        }
        Self::transform(field, FftDirection::Inverse);
    }

    /// Intensity at the analyser of a point source, by two propagations where mask and sample are apart;
    /// `sample` is its amplitude. Places are seen from that source, without its displacement.
    pub fn intensity(
        &self,
        setup: &Setup,
        slits: Option<&Slits>,
        sample: &[Complex<f64>],
    ) -> Vec<f64> {
        let open = || vec![Complex::ONE; self.count];
        let mask = slits.map_or_else(open, |slits| self.behind(slits));
        let (mut field, second, planes) = if setup.sample >= setup.mask {
            (mask, sample, [setup.mask, setup.sample])
        } else {
            (sample.to_vec(), &mask[..], [setup.sample, setup.mask])
        };
        self.propagate(&mut field, setup.wavelength, setup.effective(planes[0], planes[1]));
        field.iter_mut().zip(second).for_each(|(value, second)| *value *= second);
        let behind = setup.effective(planes[1], setup.analyser);
        self.propagate(&mut field, setup.wavelength, behind);
        field.iter().map(Complex::norm_sqr).collect()
    }
}
