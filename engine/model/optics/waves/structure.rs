//! Structure functions of round bodies: loss of interference between light a shear apart.

use super::quadrature;
use glam::DVec2;
use std::f64::consts::PI;

/// Step of the integral of K₁, whose error at this step is below 1e-15.
const BESSEL_STEP: f64 = 0.1;
/// Exponent beyond which e^{−x} adds nothing.
const NOTHING: f64 = 745.0;
/// Points of each piece of a quadrature without phase, more per radian, and most: there a body is smooth over
/// the shear.
const POINTS: f64 = 80.0;
const POINTS_PER_RADIAN: f64 = 2.0;
const MOST_POINTS: f64 = 20_000.0;
/// Sections through a half of a sphere.
const SECTIONS: usize = 48;

/// Form of a round body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Cylinder across the beam and the slits' normal, long along the slits.
    Cylinder,
    /// Sphere.
    Sphere,
}

/// D by waves: ∫ [1 − cos(φ(x − Λ/2) − φ(x + Λ/2))] over x, m, for a cylinder; over x and z, m², for a
/// sphere. `phase`: 2kΔδ, phase per metre of half the chord, rad/m; `shear`: Λ, m.
pub(crate) fn structure_by_waves(form: Form, radius: f64, phase: f64, shear: f64) -> f64 {
    match form {
        Form::Cylinder => cylinder(radius, phase, shear),
        Form::Sphere => {
            // A section at height z is a cylinder of the radius ρ = √(r² − z²).
            let section = |z: f64| {
                DVec2::new(cylinder((radius * radius - z * z).max(0.0).sqrt(), phase, shear), 0.0)
            };
            2.0 * quadrature::between([0.0, radius], SECTIONS, section).x
        }
    }
}

/// D by rays: the same with Λφ'(x) in place of the difference.
pub(crate) fn structure_by_rays(form: Form, radius: f64, phase: f64, shear: f64) -> f64 {
    let lost = 1.0 - times_bessel(phase.abs() * shear.abs());
    match form {
        Form::Cylinder => 2.0 * radius * lost,
        Form::Sphere => PI * radius * radius * lost,
    }
}

fn cylinder(radius: f64, phase: f64, shear: f64) -> f64 {
    let half = 0.5 * shear.abs();
    if half <= 0.0 || radius <= 0.0 {
        return 0.0;
    }
    let chord = |x: f64| phase * (radius * radius - x * x).max(0.0).sqrt();
    // 1 − cos d without cancellation.
    let lost = |x: f64| {
        let sine = libm::sin(0.5 * (chord(x - half) - chord(x + half)));
        DVec2::new(2.0 * sine * sine, 0.0)
    };
    // Largest difference of the phase, at a rim.
    let largest = phase.abs() * (4.0 * radius * half.min(radius)).sqrt();
    let points = POINTS + POINTS_PER_RADIAN * largest;
    let points = beamlet_core::numbers::whole::<usize>(points.min(MOST_POINTS));
    2.0 * quadrature::pieces([0.0, radius + half], &[(radius - half).abs()], points, lost).x
}

/// A K₁(A), K₁ the modified Bessel function: ∫ A cosh t e^{−A cosh t} dt over t > 0.
fn times_bessel(a: f64) -> f64 {
    if a <= 0.0 {
        return 1.0;
    }
    let value = |t: f64| {
        let exponent = a * libm::cosh(t);
        exponent * libm::exp(-exponent)
    };
    let last = libm::acosh((NOTHING / a).max(1.0));
    let steps = beamlet_core::numbers::whole::<u32>((last / BESSEL_STEP).ceil());
    let sum: f64 = (1..=steps).map(|step| value(BESSEL_STEP * f64::from(step))).sum();
    BESSEL_STEP * (0.5 * value(0.0) + sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// K₁ of tables (Abramowitz and Stegun, 9.8).
    #[test]
    fn bessel_function_matches_tables() {
        for (a, value) in [(0.1, 9.853_844_780_870_606), (1.0, 0.601_907_230_197_234_6)] {
            assert!((times_bessel(a) / (a * value) - 1.0).abs() < 1e-13, "{a}");
        }
        assert!((times_bessel(5.0) / (5.0 * 0.004_044_613_445_452_164) - 1.0).abs() < 1e-13);
    }

    /// 1 − A K₁(A) = ∫ [1 − cos(Av)] (1 + v²)^{−3/2} dv over v > 0, by 10⁶ midpoints of v = tan t.
    #[test]
    fn rays_match_the_integral_over_slopes_within_1e_6() {
        for a in [0.01, 0.3, 2.0] {
            let step = 0.5 * PI / 1e6;
            let term = |i: u32| {
                let t = step * (f64::from(i) + 0.5);
                (1.0 - libm::cos(a * libm::tan(t))) * libm::cos(t)
            };
            let sum = step * (0..1_000_000).map(term).sum::<f64>();
            let found = structure_by_rays(Form::Cylinder, 0.5, a, 1.0);
            assert!((found / sum - 1.0).abs() < 1e-6, "{a}: {found} {sum}");
            let sphere = structure_by_rays(Form::Sphere, 0.5, a, 1.0);
            assert!((sphere / (0.25 * PI * sum) - 1.0).abs() < 1e-6, "{a}");
        }
    }

    /// Waves by 10⁶ midpoints of x without any substitution.
    #[test]
    fn waves_match_plain_sums_within_1e_5() {
        for (radius, phase, shear) in
            [(0.25, 0.14, 0.29), (2.5, 0.14, 0.29), (0.1, 9.0, 0.5), (150.0, 0.14, 0.29)]
        {
            let chord = |x: f64| phase * f64::max(radius * radius - x * x, 0.0).sqrt();
            let reach = radius + 0.5 * shear;
            let step = 2.0 * reach / 1e6;
            let term = |i: u32| {
                let x = step * (f64::from(i) + 0.5) - reach;
                1.0 - libm::cos(chord(x - 0.5 * shear) - chord(x + 0.5 * shear))
            };
            let sum = step * (0..1_000_000).map(term).sum::<f64>();
            let found = structure_by_waves(Form::Cylinder, radius, phase, shear);
            assert!((found / sum - 1.0).abs() < 1e-5, "{radius}: {found} {sum}");
        }
    }

    /// At fixed δ the phase grows as 1/λ and the shear as λ.
    #[test]
    fn waves_of_short_wavelengths_are_rays() {
        let ratio = |form, factor: f64| {
            let [phase, shear] = [1.4e5 / factor, 0.29e-6 * factor];
            structure_by_waves(form, 2.5e-6, phase, shear)
                / structure_by_rays(form, 2.5e-6, phase, shear)
        };
        for form in [Form::Cylinder, Form::Sphere] {
            let errors = [1.0, 0.1, 1e-3, 1e-5].map(|factor| (1.0 - ratio(form, factor)).abs());
            assert!(errors[1] < 0.5 * errors[0] && errors[2] < 0.05, "{errors:?}");
            assert!(errors[3] < 1e-3, "{errors:?}");
        }
    }
}
