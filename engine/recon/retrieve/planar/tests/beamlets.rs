//! Beamlets at every place on the pixels, on square, hexagonal and turned lattices.

use super::super::super::method::Method;
use super::super::super::options::RetrieveOptions;
use super::super::{Aperture, Lattice};
use super::light::{Blurred, Contrasts};
use super::{Tracking, assert_within, known};

const UM: f64 = 1e-6;

/// An object that refracts and scatters along no axis of the frame.
const OBJECT: Contrasts = Contrasts([0.8, 1.5e-6, -0.9e-6, 9e-11, 5e-11, 3e-11]);

/// Lattices with periods that are not whole numbers of pixels.
fn lattices() -> Vec<(&'static str, Lattice)> {
    vec![
        ("rectangles", Lattice::parse("73 um, 86 um").unwrap()),
        ("turned by 3 degrees", Lattice::parse("77 um, 77 um, 3 deg").unwrap()),
        ("turned by -8 degrees", Lattice::parse("81 um, 74 um, -8 deg").unwrap()),
        ("hexagonal", Lattice::parse("84 um, 0 um; 42 um, 72.7 um").unwrap()),
    ]
}

fn variance(sigma: f64) -> f64 {
    (sigma * UM).powi(2)
}

fn tracking(lattice: Lattice, light: Blurred, origin: [f64; 2]) -> Tracking {
    Tracking { lattice, origin: origin.map(|at| at * UM), light, shape: [40, 46] }
}

#[test]
fn gaussian_beamlets_give_back_all_six_contrasts_on_every_lattice() {
    // Frames of f32 hold 6e-8 of the peak; the quadrature of the light is good to 1e-7.
    for (name, lattice) in lattices() {
        for origin in [[0.0, 0.0], [2.7, -1.9], [5.0, 3.4]] {
            let light = Blurred::gaussian([variance(11.0), variance(9.0), 0.0]);
            let of = tracking(lattice, light, origin);
            let frames = [of.frame(&Contrasts::EMPTY), of.frame(&OBJECT)];
            let found = of.images(&RetrieveOptions::default(), [&frames[0], &frames[1]]);
            assert_within(&found, &OBJECT, [1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3], name);
            assert!(known(&found, "flags").iter().all(|bits| *bits == 0.0), "{name}: flags");
        }
    }
}

#[test]
fn rectangles_and_disks_are_fitted_with_their_own_shape() {
    // The disk is fitted by strips: 1e-3.
    let blur = [variance(7.0), variance(6.0), 0.0];
    let lattice = Lattice::parse("77 um, 77 um").unwrap();
    let size = [26.0 * UM, 18.0 * UM];
    let apertures = [
        (Aperture::Rectangle(size), Blurred::rectangle(size, blur)),
        (Aperture::Round(24.0 * UM), Blurred::disk(24.0 * UM, blur)),
    ];
    for (aperture, light) in apertures {
        let of = tracking(lattice, light, [1.2, 3.9]);
        let frames = [of.frame(&Contrasts::EMPTY), of.frame(&OBJECT)];
        let options =
            RetrieveOptions::default().with_method(Method::Beamlet).with_aperture(aperture);
        let found = of.images(&options, [&frames[0], &frames[1]]);
        let about = format!("{aperture:?}");
        assert_within(&found, &OBJECT, [1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3], &about);
    }
}

#[test]
fn moments_are_corrected_for_the_light_beyond_the_window() {
    // Windows of 7.7 pixels cut 2.7 deviations of 14 um: moments within the window are 0.7 to 0.92 of the dark field.
    let lattice = Lattice::parse("77 um, 77 um").unwrap();
    let options = RetrieveOptions::default().with_method(Method::Moments);
    let weak = Contrasts([0.8, 0.5e-6, -0.3e-6, 2e-11, 1e-11, 0.7e-11]);
    for sigma in [7.0, 11.0, 14.0] {
        let light = Blurred::gaussian([variance(sigma), variance(sigma), 0.0]);
        let of = tracking(lattice, light, [1.0, 2.0]);
        let frames = [of.frame(&Contrasts::EMPTY), of.frame(&weak)];
        let found = of.images(&options, [&frames[0], &frames[1]]);
        let parts = [1e-4, 1e-3, 1e-3, 1e-2, 1e-2, 1e-2];
        assert_within(&found, &weak, parts, &format!("{sigma} um"));
    }
}

#[test]
fn a_beamlet_with_a_wrong_value_is_a_misfit() {
    let lattice = Lattice::parse("77 um, 77 um").unwrap();
    let mut of =
        tracking(lattice, Blurred::gaussian([variance(10.0), variance(10.0), 0.0]), [0.0; 2]);
    of.shape = [62, 62];
    let frames = [of.frame(&Contrasts::EMPTY), of.frame(&OBJECT)];
    let mut wrong = frames[1].clone();
    wrong[[0, 31, 31]] *= 1.6;
    let found = of.images(&RetrieveOptions::default(), [&frames[0], &wrong]);
    let flagged = known(&found, "flags").iter().filter(|bits| **bits > 0.0).count();
    assert!((1..=2).contains(&flagged), "{flagged} flagged");
}

#[test]
fn saturated_values_are_left_out_and_flagged() {
    let lattice = Lattice::parse("77 um, 77 um").unwrap();
    let light = Blurred::gaussian([variance(11.0), variance(11.0), 0.0]);
    let of = tracking(lattice, light, [0.0; 2]);
    let mut frames = [of.frame(&Contrasts::EMPTY), of.frame(&OBJECT)];
    frames.iter_mut().for_each(|frame| frame[[0, 20, 22]] = f32::MAX);
    let options = RetrieveOptions { saturation: Some(f32::MAX), ..RetrieveOptions::default() };
    let found = of.images(&options, [&frames[0], &frames[1]]);
    assert_within(&found, &OBJECT, [1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3], "saturated");
    let bits = known(&found, "flags").iter().fold(0.0, |most: f64, bits| most.max(*bits));
    assert_eq!(bits, f64::from(4 + 4 * 1024), "saturated in flat and sample");
}

#[test]
fn the_bias_of_a_gaussian_and_of_moments_for_rectangles_is_the_stated_one() {
    // docs/retrieval.md, "Two directions": retrieved over true values at 50 places on the pixels.
    let blur = [variance(7.0), variance(6.0), 0.0];
    let lattice = Lattice::parse("77 um, 77 um").unwrap();
    let weak = Contrasts([0.8, 0.5e-6, 0.5e-6, 2e-11, 2e-11, 1e-11]);
    for origin in [[0.0, 0.0], [2.5, 5.0]] {
        let of = tracking(lattice, Blurred::rectangle([26.0 * UM, 18.0 * UM], blur), origin);
        let frames = [of.frame(&Contrasts::EMPTY), of.frame(&weak)];
        for (method, limits) in [
            (Method::Gaussian, [0.007, 0.07, 0.07, 0.17, 0.17, 0.04]),
            (Method::Moments, [0.0005, 0.025, 0.025, 0.04, 0.04, 0.011]),
        ] {
            let options = RetrieveOptions::default().with_method(method);
            let found = of.images(&options, [&frames[0], &frames[1]]);
            for (k, name) in super::NAMES.into_iter().enumerate() {
                for value in known(&found, name) {
                    let off = (value / weak.0[k] - 1.0).abs();
                    assert!(off < limits[k], "{method:?}, {origin:?}: {name} {value:e}");
                }
            }
        }
    }
}
