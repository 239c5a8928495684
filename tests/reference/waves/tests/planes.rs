//! Sample and mask in two planes.

use super::super::body::{Body, Outline};
use super::super::light::Case;
use super::super::rays;
use super::super::setup::{Setup, Slits, Spot, Window};
use super::bodies::fibre;
use super::{APERTURE, WINDOW, all_close, close, empty, setup};
use crate::waves::field::Grid;
use crate::waves::row::Row;
use rayon::prelude::*;
use rustfft::num_complex::Complex;
use std::f64::consts::PI;

/// Reference set-up with the sample at a distance behind the mask.
fn behind(distance: f64) -> Setup {
    let setup = setup();
    Setup { sample: setup.mask + distance, ..setup }
}

#[test]
fn wedges_displace_curves_by_their_lever() {
    let slits = Slits::one(APERTURE);
    // 5 urad.
    let wedge = Outline::Wedge { low: -2e-4, high: 2e-4, slope: -5.0 };
    let sample = [Body { outline: wedge, delta: 1e-6, mu: 0.0 }];
    for distance in [-0.2, 0.0, 0.012, 0.2] {
        let setup = behind(distance);
        // Before the mask light bends before the mask selects it.
        let lever = if distance < 0.0 {
            setup.sample * (setup.magnification() - 1.0)
        } else {
            setup.analyser - setup.sample
        };
        let flat = empty(&setup, &slits);
        let offsets = [-5e-6, 8e-6];
        let want = flat.curves(Grid::FINE, &[-5e-6 * lever], &offsets).concat();
        let case = Case { sample: &sample, ..flat };
        all_close(&case.curve(Grid::FINE, &offsets), &want, 1e-6);
        if distance >= 0.0 {
            let want = offsets.map(|offset| rays::flat(&flat, -5e-6 * lever, offset));
            all_close(&rays::curve(&case, 1e-4, 32, &offsets), &want, 1e-6);
        }
    }
}

#[test]
fn two_steps_match_diffraction_integrals_in_space_within_1e_5() {
    // Spherical waves in space, without coordinates that grow with the distance.
    let setup = behind(0.1);
    let [to_mask, to_sample, to_analyser] =
        [setup.mask, setup.sample - setup.mask, setup.analyser - setup.sample];
    let phase = |x: f64, distance: f64| PI * x * x / (setup.wavelength * distance);
    let sample = fibre(5e-6, 2.5e-6);
    let [low, high] = sample[0].outline.ends();
    let points = |half: f64, count: i32| {
        let step = 2.0 * half / f64::from(count);
        (0..count).map(move |i| (f64::from(i) + 0.5) * step - half).collect::<Vec<_>>()
    };
    let (mask, plane, screen) =
        (points(0.5 * APERTURE, 4000), points(80e-6, 16_000), points(54e-6, 540));
    let before: Vec<Complex<f64>> = plane
        .par_iter()
        .map(|&x| {
            let from =
                |m: &f64| Complex::from_polar(1.0, phase(*m, to_mask) + phase(x - m, to_sample));
            let light: Complex<f64> = mask.iter().map(from).sum();
            let length = if (low..high).contains(&x) { sample[0].outline.path(x)[0] } else { 0.0 };
            let through = Complex::new(-25.6, -setup.wavenumber() * 4.61e-7) * length;
            light * through.exp()
        })
        .collect();
    let area = setup.wavelength.powi(2) * to_sample * to_analyser;
    let part = |u: &f64| {
        let from = |(x, light): (&f64, &Complex<f64>)| {
            light * Complex::from_polar(1.0, phase(u - x, to_analyser))
        };
        let field: Complex<f64> = plane.iter().zip(&before).map(from).sum();
        rays::seen(&setup, &WINDOW, 0.0, u / setup.magnification()) * field.norm_sqr()
    };
    // Spacings of mask and plane; light is 1 over the square of the growth of a spherical wave.
    let spacings = (5e-9_f64 * 10e-9).powi(2) / area;
    let growth = setup.magnification();
    let want = screen.par_iter().map(part).sum::<f64>() * spacings * growth * 0.2e-6 / 150e-6;
    let slits = Slits::one(APERTURE);
    let case = Case { sample: &sample, ..empty(&setup, &slits) };
    close(case.curve(Grid::FINE, &[0.0])[0], want, 1e-5);
    // The lever of one plane would be 25 % longer.
    let one_plane = Case { setup: &super::setup(), ..case }.curve(Grid::FINE, &[0.0])[0];
    assert!((one_plane - want).abs() > 2e-5, "{one_plane} {want}");
}

#[test]
fn sources_beside_the_axis_see_what_a_moved_set_up_shows() {
    let by = -15e-6;
    let slits = Slits::one(APERTURE);
    let spot = |centre| vec![Spot { weight: 1.0, centre, sigma: 0.0 }];
    let moved = Setup { spot: spot(0.0), ..behind(0.1) };
    let beside = Setup { spot: spot(-by), ..behind(0.1) };
    let sample = [fibre(5e-6, 10e-6), fibre(5e-6 + by, 10e-6)];
    let case = Case { setup: &beside, slits: Some(&slits), sample: &sample[0], window: WINDOW };
    let got = case.by_source_points(Grid::FINE, &[0.0], &[6e-6], 1).concat();
    let case = Case { setup: &moved, sample: &sample[1], ..case };
    all_close(&got, &case.curves(Grid::FINE, &[by], &[6e-6 + by]).concat(), 1e-6);
}

#[test]
fn points_of_the_spot_add_to_its_blur() {
    let slits = Slits::periodic(APERTURE, 100e-6, 1).leaking(1e-3, 0.4);
    let grid = Grid { count: 1 << 15, spacing: 10e-9, repeats: false };
    let sample = fibre(5e-6, 10e-6);
    let window = Window { leak: 0.01, ..WINDOW };
    let at = |distance| {
        let mut setup = behind(distance);
        setup.spot[0].centre = 4e-6;
        let case = Case { setup: &setup, slits: Some(&slits), sample: &sample, window };
        let by_points = case.by_source_points(grid, &[0.0], &[6e-6], 161)[0][0];
        by_points - case.curve(grid, &[6e-6])[0]
    };
    close(at(0.0), 0.0, 2e-6);
    // Seen from the centre of this spot the sample is 40 nm beside.
    let apart = at(0.012).abs();
    assert!(apart > 2e-5 && apart < 2e-4, "{apart:e}");
}

#[test]
fn rows_repeat_their_pixels_and_shift_with_the_sample() {
    let setup = behind(0.012);
    let row =
        Row { columns: 4, window: WINDOW, aperture: Some(APERTURE), period: 100e-6, leak: 0.0 };
    let offsets = [-10e-6, 0.0, 10e-6];
    let flat = row.light(&setup, &[], 10e-9, &offsets, None);
    for light in &flat {
        all_close(light, &[light[0]; 4], 1e-5);
    }
    // A fibre behind the third opening, then behind the second.
    let seen = [50e-6, -50e-6].map(|x| {
        let sample = fibre(setup.in_sample(x + 4e-6, 0.0), 10e-6);
        row.light(&setup, &sample, 10e-9, &offsets, None)
    });
    for (light, flat) in seen[0].iter().zip(&flat) {
        close(light[3] - flat[3], 0.0, 1e-5);
        assert!((light[2] - flat[2]).abs() > 1e-4, "{light:?} {flat:?}");
    }
    for (a, b) in seen[0].iter().zip(&seen[1]) {
        all_close(&a[2..3], &b[1..2], 1e-5);
    }
}

#[test]
fn rows_without_masks_spread_light_and_keep_its_sum() {
    let setup = Setup { sample: 1.2, ..Setup::new(30.0, [0.3, 1.5], 1e-6) };
    let row =
        Row { columns: 24, window: Window::open(3e-6), aperture: None, period: 1.0, leak: 0.0 };
    let fibre = [Body { mu: 0.0, ..fibre(0.0, 8e-6)[0] }];
    let light = row.light(&setup, &fibre, 4e-9, &[0.0], None).concat();
    close(light.iter().sum::<f64>(), 24.0, 1e-3);
    // A diverging lens: dark in the middle, bright beside both rims at the same places.
    let reversed: Vec<f64> = light.iter().rev().copied().collect();
    all_close(&light, &reversed, 1e-6);
    assert!(light[11] < 0.95 && light[6] > 1.04, "{light:?}");
}
