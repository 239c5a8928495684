//! Curves over mask offsets in two directions.

use super::super::super::images::Images;
use super::super::super::method::Method;
use super::super::super::options::RetrieveOptions;
use super::super::super::retriever::Retriever;
use super::super::{Aperture, Design};
use super::light::{Blurred, Contrasts};
use super::{ARM, MAGNIFICATION, assert_within, scene};
use beamlet_model::scene::Scene;
use ndarray::Array3;

const UM: f64 = 1e-6;
const OBJECT: Contrasts = Contrasts([0.8, 0.7e-6, -0.4e-6, 2e-11, 1.1e-11, 0.6e-11]);

/// Detector mask of the set-up, and one angle.
const MASKS: &str = "[detector_mask]\ndistance = \"1.7 m\"\nperiod = \"60 um\"\naperture = \"15 um\"\n\
                     transmission = 0.0\n";

/// Frames of curves of pixels at these offsets: the curve is displaced by -z/M times the angle.
fn frames(light: &Blurred, pairs: &[[f64; 2]], of: &Contrasts, [z, m]: [f64; 2]) -> Array3<f32> {
    let blurred = light.behind(of, z / m);
    Array3::from_shape_fn((pairs.len(), 2, 3), |(step, row, column)| {
        let [x, y] = pairs[step];
        let own = [0.7 * UM * column as f64, -0.9 * UM * row as f64];
        let shift = [of.0[1] * z / m, of.0[2] * z / m];
        blurred.density([x - own[0] + shift[0], y - own[1] + shift[1]]) as f32
    })
}

/// Images of frames of flat and sample at these offsets.
fn images(
    scene: &Scene,
    pairs: &[[f64; 2]],
    options: &RetrieveOptions,
    [flat, sample]: [&Array3<f32>; 2],
) -> Images {
    let design = Design::Steps(pairs.to_vec());
    let mut retriever = Retriever::in_two_directions(scene, &design, options).unwrap();
    retriever.set_flat_array(flat.view()).unwrap();
    retriever.retrieve_array(sample.view()).unwrap()
}

#[test]
fn steps_along_x_and_z_give_back_all_six_contrasts() {
    let light = Blurred::gaussian([(8.0 * UM).powi(2), (7.0 * UM).powi(2), 0.0]);
    let grid: Vec<[f64; 2]> = (-2..=2)
        .flat_map(|j| (-2..=2).map(move |i| [f64::from(i) * 7.0 * UM, f64::from(j) * 6.5 * UM]))
        .collect();
    // Any list that determines the curve: no grid, and ten pairs.
    let scattered: Vec<[f64; 2]> = [
        [0.0, 0.0],
        [9.0, 1.0],
        [-8.0, 2.0],
        [1.0, 9.0],
        [-2.0, -10.0],
        [7.0, 7.0],
        [-7.0, 6.0],
        [6.0, -8.0],
        [-6.0, -7.0],
        [14.0, -3.0],
    ]
    .map(|pair| pair.map(|at| at * UM))
    .to_vec();
    for pairs in [grid, scattered] {
        let scene = scene([2, 3], MASKS);
        let options = RetrieveOptions::default();
        let [z, m] = [scene.lever_arm(), scene.magnification()];
        assert!(z < ARM && m < MAGNIFICATION, "the analyser is the detector mask");
        let flat = frames(&light, &pairs, &Contrasts::EMPTY, [z, m]);
        let sample = frames(&light, &pairs, &OBJECT, [z, m]);
        let found = images(&scene, &pairs, &options, [&flat, &sample]);
        let parts = [1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3];
        assert_within(&found, &OBJECT, parts, &format!("{} pairs", pairs.len()));
    }
}

#[test]
fn rectangles_of_both_masks_are_fitted_with_their_own_curve() {
    // Boxes of 18 x 14 um and 12 x 10 um behind a spot: the quadrature over both is good to 1e-6.
    let [sample, detector] = [[18.0 * UM, 14.0 * UM], [12.0 * UM, 10.0 * UM]];
    let pairs: Vec<[f64; 2]> = (-3..=3)
        .flat_map(|j| (-3..=3).map(move |i| [f64::from(i) * 5.0 * UM, f64::from(j) * 4.5 * UM]))
        .collect();
    let scene = scene([2, 3], MASKS);
    let [z, m] = [scene.lever_arm(), scene.magnification()];
    let blur = super::super::geometry::blur(&scene, true);
    let light = Blurred::rectangles(
        [sample, detector].map(|size| size.map(|width| width / m)),
        [blur[0], blur[1], 0.0],
    );
    let flat = frames(&light, &pairs, &Contrasts::EMPTY, [z, m]);
    let sample_frames = frames(&light, &pairs, &OBJECT, [z, m]);
    let options = RetrieveOptions::default()
        .with_method(Method::ExactCurve)
        .with_aperture(Aperture::Rectangle(sample))
        .with_detector_aperture(Aperture::Rectangle(detector));
    let found = images(&scene, &pairs, &options, [&flat, &sample_frames]);
    assert_within(&found, &OBJECT, [1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3], "exact-curve");
    let round = options.with_detector_aperture(Aperture::Round(1e-5));
    let refused = Retriever::in_two_directions(&scene, &Design::Steps(pairs), &round);
    assert!(refused.unwrap_err().to_string().contains("detector_aperture"));
}
