//! Single bodies in the plane of the mask.

use super::super::body::{Body, Outline, bodies};
use super::super::fresnel::integral;
use super::super::light::Case;
use super::super::rays;
use super::super::setup::{Setup, Slits, Window};
use super::{APERTURE, SIGMA_PER_FWHM, WINDOW, all_close, close, empty, setup};
use crate::waves::field::Grid;
use rustfft::num_complex::Complex;

/// Carbon fibre at 30 keV.
pub(super) fn fibre(centre: f64, radius: f64) -> [Body; 1] {
    [Body { outline: Outline::Cylinder { centre, radius }, delta: 4.61e-7, mu: 51.2 }]
}

#[test]
fn light_behind_a_fibre_matches_the_diffraction_integral_within_2e_6() {
    let (setup, slits, radius) = (setup(), Slits::one(APERTURE), 2.5e-6);
    let area = setup.wavelength * setup.effective(setup.sample, setup.analyser);
    for centre in [0.0, 3e-6, 9e-6] {
        let through = |x: f64| {
            let half = (radius * radius - (x - centre).powi(2)).max(0.0).sqrt();
            let phase = 2.0 * setup.wavenumber() * 4.61e-7 * half;
            Complex::from_polar((-51.2 * half).exp(), -phase)
        };
        // The window sees no light from beyond 6.1 deviations of the projected spot.
        let (reach, count) = (36e-6, 1800);
        let step = 2.0 * reach / f64::from(count);
        let part = |i| {
            let x = (f64::from(i) + 0.5) * step - reach;
            let field = integral(x, slits.openings[0], area, 4000, through);
            rays::seen(&setup, &WINDOW, 0.0, x) * field.norm_sqr()
        };
        let want = (0..count).map(part).sum::<f64>() * step / 100e-6;
        let sample = fibre(centre, radius);
        let case = Case { sample: &sample, ..empty(&setup, &slits) };
        close(case.curve(Grid::FINE, &[0.0])[0], want, 2e-6);
    }
}

#[test]
fn rays_behind_a_fibre_match_uniform_rays() {
    let (setup, slits, radius) = (setup(), Slits::one(APERTURE), 2.5e-6);
    for centre in [0.0, 7e-6, 12e-6] {
        let sample = fibre(centre, radius);
        let case = Case { sample: &sample, ..empty(&setup, &slits) };
        let [coarse, fine] = [64, 128].map(|count| rays::curve(&case, 1e-4, count, &[0.0])[0]);
        close(coarse, fine, 3e-7);
        // A line of uniform rays omits bent light of the rims: its error falls as the root of the
        // spacing, 0.1 nm here.
        let count = 200_000;
        let step = APERTURE / f64::from(count);
        let part = |i| {
            let x = (f64::from(i) + 0.5) * step - 0.5 * APERTURE;
            let from = x - centre;
            let half = (radius * radius - from * from).max(0.0).sqrt();
            let angle = if half > 0.0 { 2.0 * 4.61e-7 * from / half } else { 0.0 };
            rays::seen(&setup, &WINDOW, 0.0, x + 0.4 * angle) * (-2.0 * 51.2 * half).exp()
        };
        close(fine, (0..count).map(part).sum::<f64>() * step / 100e-6, 1e-6);
    }
}

#[test]
fn wire_of_another_group_has_its_ten_values_within_3e_4() {
    // Normalized light at the place of the aperture from the axis, by waves and by rays.
    let want = [
        (-150.0, 0.7500, 0.7688),
        (-145.0, 0.7188, 0.7235),
        (-140.0, 0.7941, 0.7935),
        (-100.0, 0.8935, 0.8931),
        (0.0, 0.9381, 0.9381),
        (100.0, 1.0122, 1.0126),
        (140.0, 1.1453, 1.1459),
        (145.0, 1.1690, 1.1725),
        (150.0, 1.2162, 1.1966),
        (155.0, 1.0849, 1.0711),
    ];
    let setup = Setup::new(21.0, [1.6, 0.4], 70e-6 * SIGMA_PER_FWHM);
    let slits = Slits::one(12e-6);
    // The openings of both masks are half a detector opening apart.
    let centre = [10e-6];
    let window = Window::masked(20e-6, 50e-6);
    let flat = Case { setup: &setup, slits: Some(&slits), sample: &[], window };
    let open = [flat.curves(Grid::FINE, &centre, &[0.0])[0][0], rays::flat(&flat, centre[0], 0.0)];
    for (x, by_waves, by_rays) in want {
        let wire = Outline::Cylinder { centre: -x * 1e-6, radius: 150e-6 };
        let sample = bodies(&[wire], 1e-6, 2.0 * setup.wavenumber() * 1e-9);
        let case = Case { sample: &sample, ..flat };
        let seen = [
            case.curves(Grid::FINE, &centre, &[0.0])[0][0] / open[0],
            rays::curves(&case, 1e-4, 64, &centre, &[0.0])[0][0] / open[1],
        ];
        all_close(&seen, &[by_waves, by_rays], 3e-4);
    }
}

#[test]
fn waves_become_rays_as_the_root_of_the_wavelength() {
    let slits = Slits::one(APERTURE);
    let sample = fibre(4e-6, 10e-6);
    let error = |kev: f64| {
        let setup = Setup::new(kev, [1.2, 0.6], 30e-6 * SIGMA_PER_FWHM);
        let flat = empty(&setup, &slits);
        let case = Case { sample: &sample, ..flat };
        let effect = |case: &Case<'_>| case.curve(Grid::FINE, &[5e-6])[0];
        let by_rays = |case: &Case<'_>| rays::curve(case, 1e-4, 64, &[5e-6])[0];
        (effect(&case) - effect(&flat) - by_rays(&case) + by_rays(&flat)).abs()
    };
    // Light of rays nearer to a rim than a shear, where slopes grow as d^(-1/2).
    let errors = [30.0, 300.0].map(error);
    close(errors[1] / errors[0], 0.1f64.sqrt(), 0.05);
    close(errors[0], 1e-4, 2e-5);
}
