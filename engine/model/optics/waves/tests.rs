//! Light by waves against figures of independent programs, and limits.

use super::flat::Flat;
use super::*;
use crate::optics::{Optics, ThinCurve};
use crate::scene::Scene;

/// The reference set-up with thin opaque masks and a pixel of the pitch `pitch` (um); `sample_mask`: keys of
/// the sample mask.
fn reference(pitch: u32, sample_mask: &str) -> Optics {
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [9, 1]\npitch = \"{pitch} um\"\n\
         [sample_mask]\ntransmission = 0.0\ndistance = \"1.2 m\"\naperture = \"20 um\"\n{sample_mask}\n\
         [detector_mask]\ntransmission = 0.0\ndistance = \"1.8 m\"\naperture = \"30 um\"\n\
         [scan]\nmask_offsets = [\"0 um\"]\n"
    );
    Optics::of(&Scene::from_toml(&text, ".").expect("a scene"))
}

/// The pixel with most light at rest, and bodies in the plane of the mask.
fn brightest(optics: &Optics) -> Pixel {
    let light = |pixel: &Pixel| Flat::of(pixel, 0.0, [0.0; 2]).light.at(0.0);
    let mask = optics.sample_mask.as_ref().expect("a sample mask");
    let pixels = Pixel::around_axis(optics, mask.distance());
    pixels.into_iter().max_by(|a, b| light(a).total_cmp(&light(b))).expect("a pixel")
}

/// Waves less rays at offsets (um), 1e-4 of open beam.
fn differences(pixel: &Pixel, energy: f64, offsets: &[f64]) -> Vec<f64> {
    let [waves, rays] =
        [wavelength(energy), 0.0].map(|length| Flat::of(pixel, length, [0.0; 2]).light);
    offsets.iter().map(|at| 1e4 * (waves.at(at * 1e-6) - rays.at(at * 1e-6))).collect()
}

#[track_caller]
fn assert_near(found: &[f64], expected: &[f64], tolerance: f64) {
    let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance);
    assert!(near && found.len() == expected.len(), "{found:?} {expected:?}");
}

/// Figures of propagation by FFT on 2^17 samples: two digits of 1e-4 behind the point for one aperture, one for
/// seven, to which the apertures beyond add up to 0.1.
#[test]
fn flats_match_the_figures_of_fft_within_their_digits() {
    let one = brightest(&reference(150, "period = \"1000 um\""));
    let expected = [-5.31, -4.68, -6.63, -8.74, -0.61, 6.44, 4.36];
    let offsets = [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0];
    assert_near(&differences(&one, 30.0, &offsets), &expected, 0.02);
    let many = brightest(&reference(150, ""));
    let offsets = [0.0, 20.0 / 3.0, 40.0 / 3.0, 20.0];
    assert_near(&differences(&many, 30.0, &offsets), &[-4.8, -4.4, -8.2, -0.1], 0.16);
    // Edges of near neighbours add 3.6e-4 in the middle of the curve.
    let near = brightest(&reference(90, ""));
    let apart = brightest(&reference(90, "period = \"1000 um\""));
    let of = |pixel| differences(pixel, 25.0, &offsets[..3]);
    let more: Vec<f64> = of(&near).iter().zip(of(&apart)).map(|(a, b)| a - b).collect();
    assert_near(&more, &[3.6; 3], 0.4);
}

/// Over a period the light is kept, whatever its phase does.
#[test]
fn waves_keep_the_mean_over_a_period() {
    let pixel = brightest(&reference(150, ""));
    let leaks = [0.02, 0.01];
    let [waves, rays] = [wavelength(30.0), 0.0].map(|length| Flat::of(&pixel, length, leaks));
    let mean = |of: &dyn Fn(f64) -> f64| -> f64 {
        (0..64).map(|at| of(100e-6 * f64::from(at) / 64.0)).sum::<f64>() / 64.0
    };
    let expected = (0.02 + 0.98 * 0.2) * (0.01 + 0.99 * 0.2);
    for flat in [&waves, &rays] {
        assert!((mean(&|at| flat.light.at(at)) - expected).abs() < 1e-9);
        let [even, odd] = [0, 1].map(|part: usize| mean(&|at| flat.bars[part].at(at)));
        assert!(even.abs() < 1e-12 && odd.abs() < 1e-12);
    }
    let largest = |flat: &Flat| libm::hypot(flat.bars[0].at(3e-6), flat.bars[1].at(3e-6));
    assert!(largest(&waves) > 1e-5 && largest(&rays) < 1e-12);
}

#[test]
fn rays_are_the_closed_form_of_thin_masks_within_1e_12() {
    let optics = reference(150, "");
    let closed = ThinCurve::of(&optics, [0.02, 0.01]).expect("both masks");
    let rays = Flat::of(&brightest(&optics), 0.0, [0.02, 0.01]).light;
    for offset in [-31e-6, 0.0, 4e-6, 17e-6] {
        assert!((rays.at(offset) - closed.at(offset).value).abs() < 1e-12, "{offset}");
    }
}

#[test]
fn differences_of_short_wavelengths_vanish_in_proportion() {
    let pixel = brightest(&reference(150, ""));
    let [soft, hard, harder] =
        [30.0, 3e3, 3e5].map(|energy| differences(&pixel, energy, &[15.0])[0]);
    assert!(soft < -8.0 && (hard * 100.0 / soft - 1.0).abs() < 0.2, "{soft} {hard}");
    assert!((harder / hard - 0.01).abs() < 1e-4, "{hard} {harder}");
}

/// The table of docs/physics.md, at the width of the curve; figures of two other programs have two digits.
#[test]
fn dark_field_of_waves_over_rays_matches_the_table_within_0_015() {
    let pixel = brightest(&reference(150, ""));
    let ratio = |form, diameter: f64| {
        let sizes = &[Body { radius: 0.5e-6 * diameter, share: 1.0 }];
        let bodies = Bodies { form, sizes, delta: &[4.61e-7] };
        bodies.ratio(&pixel, &[(30.0, 1.0, [0.0; 2])]).expect("bodies that refract")
    };
    let diameters = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0];
    let table = [0.18, 0.28, 0.37, 0.49, 0.58, 0.67, 0.78, 0.86, 0.98];
    assert_near(&diameters.map(|it| ratio(Form::Cylinder, it)), &table, 0.015);
    let spheres = [1.0, 5.0, 10.0, 50.0].map(|it| ratio(Form::Sphere, it));
    assert_near(&spheres, &[0.25, 0.46, 0.55, 0.76], 0.015);
}
