//! Kernels of the blur, and how much of the light that falls evenly into an interval lands in a
//! pixel. One dimension at a time; lengths in pixels of that dimension.

use beamlet_core::{Error, Result, image, numbers};
use beamlet_model::scene::{KernelFile, Scene};
use ndarray::Array2;

/// Deviations of a Gaussian that count: 2e-9 of the light lies beyond.
const REACH: f64 = 6.0;
/// Widest kernels, pixels: the cost grows with their area.
const BLUR: f64 = 100.0;
const SCATTER: f64 = 2000.0;

/// A kernel along one axis.
#[derive(Debug, Clone)]
pub(super) enum Spread {
    /// Gaussian of this standard deviation.
    Gaussian(f64),
    /// Even over each of some samples of this width, the middle at 0. `below`: sums over the samples
    /// before each and over all, of their weights (1 in the end), and of their weights times their
    /// middles.
    Samples { below: Vec<[f64; 2]>, width: f64 },
}

impl Spread {
    /// Samples of these weights, which sum to 1.
    pub(super) fn samples(weights: &[f64], width: f64) -> Self {
        let first = -0.5 * weights.len() as f64 * width;
        let mut below = vec![[0.0; 2]];
        let mut sum = [0.0; 2];
        for (k, weight) in weights.iter().enumerate() {
            sum[0] += weight;
            sum[1] += weight * (first + (k as f64 + 0.5) * width);
            below.push(sum);
        }
        Self::Samples { below, width }
    }

    /// Farthest that light goes.
    pub(super) fn reach(&self) -> f64 {
        match self {
            Self::Gaussian(sigma) => REACH * sigma,
            Self::Samples { below, width } => 0.5 * (below.len() - 1) as f64 * width,
        }
    }

    /// Integral from minus infinity to `v` of the share of light that goes no farther than that
    /// integration variable.
    pub(super) fn ramp(&self, v: f64) -> f64 {
        match self {
            Self::Gaussian(sigma) => gaussian_ramp(v, *sigma),
            Self::Samples { below, width } => {
                let last = below.len() - 1;
                let first = -0.5 * last as f64 * width;
                let at = ((v - first) / width).floor().clamp(-1.0, last as f64);
                let k = if at < 0.0 { return 0.0 } else { numbers::whole::<usize>(at) };
                let [sum, moment] = below[k];
                let partly = match below.get(k + 1) {
                    Some(next) => {
                        (next[0] - sum) * sample_ramp(v, first + k as f64 * width, *width)
                    }
                    None => 0.0,
                };
                v * sum - moment + partly
            }
        }
    }

    /// Mean over `low..high` of the share of light from there that lands in the pixel 0..1.
    pub(super) fn landing(&self, low: f64, high: f64) -> f64 {
        (self.landed(high) - self.landed(low)) / (high - low)
    }

    /// Integral of that share up to `x`, but for a constant.
    pub(super) fn landed(&self, x: f64) -> f64 {
        self.ramp(-x) - self.ramp(1.0 - x)
    }
}

fn gaussian_ramp(v: f64, sigma: f64) -> f64 {
    if sigma <= 0.0 {
        return v.max(0.0);
    }
    let t = v / sigma;
    let cumulative = 0.5 * libm::erfc(-t * std::f64::consts::FRAC_1_SQRT_2);
    let density = libm::exp(-0.5 * t * t) / std::f64::consts::TAU.sqrt();
    v * cumulative + sigma * density
}

/// The ramp of light spread evenly over `low..low + width`.
fn sample_ramp(v: f64, low: f64, width: f64) -> f64 {
    let half_square = |v: f64| 0.5 * v.max(0.0) * v.max(0.0);
    (half_square(v - low) - half_square(v - low - width)) / width
}

/// Mean share of light from `from` (interval) that lands in the pixel 0..1 through one sample.
pub(super) fn sample_landing(from: [f64; 2], low: f64, width: f64) -> f64 {
    let landed = |x: f64| sample_ramp(-x, low, width) - sample_ramp(1.0 - x, low, width);
    (landed(from[1]) - landed(from[0])) / (from[1] - from[0])
}

/// Purpose of a kernel.
#[derive(Debug, Clone, Copy)]
pub(super) enum KernelOf {
    Blur,
    Scatter,
}

/// A kernel from a file: samples that sum to 1, and their size in pixels of the detector.
#[derive(Debug, Clone)]
pub(super) struct Measured {
    /// `[row][column]`.
    pub(super) samples: Array2<f64>,
    /// Along x and z.
    pub(super) size: [f64; 2],
}

impl Measured {
    /// Reads a kernel that the scene names.
    pub(super) fn read(scene: &Scene, kernel: &KernelFile, of: KernelOf) -> Result<Self> {
        let path = scene.checked(&kernel.path)?;
        let samples = image::read(&path)?;
        let (key, most) = match of {
            KernelOf::Blur => ("detector.blur.kernel", BLUR),
            KernelOf::Scatter => ("detector.scatter.kernel", SCATTER),
        };
        let refuse = |found: String, allowed: &str| {
            Error::scene(key, format!("{}: {found}", path.display()), allowed)
        };
        for ((row, column), value) in samples.indexed_iter() {
            if !(value.is_finite() && *value >= 0.0) {
                let found = format!("{value} in row {row}, column {column}");
                return Err(refuse(found, "finite values >= 0 (subtract no more than the dark)"));
            }
        }
        let sum = samples.sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return Err(refuse(format!("values that sum to {sum}"), "a sum > 0"));
        }
        let pitch = scene.detector.pitch;
        let size = [0, 1].map(|axis| kernel.pixel[axis] / pitch[axis]);
        let [rows, columns] = [samples.nrows(), samples.ncols()].map(|n| n as f64);
        for extent in [columns * size[0], rows * size[1]] {
            if extent > most {
                let found = format!("a kernel that is {extent:.0} pixels of the detector wide");
                return Err(refuse(found, &format!("up to {most} pixels of the detector")));
            }
        }
        Ok(Self { samples: samples / sum, size })
    }

    /// The kernel summed over the other axis; 0 is x.
    pub(super) fn profile(&self, axis: usize) -> Spread {
        let along = if axis == 0 { 0 } else { 1 };
        let weights = self.samples.sum_axis(ndarray::Axis(along)).to_vec();
        Spread::samples(&weights, self.size[axis])
    }

    /// Weights `[sub-row][sub-column]` of the light around a pixel: `margin` pixels on either
    /// side, `parts` of a pixel, along x and z. Uniform light sums to 1.
    pub(super) fn weights(&self, margin: [u32; 2], parts: [u32; 2]) -> Array2<f64> {
        let along = |axis: usize| {
            let (margin, parts) = (f64::from(margin[axis]), parts[axis]);
            let count = (2.0 * margin + 1.0) * f64::from(parts);
            let samples = self.samples.shape()[1 - axis];
            let width = self.size[axis];
            let first = -0.5 * samples as f64 * width;
            Array2::from_shape_fn((numbers::whole::<usize>(count), samples), |(i, k)| {
                let low = i as f64 / f64::from(parts) - margin;
                let from = [low, low + 1.0 / f64::from(parts)];
                sample_landing(from, first + k as f64 * width, width) / f64::from(parts)
            })
        };
        along(1).dot(&self.samples).dot(&along(0).t())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Middle-point sums in place of closed forms.
    fn brute(density: impl Fn(f64) -> f64, reach: f64, low: f64, high: f64) -> f64 {
        let n = 400;
        let middle = |i: i32, a: f64, b: f64| a + (b - a) * (f64::from(i) + 0.5) / f64::from(n);
        let mut sum = 0.0;
        for i in 0..n {
            let x = middle(i, low, high);
            // The light that lands in 0..1 went from -x to 1 - x.
            let (a, b) = ((-x).max(-reach), (1.0 - x).min(reach));
            if b > a {
                sum += (0..n).map(|j| density(middle(j, a, b))).sum::<f64>() * (b - a);
            }
        }
        sum / f64::from(n) / f64::from(n)
    }

    #[test]
    fn share_that_lands_is_the_double_integral() {
        let sigma = 0.4;
        let gaussian = |v: f64| (-0.5 * v * v / sigma / sigma).exp() / (sigma * 2.506_628_274_631);
        let weights = [0.1, 0.2, 0.5, 0.2];
        let samples = |v: f64| {
            let k = ((v + 0.6) / 0.3).floor();
            if (0.0..4.0).contains(&k) { weights[numbers::whole::<usize>(k)] / 0.3 } else { 0.0 }
        };
        let spread = Spread::samples(&weights, 0.3);
        for (low, high) in [(-0.6, -0.5), (0.0, 0.1), (0.4, 0.65), (0.9, 1.0), (1.2, 1.5)] {
            let got = Spread::Gaussian(sigma).landing(low, high);
            // Middle points of 1/400: errors of the square of that, and jumps for samples.
            assert!((got - brute(gaussian, 2.4, low, high)).abs() < 2e-6);
            assert!((spread.landing(low, high) - brute(samples, 0.6, low, high)).abs() < 2e-3);
        }
    }
}
