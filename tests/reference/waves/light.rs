//! Light of windows: intensity blurred by the focal spot, and curves over offsets of the sample mask.

use super::super::normal::nodes;
use super::body::Body;
use super::field::Grid;
use super::setup::{Setup, Slits, Spot, Window};
use rustfft::FftDirection;
use rustfft::num_complex::Complex;
use std::f64::consts::{PI, TAU};

/// Integral of a blurred intensity over x, in coordinates of the mask.
#[derive(Debug, Clone)]
pub struct Light {
    grid: Grid,
    /// Integral up to the low end of each sample, and of all; m.
    sums: Vec<f64>,
}

impl Light {
    /// Blurs the intensity of a point source by Gaussians of the focal spot.
    pub fn blurred(grid: Grid, setup: &Setup, intensity: &[f64], spot: &[Spot]) -> Self {
        let mut values: Vec<Complex<f64>> = intensity.iter().map(|&i| i.into()).collect();
        Grid::transform(&mut values, FftDirection::Forward);
        let shift = setup.source_shift();
        for (i, value) in values.iter_mut().enumerate() {
            let f = grid.frequency(i);
            let blur = |spot: &Spot| {
                let exponent = -2.0 * (PI * f * spot.sigma * shift).powi(2);
                let turned = -TAU * f * spot.centre * shift;
                spot.weight * Complex::new(exponent, turned).exp()
            };
            *value *= spot.iter().map(blur).sum::<Complex<f64>>() / grid.count as f64;
        }
        Grid::transform(&mut values, FftDirection::Inverse);
        let mut sums = Vec::with_capacity(grid.count + 1);
        sums.push(0.0);
        sums.extend(values.iter().scan(0.0, |sum, value| {
            *sum += value.re * grid.spacing;
            Some(*sum)
        }));
        Self { grid, sums }
    }

    /// Integral up to `x`, m.
    fn up_to(&self, x: f64) -> f64 {
        let count = self.grid.count as f64;
        let at = (x - self.grid.start()) / self.grid.spacing;
        let rounds = if self.grid.repeats { (at / count).floor() } else { 0.0 };
        let at = (at - rounds * count).clamp(0.0, count);
        let cell = (at.floor() as usize).min(self.grid.count - 1);
        let within = self.sums[cell] + (at - cell as f64) * (self.sums[cell + 1] - self.sums[cell]);
        rounds * self.sums[self.grid.count] + within
    }

    /// Light of a window about `centre` (in the plane of the analyser, m), 1 for the open beam.
    pub fn seen(&self, setup: &Setup, window: &Window, centre: f64) -> f64 {
        let m = setup.magnification();
        let part = |[weight, width]: [f64; 2]| {
            let [low, high] = [-0.5, 0.5].map(|side| (centre + side * width) / m);
            weight * (self.up_to(high) - self.up_to(low))
        };
        window.boxes().map(part).iter().sum::<f64>() * m / window.pixel
    }
}

/// Set-up, masks and sample of a curve, by waves or rays.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    pub setup: &'a Setup,
    /// Sample mask at offset 0; none for an open beam.
    pub slits: Option<&'a Slits>,
    pub sample: &'a [Body],
    pub window: Window,
}

impl Case<'_> {
    /// Light of windows about `centres` (analyser, m) at each offset of the mask:
    /// `[offset][centre]`, 1 for the open beam. The spot is a blur at the analyser.
    pub fn curves(&self, grid: Grid, centres: &[f64], offsets: &[f64]) -> Vec<Vec<f64>> {
        let sample = grid.through(self.setup, self.sample, 0.0);
        let at = |&offset: &f64| {
            let slits = self.slits.map(|slits| slits.moved(offset));
            let intensity = grid.intensity(self.setup, slits.as_ref(), &sample);
            let light = Light::blurred(grid, self.setup, &intensity, &self.setup.spot);
            centres.iter().map(|&c| light.seen(self.setup, &self.window, c)).collect()
        };
        offsets.iter().map(at).collect()
    }

    /// Curve of a window about 0.
    pub fn curve(&self, grid: Grid, offsets: &[f64]) -> Vec<f64> {
        self.curves(grid, &[0.0], offsets).into_iter().flatten().collect()
    }

    /// Light as by `curves`, from `count` points of each Gaussian of the spot: a sample that is not in
    /// the plane of the mask moves against the mask as it is seen from them. Points need to be so dense
    /// that their fringes (period λz/a for an aperture a) add to a blur: 12 σ (M − 1)/M < `count` λz/a.
    pub fn by_source_points(
        &self,
        grid: Grid,
        centres: &[f64],
        offsets: &[f64],
        count: usize,
    ) -> Vec<Vec<f64>> {
        let mut sums = vec![vec![0.0; centres.len()]; offsets.len()];
        let points = self.setup.spot.iter().flat_map(|spot| {
            let nodes = nodes(spot.sigma, count, 6.0).into_iter();
            nodes.map(|(from, weight)| (spot.weight * weight, spot.centre + from))
        });
        for (weight, centre) in points {
            let point = [Spot { weight, centre, sigma: 0.0 }];
            let sample = grid.through(self.setup, self.sample, centre);
            for (row, &offset) in sums.iter_mut().zip(offsets) {
                let slits = self.slits.map(|slits| slits.moved(offset));
                let intensity = grid.intensity(self.setup, slits.as_ref(), &sample);
                let light = Light::blurred(grid, self.setup, &intensity, &point);
                for (sum, &at) in row.iter_mut().zip(centres) {
                    *sum += light.seen(self.setup, &self.window, at);
                }
            }
        }
        sums
    }
}

/// Transform of a curve at the frequency `f` (cycles per metre of the mask), over equidistant offsets.
pub fn transform(offsets: &[f64], curve: &[f64], f: f64) -> Complex<f64> {
    let term = |(offset, light): (&f64, &f64)| Complex::from_polar(*light, -TAU * f * offset);
    offsets.iter().zip(curve).map(term).sum()
}
