//! Curves of the masks that have several solutions: local minima, exact second solutions, and whole periods.

use crate::reference::closed_form::blurred_overlap;
use crate::stacks::{retrieved, stack};
use beamlet::retrieve::{Input, RetrieveOptions, RetrievedArrays, flags};
use beamlet::scene::{Beam, Detector, MaskBody, MaskSpec, Scan, Scene, Source};
use ndarray::Array4;

const PITCH: f64 = 150e-6;
/// Full width at half maximum of a Gaussian over its standard deviation.
const FWHM: f64 = 2.354_820_045;

/// Sheets at 1.6 and 2 m with these apertures on the detector mask, as parts of a period, and mask offsets in parts of it.
fn scene([first, second]: [f64; 2], offsets: &[f64]) -> Scene {
    let source = Source::new(1.6, [20e-6, 20e-6], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(2.0, [4, 1], [PITCH; 2]));
    let sheet = || MaskBody::Sheet { transmission: 0.0 };
    let period = 1.59 / 2.0 * PITCH;
    scene.sample_mask = Some(MaskSpec::new(1.59, period, first * period, sheet()));
    scene.detector_mask = Some(MaskSpec::new(2.0, PITCH, second * PITCH, sheet()));
    scene.scan = Scan::new(offsets.iter().map(|part| part * period).collect(), vec![0.0]);
    scene
}

/// Flat, and a sample with this transmission, displacement of the curve in parts of a period, and variance of the blur
/// beyond the spot in widths of the narrower aperture: the closed form of all periods.
fn found(
    scene: &Scene,
    [first, second]: [f64; 2],
    [t, moved, more]: [f64; 3],
    options: &RetrieveOptions,
) -> RetrievedArrays {
    let magnification = 2.0 / 1.59;
    let spot = 20e-6 / FWHM * (magnification - 1.0);
    let frames = |[t, moved, more]: [f64; 3]| {
        let blur = spot.hypot(more * first.min(second) * PITCH);
        let value = |offset: f64| {
            let at = magnification * offset - moved * PITCH;
            let periods = (-4..=4).map(|k| at + f64::from(k) * PITCH);
            let all = periods.map(|at| blurred_overlap(at, first * PITCH, second * PITCH, blur));
            t * all.sum::<f64>() / PITCH
        };
        let offsets = &scene.scan.mask_offsets;
        Array4::from_shape_fn((1, offsets.len(), 1, 4), |(_, step, ..)| value(offsets[step]) as f32)
    };
    let [flat, sample] = [[1.0, 0.0, 0.0], [t, moved, more]].map(|of| frames(of).mapv(|y| 1e5 * y));
    let input = Input::simulated(scene, stack("flat", flat), stack("sample", sample));
    retrieved(input, options).unwrap()
}

fn value(found: &RetrievedArrays, name: &str) -> f64 {
    f64::from(found.images[name][[0, 0, 0]])
}

fn bits(found: &RetrievedArrays) -> u32 {
    value(found, "flags") as u32
}

/// Four steps over ±0.4 of a period behind apertures of 0.8 and 0.2: the first descent ends with an angle 17 % off. The
/// deepest of the other minima is the truth, to the digits of f32 in a fit of three unknowns.
#[test]
fn fits_leave_local_minima_for_the_truth() {
    let (apertures, offsets) = ([0.8, 0.2], [-0.4, -0.4 / 3.0, 0.4 / 3.0, 0.4]);
    let scene = scene(apertures, &offsets);
    let lever = scene.lever_arm();
    for moved in [-0.3, -0.2, 0.1, 0.3] {
        let found = found(&scene, apertures, [0.2, moved, 0.0], &RetrieveOptions::default());
        let (t, angle) = (value(&found, "transmission"), value(&found, "refraction"));
        let truth = -moved * PITCH / lever;
        assert!((t / 0.2 - 1.0).abs() < 1e-3, "{moved}: {t}");
        assert!((angle / truth - 1.0).abs() < 2e-3, "{moved}: {angle:e} for {truth:e}");
        assert_eq!(bits(&found), 0, "{moved}");
    }
}

/// Three steps on the plateau of apertures of 0.6 and 0.2 have two exact solutions: neither has an uncertainty, and the
/// pixel says so. The same steps behind narrow apertures have one.
#[test]
fn second_solutions_of_three_steps_are_flagged_without_uncertainties() {
    let offsets = [-0.15, 0.0, 0.15];
    let options = RetrieveOptions::default().with_gain(1.0);
    for (apertures, moved, is_doubtful) in [([0.6, 0.2], 0.2, true), ([0.2, 0.2], 0.1, false)] {
        let scene = scene(apertures, &offsets);
        let found = found(&scene, apertures, [0.9, moved, 0.0], &options);
        assert_eq!(bits(&found) & flags::DOUBTFUL != 0, is_doubtful, "{apertures:?}");
        for name in ["transmission_sigma", "refraction_sigma", "dark_field_sigma"] {
            assert_eq!(value(&found, name).is_nan(), is_doubtful, "{apertures:?} {name}");
        }
        if !is_doubtful {
            assert!((value(&found, "transmission") / 0.9 - 1.0).abs() < 1e-3);
        }
    }
}

/// Displacements of about half a period in a scan over a whole one: the curve is known, but for a whole period.
#[test]
fn angles_a_period_off_are_flagged_as_that() {
    let apertures = [0.2, 0.2];
    let offsets: Vec<f64> = (-5..=5).map(|step| 0.1 * f64::from(step)).collect();
    let scene = scene(apertures, &offsets);
    let lever = scene.lever_arm();
    for (moved, is_doubtful) in [(0.3, false), (0.45, true), (0.58, true)] {
        let found = found(&scene, apertures, [0.8, moved, 0.0], &RetrieveOptions::default());
        let of_sample = (bits(&found) >> flags::BITS) & ((1 << flags::BITS) - 1);
        assert_eq!(of_sample & flags::OUTSIDE, 0, "{moved}");
        assert!((value(&found, "transmission") / 0.8 - 1.0).abs() < 1e-3, "{moved}");
        let off = value(&found, "refraction") * lever / PITCH + moved;
        assert!((off - off.round()).abs() < 1e-3, "{moved}: {off}");
        assert_eq!(bits(&found) & flags::DOUBTFUL != 0, is_doubtful, "{moved}");
    }
}
