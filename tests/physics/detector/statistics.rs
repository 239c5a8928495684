//! Statistics of counts: mean, variance and covariance by z-tests over pixels.

use super::z_test::Scores;
use crate::reference::scenes;
use crate::reference::stack::Setup;
use crate::reference::surfaces::{body, cylinder};
use crate::support::{CARBON, engine};
use beamlet::internals::detector::Noise;
use beamlet::scene::{Counts, DetectorMode, Exposure, Scene};
use beamlet::{Backend, Cancel};
use ndarray::{Array3, ArrayView2, Axis, s};

const STEPS: usize = 4;

/// Stacks by name.
type Stacks = Vec<(&'static str, Array3<f32>)>;

fn scene(pixels: [u32; 2], steps: usize, counts: Counts) -> Scene {
    let offsets: Vec<f64> = (0..steps).map(|i| i as f64 * 1e-6).collect();
    let mut scene = scenes::scene(&Setup::paper(pixels), &[], &offsets);
    scene.detector.counts = Some(counts);
    scene
}

/// Counts of an even intensity of 1/2.
fn frames(scene: &Scene, excess: f64, view: Exposure) -> Array3<f32> {
    let [columns, rows] = scene.detector.pixels.map(|n| n as usize);
    let even = Array3::from_elem((scene.scan.mask_offsets.len(), rows, columns), 0.5_f32);
    let noise = Noise::of(scene, excess).unwrap().unwrap();
    noise.counts(view, 0, even.view(), &Cancel::default()).unwrap().numbers
}

/// Values of a frame less their mean, over their standard deviation.
fn standard(frame: ArrayView2<'_, f32>, mean: f64, deviation: f64) -> Vec<f64> {
    frame.iter().map(|count| (f64::from(*count) - mean) / deviation).collect()
}

/// All claims about frames of Poisson numbers of one mean.
fn poisson_scores(mean: f64, stacks: &[(&str, Array3<f32>)]) -> Scores {
    let mut scores = Scores::default();
    let z = |frame: ArrayView2<'_, f32>| standard(frame, mean, mean.sqrt());
    for (name, stack) in stacks {
        for (step, frame) in stack.outer_iter().enumerate() {
            let what = format!("{name}, step {step}");
            scores.take_moments(&what, &z(frame), 3.0 + 1.0 / mean);
            let right = [z(frame.slice(s![.., 1..])), z(frame.slice(s![.., ..-1]))];
            scores.take_covariance(&format!("{what}, neighbours in x"), &right[0], &right[1]);
            let below = [z(frame.slice(s![1.., ..])), z(frame.slice(s![..-1, ..]))];
            scores.take_covariance(&format!("{what}, neighbours in z"), &below[0], &below[1]);
            if step > 0 {
                let before = z(stack.index_axis(Axis(0), step - 1));
                scores.take_covariance(&format!("{what} and before"), &z(frame), &before);
            }
        }
    }
    for (i, (one, a)) in stacks.iter().enumerate() {
        for (other, b) in &stacks[..i] {
            for (step, (a, b)) in a.outer_iter().zip(b.outer_iter()).enumerate() {
                let what = format!("{one} and {other}, step {step}");
                scores.take_covariance(&what, &z(a), &z(b));
            }
        }
    }
    scores
}

fn stacks(scene: &Scene) -> Stacks {
    [("flat", Exposure::Flat(0)), ("view 0", Exposure::Sample(0)), ("view 1", Exposure::Sample(1))]
        .map(|(name, view)| (name, frames(scene, 1.0, view)))
        .to_vec()
}

#[test]
fn counts_are_independent_poisson_numbers() {
    for mean in [0.5, 5.0, 50.0, 5000.0, 1e6] {
        let scene = scene([160, 128], STEPS, Counts::of_photons(2.0 * mean));
        poisson_scores(mean, &stacks(&scene)).judge(&format!("detector, counts of mean {mean}"));
    }
}

/// The same claims are refuted where they do not hold.
#[test]
fn wrong_statistics_are_found_out() {
    let mean = 50.0;
    let good = stacks(&scene([160, 128], STEPS, Counts::of_photons(2.0 * mean)));
    let fails = |what: &str, change: &dyn Fn(&mut Stacks)| {
        let mut changed = good.clone();
        change(&mut changed);
        let scores = poisson_scores(mean, &changed);
        assert!(scores.worst().0 > 1.0, "{what} was not found");
    };
    assert!(poisson_scores(mean, &good).worst().0 < 1.0);
    fails("a mean 0.6 % too high", &|stacks| stacks[0].1 *= 1.006);
    fails("a variance 7 % too high", &|stacks| {
        stacks[1].1.mapv_inplace(|count| 50.0 + (count - 50.0) * 1.035);
    });
    fails("a frame twice", &|stacks| {
        let copy = stacks[0].1.index_axis(Axis(0), 1).to_owned();
        stacks[0].1.index_axis_mut(Axis(0), 2).assign(&copy);
    });
    fails("the noise of the flat in the sample", &|stacks| {
        let part = stacks[0].1.slice(s![0, ..8, ..]).to_owned();
        stacks[2].1.slice_mut(s![0, ..8, ..]).assign(&part);
    });
    fails("neighbours that vary together", &|stacks| {
        let next = stacks[0].1.slice(s![0, .., 1..]).to_owned();
        let mut frame = stacks[0].1.slice_mut(s![0, .., ..-1]);
        frame.zip_mut_with(&next, |a, b| *a = 50.0 + 0.998 * (*a - 50.0) + 0.06 * (b - 50.0));
    });
    fails("one value that cannot be", &|stacks| stacks[0].1[[0, 3, 5]] = 5e4);
}

/// Each pixel by itself over many steps: no place is special.
#[test]
fn every_pixel_has_its_mean() {
    for mean in [0.5, 50.0, 1e6] {
        let scene = scene([48, 32], 400, Counts::of_photons(2.0 * mean));
        let stack = frames(&scene, 1.0, Exposure::Sample(7));
        let score = |stack: &Array3<f32>| {
            let mut scores = Scores::default();
            for ((row, column), sum) in stack.mapv(f64::from).sum_axis(Axis(0)).indexed_iter() {
                let score = (sum - 400.0 * mean) / (400.0 * mean).sqrt();
                scores.take(format!("row {row}, column {column}"), score);
            }
            scores
        };
        score(&stack).judge(&format!("detector, pixels of mean {mean} over 400 steps"));
        // A pixel that is 10 deviations of its mean over the steps too bright is found.
        let mut hot = stack;
        let brighter = (10.0 * (mean / 400.0).sqrt()) as f32;
        hot.slice_mut(s![.., 20, 11]).mapv_inplace(|count| count + brighter);
        let scores = score(&hot);
        let (worst, place) = scores.worst();
        assert!(worst > 1.0 && place == "row 20, column 11", "{worst} {place}");
    }
}

#[test]
fn dark_frames_hold_offset_and_electronic_noise_of_their_own() {
    let counts =
        Counts::of_photons(1e-9).with_electronic_noise(2.5).with_offset(100.0).with_bit_depth(16);
    let scene = scene([160, 128], STEPS, counts);
    let dark = Noise::of(&scene, 1.0)
        .unwrap()
        .unwrap()
        .dark(0, 0..128, &Cancel::default())
        .unwrap()
        .numbers;
    // Without photons the flat is another dark frame; rounding adds 1/12.
    let flat = frames(&scene, 1.0, Exposure::Flat(0));
    let deviation = (2.5_f64 * 2.5 + 1.0 / 12.0).sqrt();
    let z = |frame: ArrayView2<'_, f32>| standard(frame, 100.0, deviation);
    let mut scores = Scores::default();
    for step in 0..STEPS {
        let [dark, flat] = [&dark, &flat].map(|stack| z(stack.index_axis(Axis(0), step)));
        scores.take_moments(&format!("dark, step {step}"), &dark, 3.0);
        scores.take_moments(&format!("flat, step {step}"), &flat, 3.0);
        scores.take_covariance(&format!("dark and flat, step {step}"), &dark, &flat);
    }
    let [a, b] = [0, 1].map(|step| z(dark.index_axis(Axis(0), step)));
    scores.take_covariance("dark of two steps", &a, &b);
    scores.judge("detector, dark frames");
    assert!(dark.iter().all(|number| number.fract() == 0.0));
}

/// Photons, gain, offset and electronic noise add up.
#[test]
fn gain_offset_and_electronic_noise_make_the_numbers() {
    let counts =
        Counts::of_photons(400.0).with_electronic_noise(30.0).with_gain(4.0).with_offset(-50.0);
    let scene = scene([160, 128], STEPS, counts);
    let stack = frames(&scene, 1.0, Exposure::Flat(0));
    let (mean, variance) = (4.0 * 200.0 - 50.0, 16.0 * 200.0 + 900.0_f64);
    let mut scores = Scores::default();
    // Fourth cumulant of the photons alone.
    let kurtosis = 3.0 + 256.0 * 200.0 / (variance * variance);
    for frame in stack.outer_iter() {
        scores.take_moments("numbers", &standard(frame, mean, variance.sqrt()), kurtosis);
    }
    scores.judge("detector, gain, offset and electronic noise");
}

#[test]
fn integrating_detector_has_the_excess_noise_of_its_swank_factor() {
    for (photons, swank) in [(4.0, 0.5), (100.0, 0.8), (2e4, 0.9), (100.0, 1.0)] {
        let mut scene = scene([160, 128], STEPS, Counts::of_photons(photons).with_swank(swank));
        scene.detector.mode = DetectorMode::Integrating;
        let excess = beamlet::internals::detector::excess_noise(&scene.detector, &[[30.0, 1.0]]);
        assert!((excess - 1.0 / swank).abs() < 1e-12);
        let stack = frames(&scene, excess, Exposure::Flat(0));
        let mean = 0.5 * photons;
        let variance = mean / swank;
        // Cumulants of a compound Poisson number: the mean number of photons times the moments of
        // one photon's signal, here of a gamma number of mean 1 and variance `spread`.
        let spread = excess - 1.0;
        let fourth = (1.0 + spread) * (1.0 + 2.0 * spread) * (1.0 + 3.0 * spread);
        let kurtosis = 3.0 + mean * fourth / (variance * variance);
        let mut scores = Scores::default();
        for frame in stack.outer_iter() {
            scores.take_moments("signal", &standard(frame, mean, variance.sqrt()), kurtosis);
        }
        scores.judge(&format!("detector, Swank factor {swank}, {photons} photons"));
        // No photon, no signal.
        if photons < 10.0 {
            let none = stack.iter().filter(|signal| **signal == 0.0).count() as f64;
            let (n, p) = (stack.len() as f64, (-mean).exp());
            let score = (none - n * p) / (n * p * (1.0 - p)).sqrt();
            assert!(score.abs() < 4.0, "{none} of {n} without signal: score {score}");
        }
    }
}

#[test]
fn bit_depth_rounds_and_clips_and_saturation_is_counted() {
    let free =
        Counts::of_photons(240.0).with_electronic_noise(20.0).with_gain(2.0).with_offset(0.0);
    let clipped = free.with_bit_depth(8);
    let scenes = [free, clipped].map(|counts| scene([64, 32], STEPS, counts));
    let [free, numbers] = scenes.each_ref().map(|scene| frames(scene, 1.0, Exposure::Flat(0)));
    for (number, free) in numbers.iter().zip(&free) {
        // f32 holds the unrounded number to 1e-5: ties may round either way.
        let want = free.clamp(0.0, 255.0);
        assert!((number - want).abs() <= 0.5 + 1e-4 && number.fract() == 0.0, "{number} of {free}");
    }
    let noise = Noise::of(&scenes[1], 1.0).unwrap().unwrap();
    let even = Array3::from_elem((STEPS, 32, 64), 0.5_f32);
    let clipped =
        noise.counts(Exposure::Flat(0), 0, even.view(), &Cancel::default()).unwrap().clipped;
    assert_eq!(clipped.high, free.iter().filter(|number| number.round() > 255.0).count() as u64);
    assert!(clipped.high > 1000);
    // Without light and offset half of the electronic noise is below zero.
    let dark = noise.dark(0, 0..32, &Cancel::default()).unwrap();
    let lows = frames_without_light(&scenes[0]);
    assert_eq!(dark.clipped.low, lows.iter().filter(|number| number.round() < 0.0).count() as u64);
    let share = dark.clipped.low as f64 / dark.numbers.len() as f64;
    assert!((0.45..0.53).contains(&share), "{share}");
}

/// Numbers of the dark frames.
fn frames_without_light(scene: &Scene) -> Array3<f32> {
    let rows = 0..scene.detector.pixels[1];
    Noise::of(scene, 1.0).unwrap().unwrap().dark(0, rows, &Cancel::default()).unwrap().numbers
}

/// An offset that the scene does not have is one that no electronic noise reaches below: the mean of
/// the light is that of its frames less the mean of the dark frames.
#[test]
fn default_offset_clips_no_number_and_keeps_the_mean_of_faint_light() {
    for (photons, noise, gain) in [(4.0, 20.0, 1.0), (40.0, 2.5, 0.5), (1.0, 300.0, 7.0)] {
        let counts = Counts::of_photons(photons).with_electronic_noise(noise).with_gain(gain);
        let scene = scene([160, 128], STEPS, counts.with_bit_depth(16));
        let made = Noise::of(&scene, 1.0).unwrap().unwrap();
        let even = Array3::from_elem((STEPS, 128, 160), 0.5_f32);
        let flat = made.counts(Exposure::Flat(0), 0, even.view(), &Cancel::default()).unwrap();
        let dark = made.dark(0, 0..128, &Cancel::default()).unwrap();
        for (name, frame) in [("flat", &flat), ("dark", &dark)] {
            assert_eq!([frame.clipped.low, frame.clipped.high], [0, 0], "{name}, noise {noise}");
        }
        let mean = |numbers: &Array3<f32>| {
            numbers.iter().map(|number| f64::from(*number)).sum::<f64>() / numbers.len() as f64
        };
        let got = mean(&flat.numbers) - mean(&dark.numbers);
        // Rounding adds 1/12 to the variance of either.
        let variance = gain * gain * 0.5 * photons + 2.0 * (noise * noise + 1.0 / 12.0);
        let score = (got - 0.5 * photons * gain) / (variance / flat.numbers.len() as f64).sqrt();
        assert!(score.abs() < 4.0, "photons {photons}, noise {noise}: {got}, score {score}");
    }
    // Without a bit depth nothing is clipped.
    let counts = Counts::of_photons(1.0).with_electronic_noise(10.0);
    assert_eq!(counts.number_without_light().to_bits(), 0.0_f64.to_bits());
    assert_eq!(counts.with_bit_depth(12).number_without_light().to_bits(), 83.0_f64.to_bits());
    let given = counts.with_bit_depth(12).with_offset(5.0);
    assert_eq!(given.number_without_light().to_bits(), 5.0_f64.to_bits());
}

/// A whole run: counts scatter about the intensities that lie beside them.
#[test]
fn counts_of_a_run_scatter_about_its_intensities() {
    let rod = body(cylinder(0.35e-3, 10e-3, 64, 0.1), CARBON[0], CARBON[1]);
    let mut scene = scenes::scene(&Setup::paper([32, 24]), &[rod], &[-12e-6, 0.0, 9e-6]);
    scene.detector.counts = Some(Counts::of_photons(3000.0).with_offset(10.0));
    scene.scan.angles = vec![0.0, 0.4];
    let stacks = engine(Backend::Bvh).simulate(&scene).unwrap();
    let counts = stacks.counts.unwrap();
    let mut scores = Scores::default();
    let mut take = |what: &str, counts: ArrayView2<'_, f32>, light: ArrayView2<'_, f32>| {
        let z: Vec<f64> = counts
            .iter()
            .zip(&light)
            .map(|(count, light)| {
                let mean = 3000.0 * f64::from(*light);
                (f64::from(*count) - 10.0 - mean) / mean.sqrt()
            })
            .collect();
        scores.take_moments(what, &z, 3.0 + 1.0 / 400.0);
    };
    for step in 0..3 {
        let at = s![step, .., ..];
        take("flat", counts.flat.slice(at), stacks.flat.slice(at));
        for view in 0..2 {
            let at = s![view, step, .., ..];
            take("sample", counts.sample.slice(at), stacks.sample.slice(at));
        }
    }
    scores.judge("detector, counts of a run");
    assert!(counts.dark.iter().all(|number| number.to_bits() == 10.0_f32.to_bits()));
    assert_eq!(counts.dark.dim(), counts.flat.dim());
}
