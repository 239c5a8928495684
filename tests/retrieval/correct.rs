//! Corrections by empty beam: errors of a scan are found and undone.

use crate::lab_faults::{self, CYLINDER, ELEVEN, PAPER, PIXELS};
use crate::reference::draws::Draws;
use crate::stacks::measured;
use crate::support::{engine, free_gaussian};
use beamlet::Backend;
use beamlet::retrieve::{
    Corrections, Method, Region, RetrieveOptions, RetrievedArrays, Weights, flags,
};
use beamlet::scene::Scene;
use ndarray::{Array3, Array4};
use std::sync::LazyLock;

/// Displacements of the mask, um, with a deviation of 2 um.
const JITTER: [f64; 11] = [1.3, -2.4, 2.9, -0.7, 1.9, -2.8, 0.6, -1.6, 3.1, -2.2, 0.9];
/// Doses with a deviation of 3 %.
const DOSES: [f64; 11] = [1.03, 0.96, 1.01, 0.99, 1.04, 0.97, 1.035, 0.955, 1.02, 0.98, 1.01];

fn list(values: impl IntoIterator<Item = f64>, unit: &str) -> String {
    let quoted = |value: f64| match unit {
        "" => format!("{value}"),
        unit => format!("\"{value} {unit}\""),
    };
    values.into_iter().map(quoted).collect::<Vec<_>>().join(", ")
}

/// A cylinder before 64 columns; `errors` of the scan, and its view.
fn scene(masks: &str, pixels: &str, scan: &str, errors: &str) -> Scene {
    lab_faults::scene(pixels, &format!("{ELEVEN}\n{scan}\n{errors}"), masks, CYLINDER)
}

/// Intensities, or counts of a dose.
#[derive(Clone)]
struct Data {
    scene: Scene,
    flat: Array3<f32>,
    sample: Array4<f32>,
}

impl Data {
    fn of(scene: &Scene) -> Self {
        let stacks = engine(Backend::Bvh).simulate(scene).unwrap();
        let mut scene = scene.clone();
        // The scan as it was to be.
        scene.scan.errors = beamlet::scene::ScanErrors::default();
        Self { scene, flat: stacks.flat, sample: stacks.sample }
    }

    fn counts(&self, photons: f64, seed: u64) -> Self {
        let mut draws = Draws(seed);
        let mut count = |y: f32| draws.poisson(f64::from(y) * photons) as f32;
        let (flat, sample) = (self.flat.mapv(&mut count), self.sample.mapv(&mut count));
        Self { scene: self.scene.clone(), flat, sample }
    }

    fn retrieved(&self, options: &RetrieveOptions) -> beamlet::Result<RetrievedArrays> {
        let flat = self.flat.clone().insert_axis(ndarray::Axis(0));
        measured(&self.scene, [&flat, &self.sample], options)
    }
}

/// The scan without errors, for all tests.
fn sound() -> &'static Data {
    static SOUND: LazyLock<Data> = LazyLock::new(|| Data::of(&scene(PAPER, PIXELS, "", "")));
    &SOUND
}

fn options(method: Method, correct: &str, is_counts: bool) -> RetrieveOptions {
    let correct = match correct {
        "" => Corrections::default(),
        names => Corrections::parse(names).unwrap(),
    };
    let options = free_gaussian()
        .with_method(method)
        .with_correct(correct)
        .with_empty_beam(Region::new(2..16, None));
    match is_counts {
        true if method == Method::Gaussian => options.with_weights(Weights::Poisson).with_gain(1.0),
        true => options.with_gain(1.0),
        false => options,
    }
}

/// Rms difference of two images in pixels that both have without a flag, outside of the empty beam.
fn apart(a: &RetrievedArrays, b: &RetrievedArrays, name: &str) -> f64 {
    // Curves of uncorrected frames are doubtful.
    let flags =
        |of: &RetrievedArrays| of.images["flags"].mapv(|bits| bits as u32 & !flags::DOUBTFUL);
    let (of_a, of_b) = (flags(a), flags(b));
    let (mut sum, mut count) = (0.0, 0.0);
    for (at, value) in a.images[name].indexed_iter() {
        if of_a[at] == 0 && of_b[at] == 0 && at.2 > 17 {
            sum += f64::from(value - b.images[name][at]).powi(2);
            count += 1.0;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Root mean square of differences from the truth, and of these over their uncertainties.
fn errors(found: &[Option<[f64; 2]>], truth: &[f64]) -> [f64; 3] {
    let known = found.iter().zip(truth).filter_map(|(pair, truth)| Some((pair.as_ref()?, truth)));
    let (mut squares, mut ratios, mut count) = (0.0, 0.0, 0.0);
    for ([value, sigma], truth) in known {
        squares += (value - truth).powi(2);
        ratios += ((value - truth) / sigma).powi(2);
        count += 1.0;
    }
    [(squares / count).sqrt(), (ratios / count).sqrt(), count]
}

fn of_scan(jitter: bool, dose: bool) -> String {
    let mut keys = Vec::new();
    if jitter {
        keys.push(format!("mask_offsets = [[{}]]", list(JITTER, "um")));
    }
    if dose {
        keys.push(format!("intensities = [[{}]]", list(DOSES, "")));
    }
    format!("errors = {{ {} }}", keys.join(", "))
}

/// Curves of neighbouring columns lie 0.6 um apart.
fn fringe() -> String {
    PAPER.replace("[detector_mask]", "period = \"100.6 um\"\n\n[detector_mask]")
}

const CONTRASTS: [&str; 2] = ["transmission", "refraction"];

/// Errors of transmission and refraction, corrected and uncorrected, over the errors by noise.
fn over_noise(
    plain: &Data,
    faulty: &Data,
    correct: &str,
    method: Method,
    photons: f64,
) -> [[f64; 2]; 2] {
    let reference = plain.retrieved(&options(method, "", false)).unwrap();
    let of = |data: &Data, correct: &str| {
        data.counts(photons, 5).retrieved(&options(method, correct, true)).unwrap()
    };
    let images = [of(plain, ""), of(faulty, correct), of(faulty, "")];
    CONTRASTS.map(|name| {
        let [noise, found, raw] = [0, 1, 2].map(|at| apart(&images[at], &reference, name));
        println!("{correct}, {method}, {photons}: {name} {found:e}, raw {raw:e}, noise {noise:e}");
        [found / noise, raw / noise]
    })
}

#[test]
fn jitter_of_2_um_is_found_to_a_tenth_and_undone() {
    let plain = sound();
    let faulty = Data::of(&scene(PAPER, PIXELS, "", &of_scan(true, false)));
    let truth = JITTER.map(|at| 1e-6 * at);
    for (data, is_counts) in [(faulty.counts(2e4, 2), true), (faulty.clone(), false)] {
        let found = data.retrieved(&options(Method::ExactCurve, "steps", is_counts)).unwrap();
        let steps = &found.record.corrections[0].steps;
        let [rms, deviations, known] = errors(steps, &truth);
        println!("jitter: {rms:e} m, {deviations} deviations, {known} of 11: {steps:?}");
        assert!(rms < 0.2e-6 && deviations < 2.0 && known > 9.0, "{rms:e} {deviations} {known}");
        let warnings = found.record.warnings.join("\n");
        assert!(!warnings.contains("or the mask offsets are off"), "{warnings}");
    }
    for method in [Method::ExactCurve, Method::Gaussian] {
        for [found, raw] in over_noise(plain, &faulty, "steps", method, 2e4) {
            // The bias of a Gaussian depends on the offsets.
            let most = if method == Method::Gaussian { 1.7 } else { 1.15 };
            assert!(found < most && raw > 1.5 && found < 0.7 * raw, "{method}: {found} {raw}");
        }
    }
}

#[test]
fn doses_of_3_percent_are_found_to_a_tenth_and_undone() {
    let plain = sound();
    let faulty = Data::of(&scene(PAPER, PIXELS, "", &of_scan(false, true)));
    for (data, is_counts) in [(faulty.counts(1e6, 2), true), (faulty.clone(), false)] {
        let found = data.retrieved(&options(Method::Gaussian, "dose", is_counts)).unwrap();
        let dose = &found.record.corrections[0].dose;
        let [rms, deviations, known] = errors(dose, &DOSES);
        println!("dose: {rms:e}, {deviations} deviations, {known} of 11: {dose:?}");
        assert!(rms < 3e-3 && deviations < 2.0 && known > 10.0, "{rms:e} {deviations} {known}");
    }
    for [found, raw] in over_noise(plain, &faulty, "dose", Method::Gaussian, 2e4) {
        assert!(found < 1.15 && raw > found, "{found} {raw}");
    }
}

#[test]
fn doses_and_jitter_together_keep_to_their_uncertainties() {
    for masks in [PAPER, &fringe()] {
        let faulty = Data::of(&scene(masks, PIXELS, "", &of_scan(true, true)));
        let truth = JITTER.map(|at| 1e-6 * at);
        for photons in [2e4, 1e6] {
            let options = options(Method::ExactCurve, "dose,steps", true);
            // Without a fringe nothing may be known.
            let found = match faulty.counts(photons, 3).retrieved(&options) {
                Ok(found) => found,
                Err(error) => {
                    println!("{error}");
                    assert!(masks == PAPER && error.to_string().contains("unknown"), "{error}");
                    continue;
                }
            };
            let view = &found.record.corrections[0];
            for (values, truth) in [(&view.steps, &truth), (&view.dose, &DOSES)] {
                let [rms, deviations, known] = errors(values, truth);
                println!("{photons}: {rms:e}, {deviations} deviations, {known} of 11");
                assert!(known == 0.0 || deviations < 2.5, "{deviations}");
            }
        }
        if masks != PAPER {
            let plain = &Data::of(&scene(masks, PIXELS, "", ""));
            for [found, raw] in over_noise(plain, &faulty, "dose,steps", Method::ExactCurve, 2e4) {
                // Both unknowns of a frame rest on the fringe alone.
                assert!(found < 2.5 && found < 0.7 * raw, "{found} {raw}");
            }
        }
    }
}

#[test]
fn sound_scans_stay_as_they_are_within_the_uncertainties() {
    let plain = sound();
    for (photons, method) in [(2e4, Method::Gaussian), (1e6, Method::ExactCurve)] {
        let data = plain.counts(photons, 4);
        let raw = data.retrieved(&options(method, "", true)).unwrap();
        for correct in ["steps", "dose", "dose,steps", "offset,plane", "offset,plane,dose,steps"] {
            let found = match data.retrieved(&options(method, correct, true)) {
                Ok(found) => found,
                Err(error) => panic!("{correct}: {error}"),
            };
            let view = &found.record.corrections[0];
            for (values, truth) in [(&view.steps, 0.0), (&view.dose, 1.0)] {
                for [value, sigma] in values.iter().flatten() {
                    assert!((value - truth).abs() < 4.5 * sigma, "{correct}: {value} {sigma}");
                }
            }
            for name in CONTRASTS {
                let noise = raw.images[&format!("{name}_sigma")].iter().copied();
                let noise = noise.filter(|value| value.is_finite()).fold(f32::INFINITY, f32::min);
                let moved = apart(&found, &raw, name) / f64::from(noise);
                println!("{correct}, {method}, {photons}: {name} moved by {moved} of the noise");
                // A plane reaches from 14 columns over 46 others.
                let most = if correct.contains("plane") { 2.0 } else { 0.7 };
                assert!(moved < most, "{correct}, {name}: {moved}");
            }
        }
    }
}

#[test]
fn a_drift_and_a_plane_are_subtracted() {
    let plain = sound();
    // The sample mask is stretched by 0.02 um a column between flat and sample, and displaced by 0.4 um.
    let masks = PAPER.replace(
        "[detector_mask]",
        "period = \"100.02 um\"\noffset = \"0.4 um\"\n\n[detector_mask]",
    );
    let moved = Data::of(&scene(&masks, PIXELS, "", ""));
    let faulty = Data { flat: plain.flat.clone(), ..moved };
    let reference = plain.retrieved(&options(Method::ExactCurve, "", false)).unwrap();
    let raw = faulty.retrieved(&options(Method::ExactCurve, "", false)).unwrap();
    let found = faulty.retrieved(&options(Method::ExactCurve, "plane", false)).unwrap();
    let view = &found.record.corrections[0];
    let plane = view.plane.unwrap();
    println!("{:?} {plane:?}", view.offset);
    // Curves move against the displacement of the mask: M/z times that.
    let angle = found.record.angle_per_shift;
    let slope = -angle * 0.02e-6 / 150e-6;
    assert!((plane.x[0] / slope - 1.0).abs() < 0.02, "{plane:?} {slope:e}");
    let [offset, _] = view.offset.unwrap();
    assert!((offset / (-angle * 0.4e-6) - 1.0).abs() < 0.02, "{offset:e}");
    let [left, before] = [&found, &raw].map(|images| apart(images, &reference, "refraction"));
    println!("refraction {left:e}, uncorrected {before:e}");
    // The light of a pixel passes the sample elsewhere, by up to 1 um.
    assert!(left < 0.05 * before && left < 2e-8, "{left:e} {before:e}");
}

#[test]
fn empty_beam_is_found_at_both_sides_or_asked_for() {
    let faulty = Data::of(&scene(PAPER, PIXELS, "", &of_scan(false, true))).counts(2e4, 6);
    let options = options(Method::Gaussian, "dose,offset", true).with_empty_beam(None);
    let found = faulty.retrieved(&options).unwrap();
    let view = &found.record.corrections[0];
    assert_eq!(view.empty_beam.len(), 2);
    assert_eq!(view.empty_beam[0][0], 0);
    assert_eq!(view.empty_beam[1][1], 64);
    let [_, deviations, _] = errors(&view.dose, &DOSES);
    assert!(deviations < 2.0, "{deviations}");
    // A body that fills the field.
    let full = scene(PAPER, "pixels = [16, 8]\npitch = \"150 um\"", "", "");
    let full = Data::of(&full).counts(2e4, 7);
    let error = full.retrieved(&options).unwrap_err().to_string();
    assert!(error.contains("no empty beam at both sides of view 0"), "{error}");
}

impl Data {
    /// The sample at a part of the light of the flat.
    fn with_dose(&self, dose: f32) -> Self {
        Self { sample: self.sample.mapv(|y| dose * y), ..self.clone() }
    }

    /// Expected counts.
    fn times(&self, photons: f32) -> Self {
        let all = |y: f32| photons * y;
        Self { scene: self.scene.clone(), flat: self.flat.mapv(all), sample: self.sample.mapv(all) }
    }
}

/// A quarter of the flat's light has four times the relative variance of counts: the deviations that are
/// given are the scatter, and chi squared is 1.
#[test]
fn uncertainties_after_dose_are_the_scatter() {
    let photons = 2e4;
    let faint = sound().with_dose(0.25);
    for method in [Method::Gaussian, Method::ExactCurve] {
        let options = options(method, "dose", true);
        // The same fit of expected counts has the same bias.
        let expected = faint.times(photons as f32).retrieved(&options).unwrap();
        let found = faint.counts(photons, 8).retrieved(&options).unwrap();
        for name in CONTRASTS {
            let sigma = &found.images[&format!("{name}_sigma")];
            let (mut squares, mut count) = (0.0, 0.0);
            for (at, value) in found.images[name].indexed_iter() {
                let is_clear = |of: &RetrievedArrays| of.images["flags"][at] < 0.5;
                if is_clear(&found) && is_clear(&expected) && at.2 > 17 {
                    let off = f64::from(value - expected.images[name][at]);
                    squares += (off / f64::from(sigma[at])).powi(2);
                    count += 1.0;
                }
            }
            let ratio = (squares / count).sqrt();
            println!("{method}: {name} scatters by {ratio:.3} deviations, {count} pixels");
            // Some 600 pixels scatter by 3 %; without a dose the ratio is 0.9 to 1. The divided values taken as
            // counts have 1.4 to 1.6.
            assert!(count > 400.0 && (ratio - 1.0).abs() < 0.2, "{method}: {name} {ratio}");
        }
        if method == Method::ExactCurve {
            let chi_square = found.record.reduced_chi_square.unwrap();
            // The divided values taken as counts have 4.
            assert!((chi_square - 1.0).abs() < 0.3, "{chi_square}");
        }
    }
}

/// The saturation of the library is a value of frames before the division by their doses.
#[test]
fn a_dose_saturates_no_value() {
    let mut faint = sound().with_dose(0.75);
    let most = faint.flat.iter().copied().fold(0.0, f32::max);
    // Beside the empty beam the light is 1.5 times as bright: there the flat saturates, and no sample.
    faint.flat.slice_mut(ndarray::s![.., .., 20..]).mapv_inplace(|y| 1.5 * y);
    faint.sample.slice_mut(ndarray::s![.., .., .., 20..]).mapv_inplace(|y| 1.5 * y);
    let brightest = faint.sample.iter().copied().fold(0.0, f32::max);
    let saturation = 1.3 * most;
    assert!(brightest < saturation, "{brightest} {saturation}");
    let options = options(Method::Gaussian, "dose", false).with_saturation(saturation);
    let found = faint.retrieved(&options).unwrap();
    let bits = |shift: u32| {
        let bit = f64::from(flags::SATURATED << shift);
        let is_set = |flags: &&f32| (f64::from(**flags) / bit).floor() % 2.0 > 0.5;
        found.images["flags"].iter().filter(is_set).count()
    };
    let [of_flat, of_sample] = [bits(0), bits(flags::BITS)];
    assert!(of_flat > 100 && of_sample == 0, "{of_flat} {of_sample}");
    for saturation in [0.0, -1.0, f32::NAN] {
        let options = options.clone().with_saturation(saturation);
        let message = faint.retrieved(&options).unwrap_err().to_string();
        assert!(message.contains("a finite number above 0"), "{message}");
    }
}

#[test]
fn what_cannot_be_determined_is_an_error() {
    let plain = sound();
    let refused = |correct: &str, region: Region, words: &str| {
        let options = options(Method::Gaussian, correct, false).with_empty_beam(region);
        let error = plain.retrieved(&options).unwrap_err().to_string();
        assert!(error.contains(words), "{correct}: {error}");
    };
    refused("dose", Region::new(2..3, 0..4), "4 pixels with a curve");
    refused("offset", Region::new(2..3, 0..4), "4 pixels with a result");
    refused("plane", Region::new(2..3, None), "one row or column");
    refused("plane", Region::new(2..30, 3..4), "one row or column");
    let mut other = plain.clone();
    other.scene.detector.pixels = [60, 16];
    let error =
        other.retrieved(&options(Method::Gaussian, "plane", false)).unwrap_err().to_string();
    assert!(error.contains("[64, 16], the pixels of the frames"), "{error}");
    for (text, word) in [("", "\"\""), ("dose,plain", "\"plain\""), ("steps,", "\"\"")] {
        assert!(Corrections::parse(text).unwrap_err().to_string().contains(word));
    }
}
