//! Profile of light along one axis: a Gaussian of unit area behind up to two boxes, with its derivatives.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// A Gaussian convolved with boxes of unit area; a box of width 0 is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Profile {
    /// Widths of the boxes: the projected aperture, and the pixel or the aperture of the detector mask, m.
    pub(super) boxes: [f64; 2],
    /// Displacement of the middle, m.
    pub(super) shift: f64,
}

impl Profile {
    /// Along a slit: 1 everywhere.
    pub(super) const ENDLESS: Self = Self { boxes: [f64::INFINITY, 0.0], shift: 0.0 };
    /// A Gaussian.
    pub(super) const GAUSSIAN: Self = Self { boxes: [0.0; 2], shift: 0.0 };

    /// True along a slit.
    const fn is_endless(&self) -> bool {
        self.boxes[0].is_infinite()
    }

    /// Half the width of the profile without its Gaussian, from the place that it is displaced from, m.
    pub(super) fn reach(&self) -> f64 {
        self.shift.abs() + (self.boxes[0] + self.boxes[1]) / 2.0
    }

    /// Second moment without the Gaussian, about the place that it is displaced from, m^2.
    pub(super) fn variance(&self) -> f64 {
        if self.is_endless() {
            return 0.0;
        }
        let [a, b] = self.boxes;
        self.shift * self.shift + (a * a + b * b) / 12.0
    }

    /// Corners of the boxes with the signs of their differences, the unit of the sum, and the number of boxes.
    fn corners(&self) -> ([(f64, f64); 4], usize, f64, usize) {
        let [a, b] = self.boxes;
        let none = (0.0, 0.0);
        match (a > 0.0, b > 0.0) {
            (false, false) => ([(0.0, 1.0), none, none, none], 1, 1.0, 0),
            (true, true) => {
                let [base, top] = [(a + b) / 2.0, (a - b) / 2.0];
                ([(base, 1.0), (-base, 1.0), (top, -1.0), (-top, -1.0)], 4, a * b, 2)
            }
            _ => {
                let half = (a + b) / 2.0;
                ([(half, 1.0), (-half, -1.0), none, none], 2, a + b, 1)
            }
        }
    }

    /// Derivatives at `x` for a Gaussian of standard deviation `sigma`: entry n is the n-th derivative times
    /// sigma^n / sqrt(n!), so that all entries are of the size of the first.
    pub(super) fn derivatives(&self, x: f64, sigma: f64, out: &mut [f64]) {
        out.fill(0.0);
        if self.is_endless() {
            out[0] = 1.0;
            return;
        }
        let (corners, count, unit, boxes) = self.corners();
        for (corner, sign) in &corners[..count] {
            let v = x - self.shift + corner;
            let t = v / sigma;
            let density = (-0.5 * t * t).exp() / TAU.sqrt();
            let factor = sign / unit;
            // Integrals of the Gaussian, for derivatives of lower order than there are boxes.
            if boxes > 0 {
                let below = 0.5 * libm::erfc(-t * FRAC_1_SQRT_2);
                match boxes {
                    1 => out[0] += factor * below,
                    _ => {
                        out[0] += factor * v.mul_add(below, sigma * density);
                        if let Some(first) = out.get_mut(1) {
                            *first += factor * sigma * below;
                        }
                    }
                }
            }
            if let Some(out) = out.get_mut(boxes..) {
                add_densities(out, [t, density, factor, sigma], boxes);
            }
        }
    }
}

/// Adds the derivatives of a Gaussian by normalised Hermite polynomials. `out` begins at the order of the
/// Gaussian itself, which is the number of boxes.
fn add_densities(out: &mut [f64], [t, density, factor, sigma]: [f64; 4], boxes: usize) {
    let scale = factor * density * [1.0 / sigma, 1.0, sigma][boxes];
    let (mut before, mut polynomial, mut sign) = (0.0, 1.0, 1.0);
    for (order, value) in out.iter_mut().enumerate() {
        let n = order as f64;
        let norm = match boxes {
            0 => 1.0,
            1 => (n + 1.0).sqrt(),
            _ => ((n + 1.0) * (n + 2.0)).sqrt(),
        };
        *value += sign * scale * polynomial / norm;
        let next = (t * polynomial - n.sqrt() * before) / (n + 1.0).sqrt();
        (before, polynomial, sign) = (polynomial, next, -sign);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each derivative is the slope of the one before it, by central differences: 1e-6 of their size.
    #[test]
    fn derivatives_are_the_slopes_of_the_profile() {
        for boxes in [[0.0, 0.0], [1.3, 0.0], [0.0, 0.7], [1.3, 0.7], [0.9, 0.9]] {
            let profile = Profile { boxes, shift: 0.2 };
            let sigma = 0.6;
            let at = |x: f64| {
                let mut out = [0.0; 8];
                profile.derivatives(x, sigma, &mut out);
                out
            };
            for x in [-2.1, -0.4, 0.0, 0.2, 0.9, 1.7] {
                let h = 1e-5;
                let (above, here, below) = (at(x + h), at(x), at(x - h));
                for n in 0..7 {
                    let slope = (above[n] - below[n]) / (2.0 * h);
                    let scaled = slope * sigma / ((n + 1) as f64).sqrt();
                    assert!((scaled - here[n + 1]).abs() < 1e-6, "{boxes:?} {x} {n}: {scaled}");
                }
            }
        }
    }

    /// Unit area and the variance of boxes and Gaussian, by the trapezoid rule, which is exact here to 1e-9.
    #[test]
    fn profiles_have_unit_area_and_the_sum_of_the_variances() {
        for boxes in [[0.0, 0.0], [1.3, 0.0], [1.3, 0.7]] {
            let profile = Profile { boxes, shift: 0.0 };
            let [mut area, mut second] = [0.0; 2];
            for k in -4000..=4000 {
                let x = f64::from(k) * 2e-3;
                let mut out = [0.0];
                profile.derivatives(x, 0.6, &mut out);
                area += out[0] * 2e-3;
                second += out[0] * x * x * 2e-3;
            }
            let expected = 0.36 + profile.variance();
            assert!((area - 1.0).abs() < 1e-9 && (second - expected).abs() < 1e-8, "{boxes:?}");
        }
    }
}
