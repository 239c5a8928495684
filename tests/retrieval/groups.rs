//! Retrieval behind asymmetric masks, whose neighbouring columns sample other points of one curve, and behind
//! skipped masks.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::draws::Draws;
use crate::stacks::{retrieved, stack};
use crate::support::{self, Worst, engine};
use beamlet::check::Check;
use beamlet::retrieve::{Input, Method, RetrieveOptions, RetrievedArrays, Retriever};
use beamlet::scene::{Beam, Detector, MaskBody, MaskSpec, Scan, Scene, Source};
use beamlet::{Backend, Result};
use ndarray::{Array2, Array3, Array4};

/// Transmission, refraction angle (rad) and dark field (rad²).
type Contrasts = [f64; 3];

const PITCH: f64 = 150e-6;
/// Full width at half maximum of a Gaussian over its standard deviation.
const FWHM: f64 = 2.354_820_045;

/// The masks of the paper as sheets, with shifts before the sample.
fn scene(pixels: [u32; 2], shifts: &[f64]) -> Scene {
    let source = Source::new(1.21, [30e-6, 26e-6], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, pixels, [PITCH; 2]));
    let sheet = || MaskBody::Sheet { transmission: 0.0 };
    let mut first = MaskSpec::new(1.2, 100e-6, 20e-6, sheet());
    first.shifts = shifts.iter().map(|shift| shift * 1e-6).collect();
    scene.sample_mask = Some(first);
    scene.detector_mask = Some(MaskSpec::new(1.8, PITCH, 30e-6, sheet()));
    scene.scan = Scan::new(vec![0.0], vec![0.0]);
    scene
}

/// Light of a pixel at a displacement of the curve (m of mask offset), behind an object of these contrasts.
fn light(scene: &Scene, offset: f64, [t, alpha, dark]: Contrasts) -> f64 {
    let lever = scene.lever_arm();
    let spot = 30e-6 / FWHM * 0.5;
    let blur = (spot * spot + dark * lever * lever).sqrt();
    let at = 1.5 * offset + alpha * lever;
    let periods = (-2..=2).map(|k| at + f64::from(k) * PITCH);
    t * periods.map(|at| blurred_overlap(at, 30e-6, 30e-6, blur)).sum::<f64>() / PITCH
}

/// Frames `[view][step][row][column]` of an object, and of none.
fn frames(scene: &Scene, of: &dyn Fn(usize, usize) -> Contrasts) -> Array4<f64> {
    let [columns, rows] = scene.detector.pixels.map(|count| count as usize);
    let offsets = scene.offsets_of_group(&scene.scan.mask_offsets);
    let group = scene.group();
    Array4::from_shape_fn((1, offsets.len() / group, rows, columns), |(_, step, row, column)| {
        light(scene, offsets[step * group + column % group], of(row, column))
    })
}

/// Images of frames `[view][step][row][column]` of flat and sample.
pub(crate) fn retrieve(
    scene: &Scene,
    flat: &Array4<f64>,
    sample: &Array4<f64>,
    options: &RetrieveOptions,
) -> Result<RetrievedArrays> {
    let [flat, sample] = [("flat", flat), ("sample", sample)]
        .map(|(name, frames)| stack(name, frames.mapv(|value| value as f32)));
    retrieved(Input::simulated(scene, flat, sample), options)
}

fn image(found: &RetrievedArrays, name: &str) -> Array2<f64> {
    found.images[name].index_axis(ndarray::Axis(0), 0).mapv(f64::from)
}

const AIR: Contrasts = [1.0, 0.0, 0.0];

/// Methods with the shifts that they serve, um.
const DESIGNS: [(Method, &[f64]); 4] = [
    (Method::ExactCurve, &[-20.0, -10.0, 0.0, 10.0, 20.0]),
    (Method::ExactCurve, &[-24.0, 8.0, -8.0, 24.0, 0.0, 16.0, -16.0]),
    (Method::TwoStep, &[-10.0, 10.0]),
    (Method::TwoStep, &[12.0, -8.0, -8.0, 12.0]),
];

#[test]
fn one_shot_behind_asymmetric_masks_gives_a_wedge_and_scatter() {
    let mut worst = Worst::new("contrasts of one shot over theirs, less 1", 2e-3);
    for (method, shifts) in DESIGNS {
        let group = shifts.len();
        let scene = scene([4 * group as u32 + 1, 3], shifts);
        let flat = frames(&scene, &|_, _| AIR);
        let rows: [Contrasts; 3] = [[0.8, 1.5e-6, 0.0], [0.6, -3e-6, 0.0], [0.9, 0.5e-6, 16e-12]];
        let has_width = method != Method::TwoStep;
        let sample = frames(&scene, &|row, _| match rows[row] {
            [t, alpha, _] if !has_width => [t, alpha, 0.0],
            contrasts => contrasts,
        });
        let options = RetrieveOptions::default().with_method(method);
        let found = retrieve(&scene, &flat, &sample, &options).unwrap();
        assert_eq!((found.record.shape, found.record.group), ([1, 3, 4], Some(group)));
        assert_eq!(found.images.contains_key("dark_field"), has_width);
        for (row, [t, alpha, dark]) in rows.into_iter().enumerate() {
            for column in 0..4 {
                let at = [row, column];
                worst.take(image(&found, "transmission")[at] / t - 1.0, || {
                    format!("{method}, T, {at:?}")
                });
                worst.take(image(&found, "refraction")[at] / alpha - 1.0, || {
                    format!("{method}, angle, {at:?}")
                });
                if has_width && dark > 0.0 {
                    worst.take(image(&found, "dark_field")[at] / dark - 1.0, || {
                        format!("{method}, width, {at:?}")
                    });
                }
            }
        }
        // The last column fills no group; a group lies at the middle of its columns.
        for (at, place) in found.record.columns_m.iter().enumerate() {
            let middle = (at as f64 + 0.5) * group as f64 - (4.0 * group as f64 + 1.0) / 2.0;
            assert!((place - middle * PITCH).abs() < 1e-9, "{place}");
        }
        assert!((found.record.pitch[0] - group as f64 * PITCH).abs() < 1e-12);
    }
    worst.holds();
}

/// Two shots of four shifts are eight points: the offsets of the scan displace all columns.
#[test]
fn steps_of_an_asymmetric_mask_add_points_to_the_curve() {
    let mut scene = scene([12, 1], &[-20.0, -10.0, 0.0, 10.0]);
    scene.scan = Scan::new(vec![0.0, 5e-6], vec![0.0]);
    let flat = frames(&scene, &|_, _| AIR);
    let sample = frames(&scene, &|_, _| [0.7, 2e-6, 9e-12]);
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let found = retrieve(&scene, &flat, &sample, &options).unwrap();
    for (name, truth) in [("transmission", 0.7), ("refraction", 2e-6), ("dark_field", 9e-12)] {
        let off = image(&found, name).mapv(|value| (value / truth - 1.0).abs());
        assert!(off.iter().all(|off| *off < 2e-3), "{name}: {off}");
    }
}

/// A scan over a whole period of slits displaced to either side, scan offsets up to 0.6 of a period from the own slit of a
/// column: the neighbours' light counts from where they are. Light of a column is the sum of all slits, T, angle and dark
/// field are exact to the digits of f32, and so is `response`.
#[test]
fn asymmetric_masks_are_retrieved_over_whole_periods() {
    let shifts = [-9e-6, 3e-6, 11e-6];
    let mut scene = scene([12, 1], &shifts.map(|shift| 1e6 * shift));
    scene.scan = Scan::new((-5..=5).map(|step| 9e-6 * f64::from(step)).collect(), vec![0.0]);
    let lever = scene.lever_arm();
    let all = |[t, alpha, dark]: Contrasts| {
        Array4::from_shape_fn((1, 11, 1, 12), |(_, step, _, column)| {
            let blur = (0.5 * 30e-6 / FWHM).hypot(dark.sqrt() * lever);
            let slit = |k: i32| {
                let shift = shifts[(column as i32 + k).rem_euclid(3) as usize];
                let offset = scene.scan.mask_offsets[step] + shift;
                let at = 1.5 * offset + alpha * lever + f64::from(k) * PITCH;
                blurred_overlap(at, 30e-6, 30e-6, blur)
            };
            t * (-4..=4).map(slit).sum::<f64>() / PITCH
        })
    };
    let truth = [0.7, -9e-6, 60e-12];
    let options = RetrieveOptions::default();
    let found = retrieve(&scene, &all(AIR), &all(truth), &options).unwrap();
    for (name, truth) in ["transmission", "refraction", "dark_field"].into_iter().zip(truth) {
        let off = image(&found, name).mapv(|value| (value / truth - 1.0).abs());
        assert!(off.iter().all(|off| *off < 1e-4), "{name}: {off}");
    }
    let response = found.record.response.unwrap();
    assert!(response.largest_error() < 1e-4, "{response}");
    // `check` has the light of each column at each offset, to the tolerance of sampling.
    let report = Check::of(&scene).with_engine(&engine(Backend::Bvh)).run().unwrap();
    let (values, flat) = (report.illumination.unwrap().scan, all(AIR).into_raw_vec_and_offset().0);
    let groups = flat.chunks(12).flat_map(|columns| &columns[..3]);
    for ([offset, light], truth) in values.into_iter().zip(groups) {
        assert!((light - truth).abs() < 1e-4, "{offset:e}: {light} for {truth}");
    }
    // A Gaussian takes the light of neighbours for its own.
    let found = retrieve(&scene, &all(AIR), &all(truth), &support::free_gaussian()).unwrap();
    assert!(found.record.response.unwrap().largest_error() > 0.01);
}

/// A wedge whose angle grows along x, as beside the middle of a ball. The columns of each shift lie evenly about the
/// middle of the group: the group has the value of its middle, within 1 % of the largest.
#[test]
fn a_ball_is_seen_as_wide_as_a_group() {
    let shifts = [-20.0, -10.0, 0.0, 10.0, 20.0, 20.0, 10.0, 0.0, -10.0, -20.0];
    let scene = scene([60, 1], &shifts);
    let flat = frames(&scene, &|_, _| AIR);
    let alpha = |x: f64| 4e-6 * x / 30.0;
    let of = |column: f64| [0.9 - 0.1 * (column / 30.0 - 1.0).powi(2), alpha(column - 30.0), 0.0];
    let sample = frames(&scene, &|_, column| of(column as f64 + 0.5));
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let found = retrieve(&scene, &flat, &sample, &options).unwrap();
    for (at, (angle, t)) in
        image(&found, "refraction").iter().zip(&image(&found, "transmission")).enumerate()
    {
        let [wanted, truth, _] = of(10.0 * at as f64 + 5.0);
        assert!((angle - truth).abs() < 0.01 * 4e-6, "{at}: {angle:e} for {truth:e}");
        assert!((t / wanted - 1.0).abs() < 0.01, "{at}: {t} for {wanted}");
    }
}

/// Counts of 20,000 photons in an open pixel: 68 % of the values lie within their uncertainty.
#[test]
fn uncertainties_of_one_shot_are_the_scatter_of_counts() {
    let drawn = |frames: &Array4<f64>, seed: u64| {
        let mut draws = Draws(seed);
        frames.mapv(|light| draws.poisson(20_000.0 * light))
    };
    for (method, shifts) in [DESIGNS[0], DESIGNS[2]] {
        let scene = scene([40 * shifts.len() as u32, 60], shifts);
        let flat = frames(&scene, &|_, _| AIR);
        let truth = [0.8, 1e-6, 0.0];
        let sample = frames(&scene, &|_, _| truth);
        let options = RetrieveOptions::default().with_method(method).with_gain(1.0);
        let found = retrieve(&scene, &drawn(&flat, 1), &drawn(&sample, 2), &options).unwrap();
        for (name, truth) in ["transmission", "refraction", "dark_field"].into_iter().zip(truth) {
            if method == Method::TwoStep && name == "dark_field" {
                continue;
            }
            let values = image(&found, name);
            let sigma = image(&found, &format!("{name}_sigma"));
            let mut pulls: Vec<f64> =
                values.iter().zip(&sigma).map(|(value, sigma)| (value - truth) / sigma).collect();
            let all = pulls.len();
            pulls.retain(|pull| pull.is_finite());
            assert!(pulls.len() * 100 > all * 99, "{method}, {name}: {} of {all}", pulls.len());
            let within = pulls.iter().filter(|pull| pull.abs() < 1.0).count() as f64;
            let share = within / pulls.len() as f64;
            assert!((share - 0.683).abs() < 0.03, "{method}, {name}: {share}");
            let mean = pulls.iter().sum::<f64>() / pulls.len() as f64;
            assert!(mean.abs() < 0.1, "{method}, {name}: mean {mean} sigma");
        }
    }
}

#[test]
fn groups_refuse_parts_of_the_pixels_and_shifts_that_form_no_curve() {
    let scene = scene([12, 1], &[-10.0, 0.0, 10.0]);
    let flat = frames(&scene, &|_, _| AIR);
    let options = RetrieveOptions::default();
    assert_eq!(retrieve(&scene, &flat, &flat, &options).unwrap().record.method, "exact-curve");
    let free = support::free_gaussian();
    let error = retrieve(&scene, &flat, &flat, &free).unwrap_err().to_string();
    assert!(error.contains("3 offsets") && error.contains("three-step"), "{error}");
    // A retriever takes the frames of groups.
    let mut retriever = Retriever::new(&engine(Backend::Bvh), &scene, &options).unwrap();
    let frames = Array3::<f32>::zeros((1, 1, 12));
    let error = retriever.set_flat_array(frames.view()).unwrap_err().to_string();
    assert!(error.contains("3 offsets for 1 frames"), "{error}");
    let open = || stack("flat", flat.mapv(|value| value as f32));
    let input = Input::simulated(&scene, open(), open());
    let error = input.with_selection(None, Some([3, 1])).unwrap_err().to_string();
    assert!(error.contains("groups of 3 columns"), "{error}");
}

/// One aperture in front of every second pixel: the others are left out without `--columns`.
#[test]
fn skipped_masks_keep_the_columns_behind_apertures() {
    let mut scene = scene([9, 1], &[]);
    let [first, second] =
        [&mut scene.sample_mask, &mut scene.detector_mask].map(|mask| mask.as_mut().unwrap());
    (first.period, second.period) = (200e-6, 300e-6);
    scene.scan = Scan::new((-3..=3).map(|step| 8e-6 * f64::from(step)).collect(), vec![0.0]);
    let skipped = |of: Contrasts| {
        let mut all = frames(&scene, &|_, _| of);
        for (column, mut values) in all.axis_iter_mut(ndarray::Axis(3)).enumerate() {
            // Nine columns: period k lies before column 4 + 2 (k - 4).
            if column % 2 == 1 {
                values.fill(0.0);
            }
        }
        all
    };
    let options = RetrieveOptions::default().with_method(Method::ExactCurve);
    let found = retrieve(&scene, &skipped(AIR), &skipped([0.7, 2e-6, 0.0]), &options).unwrap();
    assert_eq!(found.record.kept_columns.as_deref(), Some("0::2"));
    assert_eq!(found.record.shape, [1, 1, 5]);
    assert!(image(&found, "flags").iter().all(|flags| *flags == 0.0));
    assert!(image(&found, "refraction").iter().all(|angle| (angle / 2e-6 - 1.0).abs() < 2e-3));
}
