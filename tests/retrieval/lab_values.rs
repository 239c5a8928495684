//! Faults of measured values that need no known gain: pedestals, full cameras, wrong distances, frames in another order.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::draws::Draws;
use crate::stacks::{even, retrieved, sheets, stack};
use beamlet::Result;
use beamlet::retrieve::{Corrections, Input, Region, RetrieveOptions, RetrievedArrays};
use beamlet::scene::Scene;
use beamlet::stack::{FrameOrder, StackFile};
use ndarray::{Array4, Axis};

const STEPS: usize = 8;
const FWHM: f64 = 2.354_820_045;

/// Sheets with apertures of 20 um at 1.2 m and 40 um before the detector at this distance, 1.8 m of the frames.
fn scene(distance: f64) -> Scene {
    let offsets: Vec<f64> = even(STEPS, 24.0);
    let text = sheets([24, 12], &offsets).replace("1.8 m", &format!("{distance} m"));
    let [first, second] = ["aperture = \"20 um\"", "aperture = \"40 um\""];
    let text = text.replacen("projected_aperture = \"30 um\"", first, 1);
    Scene::from_toml(&text.replace("projected_aperture = \"30 um\"", second), ".").unwrap()
}

/// Photons of views in which a quarter of the pixels has this transmission and displacement of the curve (um of offset);
/// 40,000 of an open pixel.
fn photons(views: &[[f64; 2]], seed: u64) -> Array4<f32> {
    photons_at(views, seed, 0.0)
}

/// The same where the mask is displaced, um.
fn photons_at(views: &[[f64; 2]], seed: u64, displaced: f64) -> Array4<f32> {
    let (blur, mut draws) = (30e-6 / FWHM * 0.5, Draws(seed));
    let light = |offset: f64| {
        let at = 1.5 * offset;
        let all = (-2..=2).map(|k| blurred_overlap(at + f64::from(k) * 150e-6, 30e-6, 40e-6, blur));
        all.sum::<f64>() / 150e-6
    };
    let offsets = even(STEPS, 24e-6);
    let of = |(view, step, row, column): (usize, usize, usize, usize)| {
        let [t, moved] = if row < 6 && column < 12 { views[view] } else { [1.0, 0.0] };
        draws.poisson(4e4 * t * light(offsets[step] + 1e-6 * (moved + displaced))) as f32
    };
    Array4::from_shape_fn((views.len(), STEPS, 12, 24), of)
}

fn found(scene: &Scene, flat: StackFile, sample: StackFile) -> Result<RetrievedArrays> {
    retrieved(Input::measured(scene, flat, sample, None)?, &RetrieveOptions::default())
}

/// What is warned of where flat and sample are these values of the photons.
fn warned(scene: &Scene, flat: impl Fn(f32) -> f32, sample: impl Fn(f32) -> f32) -> String {
    let flat = stack("flat", photons(&[[1.0, 0.0]], 1).mapv(flat));
    let sample = stack("sample", photons(&[[0.8, 1.5]], 2).mapv(sample));
    found(scene, flat, sample).unwrap().record.warnings.join("\n")
}

/// 150 numbers a photon have a reduced chi squared of 150 in flat and sample alike, which is no fault. A pedestal that was
/// subtracted twice makes curves that are not those of the masks, and values below zero.
#[test]
fn a_pedestal_subtracted_twice_is_warned_of_without_a_gain() {
    let scene = scene(1.8);
    let camera = |photons: f32| 150.0 * photons;
    assert_eq!(warned(&scene, camera, camera), "");
    let text = warned(&scene, camera, |photons| camera(photons) - 3e5);
    assert!(
        text.contains("values of the sample at mask step") && text.contains("negative"),
        "{text}"
    );
    assert!(text.contains("curves of the sample are not those of the masks"), "{text}");
    let text = warned(&scene, |photons| camera(photons) - 3e5, camera);
    assert!(text.contains("values of the flat at mask step"), "{text}");
}

/// A distance of the detector that is 15 % wrong leaves residuals that all pixels of the flat share.
#[test]
fn a_wrong_distance_leaves_the_shape_of_its_residuals() {
    let text = warned(&scene(2.07), |y| y, |y| y);
    assert!(text.contains("alike in all pixels") && text.contains("distances"), "{text}");
    assert_eq!(warned(&scene(1.8), |y| y, |y| y), "");
}

#[test]
fn a_sample_without_light_is_an_error() {
    let mut draws = Draws(5);
    let mut dark = || (draws.poisson(100.0) - 100.0) as f32;
    let flat = photons(&[[1.0, 0.0]], 1);
    for values in [flat.mapv(|_| 0.0), flat.mapv(|_| dark())] {
        let error = found(&scene(1.8), stack("flat", flat.clone()), stack("sample", values));
        let error = error.unwrap_err().to_string();
        assert!(error.contains("a sample with light"), "{error}");
    }
}

/// Steps at the peak are cut at the largest number of the camera, or at another number: named with the option that
/// leaves these values out, which is right again.
#[test]
fn a_full_camera_is_named_with_its_saturation() {
    let scene = scene(1.8);
    for full in [65535.0, 4095.0, 16383.0, 3000.0] {
        // Light at the peak is 0.199 of an open pixel.
        let scale = 1.1 * full / (4e4 * 0.199);
        let camera = |photons: f32| (scale * photons).round().min(full);
        let text = warned(&scene, camera, camera);
        assert!(text.contains(&format!("--saturation {full}")), "{full}: {text}");
        let [flat, sample] =
            [photons(&[[1.0, 0.0]], 1), photons(&[[0.8, 1.5]], 2)].map(|it| it.mapv(camera));
        let input =
            Input::measured(&scene, stack("flat", flat), stack("sample", sample), None).unwrap();
        let kept = retrieved(input.saturated_at(Some(full)), &RetrieveOptions::default()).unwrap();
        let text = kept.record.warnings.join("\n");
        assert!(!text.contains("--saturation"), "{full}: {text}");
        let t = kept.images["transmission"].slice(ndarray::s![0, 1..5, 1..11]).mean().unwrap();
        assert!((t / 0.8 - 1.0).abs() < 5e-3, "{full}: {t}");
    }
    let below = |photons: f32| (0.5 * photons).round();
    assert_eq!(warned(&scene, below, below), "");
}

/// Three views that were taken step by step: suspected as views of steps, read by their order as if taken view by view.
#[test]
fn views_of_each_step_are_suspected_and_read() {
    let scene = scene(1.8);
    let all = photons(&[[0.8, 1.5], [0.9, -2.0], [0.7, 0.5]], 2);
    let swapped = all.clone().permuted_axes([1, 0, 2, 3]).as_standard_layout().into_owned();
    let listed = swapped.clone().into_shape_with_order((1, 24, 12, 24)).unwrap();
    let flat = || stack("flat", photons(&[[1.0, 0.0]], 1));
    let right = found(&scene, flat(), stack("sample", all)).unwrap();
    assert_eq!(right.record.warnings.join("\n"), "");
    // A list of frames, and four dimensions.
    for sample in [stack("sample", listed.clone()), stack("sample", swapped)] {
        let sample = sample.with_order(FrameOrder::StepView);
        let read = found(&scene, flat().with_order(FrameOrder::StepView), sample).unwrap();
        assert_eq!(read.images, right.images);
        assert_eq!(read.record.frame_order, FrameOrder::StepView);
    }
    let text = found(&scene, flat(), stack("sample", listed)).unwrap().record.warnings.join("\n");
    assert!(text.contains("--frame-order step,view"), "{text}");
}

/// Two neighbouring steps of the sample, or of flat and sample, exchanged.
#[test]
fn exchanged_steps_are_named() {
    let scene = scene(1.8);
    let swapped = |mut frames: Array4<f32>| {
        let [a, b] = [2, 3].map(|step| frames.index_axis(Axis(1), step).to_owned());
        frames.index_axis_mut(Axis(1), 2).assign(&b);
        frames.index_axis_mut(Axis(1), 3).assign(&a);
        frames
    };
    let [flat, sample] = [photons(&[[1.0, 0.0]], 1), photons(&[[0.8, 1.5]], 2)];
    let text = |flat: &Array4<f32>, sample: Array4<f32>| {
        let found = found(&scene, stack("flat", flat.clone()), stack("sample", sample));
        found.unwrap().record.warnings.join("\n")
    };
    assert!(!text(&flat, sample.clone()).contains("exchanged"));
    let of_sample = text(&flat, swapped(sample.clone()));
    assert!(of_sample.contains("mask steps 2 and 3 of the sample"), "{of_sample}");
    let of_both = text(&swapped(flat), swapped(sample));
    assert!(of_both.contains("mask steps 2 and 3 of flat and sample"), "{of_both}");
}

/// Doses of 2 % and displacements of 0.2 um behind masks without a fringe: fields are empty or within four of their
/// deviations, and a warning names the choice.
#[test]
fn doses_and_displacements_without_a_fringe_are_left_empty() {
    let scene = scene(1.8);
    let doses = [0.984, 0.958, 0.976, 0.947, 0.958, 0.969, 1.001, 0.990];
    let moved = [0.16, 0.247, 0.642, 0.475, 0.722, 0.451, 0.319, 0.401];
    let mut sample = photons(&[[1.0, 0.0]], 2);
    for (step, (dose, moved)) in doses.into_iter().zip(moved).enumerate() {
        let displaced = photons_at(&[[1.0, 0.0]], 10 + step as u64, moved);
        let frame = displaced.index_axis(Axis(1), step).mapv(|y| y * dose as f32);
        sample.index_axis_mut(Axis(1), step).assign(&frame);
    }
    let input = Input::measured(
        &scene,
        stack("flat", photons(&[[1.0, 0.0]], 1)),
        stack("sample", sample),
        None,
    );
    let options = RetrieveOptions::default()
        .with_gain(1.0)
        .with_correct(Corrections::parse("dose,steps").unwrap())
        .with_empty_beam(Region::new(12..24, None));
    let found = retrieved(input.unwrap(), &options).unwrap();
    let [view] = &found.record.corrections[..] else { panic!("{:?}", found.record.corrections) };
    let pairs = view.steps.iter().zip(moved.map(|um| 1e-6 * um));
    for (pair, truth) in pairs.chain(view.dose.iter().zip(doses)) {
        let Some([value, sigma]) = pair else { continue };
        assert!((value - truth).abs() < 4.0 * sigma, "{value:e} ± {sigma:e} for {truth:e}");
    }
    let text = found.record.warnings.join("\n");
    assert!(text.contains("choose --correct dose or --correct steps"), "{text}");
}
