//! Edges and slits by Fresnel integrals.

use super::super::fresnel::{integral, slit};
use super::super::rays;
use super::{APERTURE, WINDOW, all_close, close, empty, setup};
use crate::waves::field::Grid;
use crate::waves::setup::Slits;
use rustfft::num_complex::Complex;

#[test]
fn light_at_an_edge_is_a_quarter_and_1_3704_at_its_maximum() {
    let intensity = |v: f64| slit(v / 2f64.sqrt(), [0.0, f64::INFINITY], 1.0).norm_sqr();
    close(intensity(0.0), 0.25, 1e-9);
    // Maximum and first minimum of Cornu's spiral.
    close(intensity(1.217_152), 1.370_443, 1e-6);
    close(intensity(1.872_523), 0.778_257, 1e-5);
}

#[test]
fn fresnel_integrals_match_the_sum_over_a_slit_within_1e_6() {
    let (ends, area) = ([-10e-6, 10e-6], 1.653e-11);
    for x in [0.0, 4e-6, 9.7e-6, 14e-6] {
        let by_sum = integral(x, ends, area, 20_000, |_| Complex::ONE);
        close((by_sum - slit(x, ends, area)).norm(), 0.0, 1e-6);
    }
}

/// Light of a window: the intensity of a slit times the share of the spot that the window sees.
fn by_integrals(ends: [f64; 2], offsets: &[f64]) -> Vec<f64> {
    let setup = setup();
    let area = setup.wavelength * setup.effective(setup.sample, setup.analyser);
    let light = |offset: &f64| {
        // The window sees no light from beyond 6.1 deviations of the projected spot.
        let (reach, count) = (36e-6, 3600);
        let step = 2.0 * reach / f64::from(count);
        let part = |i| {
            let x = (f64::from(i) + 0.5) * step - reach;
            let seen = rays::seen(&setup, &WINDOW, 0.0, x);
            seen * slit(x, ends.map(|end| end + offset), area).norm_sqr()
        };
        (0..count).map(part).sum::<f64>() * step / (WINDOW.pixel / setup.magnification())
    };
    offsets.iter().map(light).collect()
}

#[test]
fn slits_and_edges_by_fft_match_fresnel_integrals_within_1e_6() {
    let setup = setup();
    let offsets = [0.0, 20e-6];
    // The second has one edge in view.
    for ends in [[-0.5 * APERTURE, 0.5 * APERTURE], [0.0, 150e-6]] {
        let slits = Slits { openings: vec![ends], bars: Complex::ZERO };
        let by_fft = empty(&setup, &slits).curve(Grid::FINE, &offsets);
        all_close(&by_fft, &by_integrals(ends, &offsets), 1e-6);
    }
}
