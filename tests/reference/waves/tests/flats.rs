//! Flat curves: excess of waves over rays.

use super::super::light::Case;
use super::super::rays;
use super::super::setup::{Setup, Slits, Spot, Window};
use super::{APERTURE, SIGMA_PER_FWHM, WINDOW, all_close, close, empty, excess, setup};
use crate::waves::field::Grid;
use std::f64::consts::PI;

/// Offsets of the mask, m.
const OFFSETS: [f64; 4] = [0.0, 20e-6 / 3.0, 40e-6 / 3.0, 20e-6];

#[test]
fn flats_of_one_aperture_exceed_rays_by_the_values_of_other_programs_within_6e_6() {
    let (setup, slits) = (setup(), Slits::one(APERTURE));
    let got = excess(&empty(&setup, &slits), Grid::FINE, &OFFSETS);
    // The values have one decimal of 1e-4.
    all_close(&got, &[-5.3e-4, -4.9e-4, -8.7e-4, -0.6e-4], 6e-6);
    let got = excess(&empty(&setup, &slits), Grid::FINE, &[0.0, 5e-6, 10e-6, 15e-6, 25e-6, 30e-6]);
    // Two decimals; spacing changes the last by 3.
    all_close(&got, &[-5.31e-4, -4.68e-4, -6.63e-4, -8.74e-4, 6.44e-4, 4.36e-4], 1e-6);
}

/// Light of one thin opaque aperture: its transform is sin(πf(a₁ − Λ))/(πf), Λ = λzf.
fn by_frequencies(setup: &Setup, aperture: f64, window: Window, offset: f64) -> f64 {
    let area = setup.wavelength * setup.effective(setup.sample, setup.analyser);
    let m = setup.magnification();
    let (blur, opening) = (setup.spot[0].sigma * setup.source_shift(), window.aperture / m);
    // The spot blurs f = 1.2/σ to e^-28.
    let step = 50.0;
    let count = (1.2 / blur.abs() / step) as i32;
    let term = |i| {
        let f = (f64::from(i) + 0.5) * step;
        // No pair of points of the aperture is farther apart.
        let light = (PI * f * (aperture - area * f).max(0.0)).sin() / (PI * f);
        let seen = (PI * f * opening).sin() / (PI * f);
        let blurred = (-2.0 * (PI * f * blur).powi(2)).exp();
        2.0 * light * seen * blurred * (2.0 * PI * f * offset).cos()
    };
    (0..count).map(term).sum::<f64>() * step / (window.pixel / m)
}

#[test]
fn flats_of_one_aperture_match_the_integral_over_frequencies_within_1e_6() {
    let (setup, slits) = (setup(), Slits::one(APERTURE));
    let offsets = [0.0, 7e-6, 14e-6, 20e-6, 28e-6];
    let got = empty(&setup, &slits).curve(Grid::FINE, &offsets);
    all_close(&got, &offsets.map(|f| by_frequencies(&setup, APERTURE, WINDOW, f)), 1e-6);
}

#[test]
fn flats_of_periodic_masks_exceed_rays_by_the_values_of_other_programs() {
    let setup = setup();
    // Seven openings in the grid of 655 um.
    let slits = Slits::periodic(APERTURE, 100e-6, 4);
    let got = excess(&empty(&setup, &slits), Grid::FINE, &OFFSETS);
    all_close(&got, &[-4.8e-4, -4.4e-4, -8.2e-4, -0.1e-4], 6e-6);
    // Without end; the openings beyond add 0.9e-5.
    let slits = Slits::periodic(APERTURE, 100e-6, 0);
    let endless = Grid { count: 20_000, spacing: 5e-9, repeats: true };
    let all = excess(&empty(&setup, &slits), endless, &OFFSETS);
    all_close(&all, &got, 1.1e-5);
    assert!(all.iter().zip(&got).all(|(all, seven)| *all > seven + 4e-6), "{all:?} {got:?}");
}

#[test]
fn pixels_without_a_mask_see_all_light_of_a_periodic_mask() {
    let setup = setup();
    let slits = Slits::periodic(APERTURE, 100e-6, 0).leaking(0.01, 0.7);
    let window = Window::open(150e-6);
    let case = Case { setup: &setup, slits: Some(&slits), sample: &[], window };
    let endless = Grid { count: 20_000, spacing: 5e-9, repeats: true };
    all_close(&case.curve(endless, &[0.0, 13e-6]), &[0.2 + 0.8 * 0.01; 2], 1e-9);
}

#[test]
fn excess_of_flats_is_of_first_order_in_the_wavelength() {
    let slits = Slits::one(APERTURE);
    let at = |kev: f64| {
        let setup = Setup::new(kev, [1.2, 0.6], 30e-6 * SIGMA_PER_FWHM);
        excess(&empty(&setup, &slits), Grid::FINE, &[15e-6])[0] * kev
    };
    // Light that edges throw beyond 5 nm of the grid is 1e-6 of the open beam, 2 % at 300 keV.
    close(at(300.0) / at(100.0), 1.0, 0.02);
}

#[test]
fn flats_of_a_spot_of_5_um_differ_from_rays_by_5_percent_of_the_peak() {
    let setup = Setup::new(20.0, [0.5, 0.5], 5e-6 * SIGMA_PER_FWHM);
    let blur = setup.spot[0].sigma * setup.source_shift().abs();
    let fringe = (setup.wavelength * setup.effective(setup.mask, setup.analyser)).sqrt();
    close(blur / fringe, 0.27, 0.005);
    // The difference depends on the apertures: these have the largest.
    let (slits, window) = (Slits::one(15e-6), Window::masked(20e-6, 62e-6));
    let case = Case { setup: &setup, slits: Some(&slits), sample: &[], window };
    let got = case.curve(Grid::FINE, &[0.0, 5e-6, 12e-6]);
    let want = [0.0, 5e-6, 12e-6].map(|f| by_frequencies(&setup, 15e-6, window, f));
    all_close(&got, &want, 3e-6);
    close(got[0] / rays::flat(&case, 0.0, 0.0) - 1.0, 0.054, 0.001);
}

#[test]
fn leaking_bars_interfere_with_their_opening() {
    let setup = setup();
    let window = Window { leak: 0.02, ..WINDOW };
    let endless = Grid { count: 20_000, spacing: 5e-9, repeats: true };
    let at = |leak: f64, phase: f64| {
        let slits = Slits::periodic(APERTURE, 100e-6, 0).leaking(leak, phase);
        let case = Case { setup: &setup, slits: Some(&slits), sample: &[], window };
        case.curve(endless, &[4e-6, 15e-6, 20e-6])
    };
    for leak in [1e-4, 1e-2] {
        let turns: [Vec<f64>; 4] = std::array::from_fn(|turn| at(leak, 0.5 * PI * turn as f64));
        // Shear of 0.29 um in a pixel of 100 um, at most.
        let most = 2.0 * leak.sqrt() * 0.29e-6 / 100e-6;
        let range: Vec<f64> = (0..3).map(|i| 0.5 * (turns[0][i] - turns[2][i]).abs()).collect();
        let largest = range.iter().copied().fold(0.0, f64::max);
        assert!(largest < most && largest > 0.2 * most, "{range:?}, at most {most:e}");
        // Amplitudes are linear: opposite phases add to the same light.
        let sum = |k: usize| (0..3).map(|i| turns[k][i] + turns[k + 2][i]).collect::<Vec<_>>();
        all_close(&sum(0), &sum(1), 1e-12);
    }
}

#[test]
fn rays_of_leaking_masks_and_two_spots_match_their_integral_within_1e_6() {
    let mut setup = setup();
    setup.spot = vec![
        Spot { weight: 0.7, centre: -6e-6, sigma: 12e-6 },
        Spot { weight: 0.3, centre: 20e-6, sigma: 5e-6 },
    ];
    let slits = Slits::periodic(APERTURE, 100e-6, 2).leaking(0.03, 0.0);
    let window = Window { leak: 0.02, ..WINDOW };
    let case = Case { setup: &setup, slits: Some(&slits), sample: &[], window };
    let offsets = [0.0, 9e-6, 30e-6];
    let got = rays::curve(&case, 2e-4, 32, &offsets);
    all_close(&got, &offsets.map(|offset| rays::flat(&case, 0.0, offset)), 1e-6);
    // Waves differ by 9e-4 for opaque bars, and by 1e-3 by interference.
    all_close(&case.curve(Grid::FINE, &offsets), &got, 2e-3);
}
