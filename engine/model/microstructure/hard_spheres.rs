//! Structure factor of hard spheres of one size in equilibrium (docs/physics.md, "Microstructure").
//!
//! The closed form of Percus and Yevick for a diameter and fraction that Verlet and Weis (Phys. Rev. A 5, 939) reduce,
//! without its pairs nearer than a diameter, and with their short-range term, which gives pairs in contact the number
//! of Carnahan and Starling.

/// Argument below which the closed form cancels and a series takes its place.
const SMALL: f64 = 0.2;
/// Points of the shell between the reduced diameter and the diameter, a hundredth of it.
const SHELL: [(f64, f64); 3] = [
    (0.112_701_665_379_258_31, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

/// Structure factor of hard spheres by Percus and Yevick. `x`: wavenumber times the diameter; `fraction` of the volume.
pub(super) fn percus_yevick(x: f64, fraction: f64) -> f64 {
    let rest = (1.0 - fraction).powi(4);
    let alpha = (1.0 + 2.0 * fraction).powi(2) / rest;
    let beta = -6.0 * fraction * (1.0 + 0.5 * fraction).powi(2) / rest;
    let gamma = 0.5 * fraction * alpha;
    let square = x * x;
    // ∫ t² (α + βt + γt³) sin(xt)/(xt) dt from 0 to 1.
    let direct = if x.abs() < SMALL {
        let moment = |power: f64| {
            1.0 / power - square / (6.0 * (power + 2.0)) + square * square / (120.0 * (power + 4.0))
        };
        alpha * moment(3.0) + beta * moment(4.0) + gamma * moment(6.0)
    } else {
        let (sine, cosine) = (libm::sin(x), libm::cos(x));
        let cube = square * x;
        alpha * (sine - x * cosine) / cube
            + beta * (2.0 * x * sine + (2.0 - square) * cosine - 2.0) / (square * square)
            + gamma
                * (4.0 * ((3.0 * square - 6.0) * cosine + (cube - 6.0 * x) * sine + 6.0)
                    - square * square * cosine)
                / (cube * cube)
    };
    1.0 / (1.0 + 24.0 * fraction * direct)
}

/// Correction of Verlet and Weis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HardSpheres {
    fraction: f64,
    /// Reduced fraction, and reduced diameter over the diameter.
    reduced: f64,
    ratio: f64,
    /// Short-range term of the pair distribution, A exp(−m(r − 1)) cos(m(r − 1))/r.
    amplitude: f64,
    rate: f64,
}

impl HardSpheres {
    pub(super) fn new(fraction: f64) -> Self {
        let reduced = fraction - fraction * fraction / 16.0;
        let amplitude = 0.75 * reduced.powi(2) * (1.0 - 0.7117 * reduced - 0.114 * reduced.powi(2))
            / (1.0 - reduced).powi(4);
        let rate = 24.0 * amplitude / (reduced * percus_yevick_contact(reduced));
        let ratio = libm::cbrt(reduced / fraction);
        Self { fraction, reduced, ratio, amplitude, rate }
    }

    /// Pair distribution of Percus and Yevick at a distance near the reduced diameter, in reduced diameters.
    fn near_contact(&self, distance: f64) -> f64 {
        let f = self.reduced;
        let slope = -4.5 * f * (1.0 + f) / (1.0 - f).powi(3);
        percus_yevick_contact(f) + slope * (distance - 1.0)
    }

    /// Pair distribution at contact.
    #[cfg(test)]
    fn contact(&self) -> f64 {
        self.near_contact(1.0 / self.ratio) + self.amplitude
    }

    /// Structure factor. `x`: wavenumber times the diameter.
    pub(super) fn structure_factor(&self, x: f64) -> f64 {
        let x = x.max(1e-6);
        let pairs = 24.0 * self.fraction / x;
        // ∫ exp(−my) cos(my) exp(ixy) dy = ½ [1/(m − i(x + m)) + 1/(m − i(x − m))], y from 0, times exp(ix).
        let (sine, cosine) = (libm::sin(x), libm::cos(x));
        let m = self.rate;
        let (sum, difference) = (x + m, x - m);
        let (a, b) = (m * m + sum * sum, m * m + difference * difference);
        let real = 0.5 * (m / a + m / b);
        let imaginary = 0.5 * (sum / a + difference / b);
        let short = self.amplitude * (real * sine + imaginary * cosine);
        let width = 1.0 - self.ratio;
        let shell: f64 = SHELL
            .iter()
            .map(|(at, weight)| {
                let distance = self.ratio + width * at;
                weight
                    * distance
                    * self.near_contact(distance / self.ratio)
                    * libm::sin(x * distance)
            })
            .sum();
        percus_yevick(x * self.ratio, self.reduced) + pairs * (short - width * shell)
    }
}

fn percus_yevick_contact(fraction: f64) -> f64 {
    (1.0 + 0.5 * fraction) / (1.0 - fraction).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// S(0) = (1 − f)⁴/(1 + 2f)², and the series joins the closed form.
    #[test]
    fn percus_yevick_has_its_compressibility_and_no_step() {
        for fraction in [0.01, 0.1, 0.3, 0.5_f64] {
            let expected = (1.0 - fraction).powi(4) / (1.0 + 2.0 * fraction).powi(2);
            assert!((percus_yevick(1e-4, fraction) / expected - 1.0).abs() < 1e-7);
            let [low, high] = [SMALL * (1.0 - 1e-9), SMALL * (1.0 + 1e-9)];
            let step = percus_yevick(high, fraction) - percus_yevick(low, fraction);
            assert!(step.abs() < 1e-8, "{fraction}: {step:e}");
        }
    }

    /// Direct correlation function of Percus and Yevick, −(α + βr + γr³) inside a diameter, by 10⁵ midpoints.
    #[test]
    fn percus_yevick_is_the_transform_of_its_correlation_function() {
        for (x, fraction) in [(0.7, 0.1), (3.0, 0.3), (6.5, 0.5), (20.0, 0.5_f64)] {
            let rest = (1.0 - fraction).powi(4);
            let alpha = (1.0 + 2.0 * fraction).powi(2) / rest;
            let beta = -6.0 * fraction * (1.0 + 0.5 * fraction).powi(2) / rest;
            let sum: f64 = (0..100_000)
                .map(|i| {
                    let t = (f64::from(i) + 0.5) * 1e-5;
                    let c = -(alpha + beta * t + 0.5 * fraction * alpha * t.powi(3));
                    c * t * libm::sin(x * t) / x * 1e-5
                })
                .sum();
            // Number per cubed diameter 6f/π times 4π.
            let expected = 1.0 / (1.0 - 24.0 * fraction * sum);
            assert!((percus_yevick(x, fraction) / expected - 1.0).abs() < 1e-6, "{x}");
        }
    }

    /// Equation of state of Carnahan and Starling: number of pairs in contact, and compressibility.
    #[test]
    fn corrected_spheres_have_the_contacts_and_compressibility_of_carnahan_and_starling() {
        for f in [0.05, 0.1, 0.2, 0.3, 0.4, 0.5_f64] {
            let spheres = HardSpheres::new(f);
            let contact = (1.0 - 0.5 * f) / (1.0 - f).powi(3);
            assert!((spheres.contact() / contact - 1.0).abs() < 3e-3, "{f}: {}", spheres.contact());
            let compressibility =
                (1.0 - f).powi(4) / ((1.0 + 2.0 * f).powi(2) + f.powi(3) * (f - 4.0));
            let found = spheres.structure_factor(1e-3);
            assert!((found - compressibility).abs() < 2.5e-3, "{f}: {found} {compressibility}");
        }
    }

    /// No pair is nearer than a diameter: ∫ (S − 1) x sin(xr) dx = −2π² r · 6f/π / … inside, by a damped sum.
    #[test]
    fn corrected_spheres_do_not_overlap() {
        for fraction in [0.1, 0.3, 0.5] {
            let spheres = HardSpheres::new(fraction);
            for distance in [0.5, 0.8] {
                // g − 1 by the transform of S − 1, damped by a Gaussian of width 0.05 in distance.
                let step = 0.01;
                let sum: f64 = (1..20_000)
                    .map(|i| {
                        let x = step * f64::from(i);
                        let damped = libm::exp(-0.5 * (0.05 * x).powi(2));
                        (spheres.structure_factor(x) - 1.0) * damped * x * libm::sin(x * distance)
                    })
                    .sum();
                let number = 6.0 * fraction / PI;
                let g = 1.0 + sum * step / (2.0 * PI * PI * number * distance);
                assert!(g.abs() < 0.02, "{fraction} at {distance}: {g}");
            }
        }
    }
}
