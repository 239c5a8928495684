//! Faults of a laboratory: each is warned of, and sound data are not.

use crate::reference::draws::Draws;
use crate::stacks::{measured, retrieved, stack};
use crate::support::{engine, free_gaussian};
use beamlet::Backend;
use beamlet::retrieve::{Input, Method, Record, Region, RetrieveOptions, Weights};
use beamlet::scene::Scene;
use beamlet::stack::StackFile;
use ndarray::{Array3, Array4, Axis, Zip};
use ndarray_npy::write_npy;

/// A cylinder in the middle of 64 columns; `more` is added to the scene.
pub(super) fn scene(detector: &str, offsets: &str, masks: &str, object: &str) -> Scene {
    let text = format!(
        "{masks}\n[detector]\ndistance = \"1.8 m\"\n{detector}\n[scan]\nmask_offsets = {offsets}\n\
         [sampling]\ntolerance = 1e-4\nangle_tolerance = \"10 nrad\"\n\
         [materials.carbon]\nformula = \"C\"\ndensity = \"2.0 g/cm3\"\n[[object]]\nname = \"body\"\n\
         material = \"carbon\"\n{object}\n"
    );
    Scene::from_toml(&text, ".").unwrap()
}

pub(super) const PAPER: &str = include_str!("../support/masks.toml");
pub(super) const PIXELS: &str = "pixels = [64, 16]\npitch = \"150 um\"";
pub(super) const ELEVEN: &str = "{ from = \"-25 um\", to = \"25 um\", count = 11 }";
pub(super) const CYLINDER: &str =
    "shape = { cylinder = { radius = \"1.5 mm\", height = \"30 mm\" } }";

/// Intensities of flat and views.
#[derive(Clone)]
struct Truth {
    scene: Scene,
    flat: Array3<f32>,
    sample: Array4<f32>,
}

impl Truth {
    fn of(scene: Scene) -> Self {
        let stacks = engine(Backend::Bvh).simulate(&scene).unwrap();
        Self { scene, flat: stacks.flat, sample: stacks.sample }
    }

    fn cylinder(offsets: &str) -> Self {
        Self::of(scene(PIXELS, offsets, PAPER, CYLINDER))
    }

    /// Counts of this dose in an open pixel; without noise where it is 0.
    fn counts(&self, photons: f64, seed: u64) -> [Array4<f32>; 2] {
        let mut draws = Draws(seed);
        let mut count = |y: f32| match photons > 0.0 {
            true => draws.poisson(f64::from(y) * photons) as f32,
            false => 1e4 * y,
        };
        let flat = self.flat.clone().insert_axis(Axis(0));
        [flat.mapv(&mut count), self.sample.mapv(&mut count)]
    }
}

/// A retrieval of measured stacks.
fn record(scene: &Scene, [flat, sample]: [&Array4<f32>; 2], options: &RetrieveOptions) -> Record {
    of_stacks(scene, [stack("flat", flat.clone()), stack("sample", sample.clone())], options)
}

fn of_stacks(scene: &Scene, [flat, sample]: [StackFile; 2], options: &RetrieveOptions) -> Record {
    let input = Input::measured(scene, flat, sample, None).unwrap();
    let mut record = retrieved(input, options).unwrap().record;
    // The response of a method is no fault of the data.
    record.warnings.retain(|warning| !warning.contains("finds small contrasts"));
    record
}

/// Options for counts of known gain.
fn of_counts(method: Method) -> RetrieveOptions {
    let weighted = matches!(method, Method::Gaussian | Method::Beamlet);
    let weights = if weighted { Weights::Poisson } else { Weights::None };
    free_gaussian().with_method(method).with_weights(weights).with_gain(1.0)
}

fn warned(record: &Record, words: &[&str]) {
    let text = record.warnings.join("\n");
    for word in words {
        assert!(text.contains(word), "{word:?} is missing in:\n{text}");
    }
    assert!(!words.is_empty() || text.is_empty(), "{text}");
}

/// Name and scene of a set, and the methods and photons that it is retrieved with.
type SoundSet = (&'static str, Scene, Vec<(Method, f64)>);

/// Sets without faults.
fn sound_sets() -> Vec<SoundSet> {
    use Method::{Beamlet, ExactCurve, Gaussian, Moments, ThreeStep};
    let leaking = PAPER.replace("225 um", "40 um").replace("30 keV", "35 keV");
    let strong = PAPER.replace("1.2 m", "0.9 m").replace("1.21 m", "0.91 m");
    let fringe = PAPER.replace("[detector_mask]", "period = \"100.6 um\"\n\n[detector_mask]");
    let (alone, _) = PAPER.split_once("[detector_mask]").unwrap();
    let point = PAPER.replace("[\"30 um\", \"26 um\"]", "\"0 um\"");
    let ball = "shape = { sphere = { radius = \"0.7 mm\" } }\ncenter = true\n\
                position = [\"1 mm\", \"0 mm\", \"0 mm\"]";
    let wide = "shape = { cylinder = { radius = \"5 mm\", height = \"30 mm\" } }";
    let fine = "pixels = [320, 4]\npitch = \"15 um\"";
    let tracking = alone.replace("projected_aperture", "period = \"100 um\"\nprojected_aperture");
    let many = "{ from = \"-40 um\", to = \"40 um\", count = 21 }";
    vec![
        (
            "paper",
            scene(PIXELS, ELEVEN, PAPER, CYLINDER),
            vec![
                (Gaussian, 100.0),
                (Gaussian, 1e3),
                (Gaussian, 2e4),
                (Gaussian, 1e6),
                (Gaussian, 0.0),
                (ExactCurve, 2e4),
                (ExactCurve, 1e6),
            ],
        ),
        ("leaking", scene(PIXELS, ELEVEN, &leaking, ball), vec![(Gaussian, 5e3), (Gaussian, 2e5)]),
        ("strong", scene(PIXELS, ELEVEN, &strong, CYLINDER), vec![(Gaussian, 2e4)]),
        (
            "fringe",
            scene(PIXELS, ELEVEN, &fringe, CYLINDER),
            vec![(Gaussian, 2e4), (Gaussian, 1e6)],
        ),
        (
            "half scan",
            scene(PIXELS, "{ from = \"-30 um\", to = \"5 um\", count = 8 }", PAPER, CYLINDER),
            vec![(Gaussian, 2e4), (Gaussian, 1e6)],
        ),
        ("long scan", scene(PIXELS, many, PAPER, ball), vec![(Moments, 2e4), (Gaussian, 1e5)]),
        ("point", scene(PIXELS, ELEVEN, &point, CYLINDER), vec![(ExactCurve, 2e4)]),
        (
            "three",
            scene(PIXELS, "[\"-10 um\", \"0 um\", \"10 um\"]", PAPER, CYLINDER),
            vec![(ThreeStep, 2e4)],
        ),
        ("field inside of a body", scene(PIXELS, ELEVEN, PAPER, wide), vec![(Gaussian, 2e4)]),
        (
            "tracking",
            scene(fine, "[\"0 um\"]", &tracking, CYLINDER),
            vec![(Beamlet, 1e4), (Beamlet, 1e6), (Beamlet, 0.0)],
        ),
    ]
}

#[test]
fn sound_sets_have_no_warning() {
    let sets = sound_sets();
    let count: usize = sets.iter().map(|(.., runs)| runs.len()).sum();
    assert!(count >= 20, "{count}");
    let mut wrong = Vec::new();
    for (name, scene, runs) in sets {
        let truth = Truth::of(scene);
        for (method, photons) in runs {
            let [flat, sample] = truth.counts(photons, 11 + photons.to_bits());
            let options = match photons > 0.0 {
                true => of_counts(method),
                false => free_gaussian().with_method(method),
            };
            // Without weights and with a guessed gain, as stacks are retrieved where nothing is said.
            let plain = options.clone().with_weights(Weights::None).with_gain_assumed(true);
            for options in [options, plain] {
                let found = record(&truth.scene, [&flat, &sample], &options);
                let [own, beyond] = [found.reduced_chi_square, found.chi_square_beyond_flat];
                let weights = options.weights;
                println!(
                    "{name}, {method}, {weights:?}, {photons}: chi2 {own:?}, {beyond:?}, {:?}",
                    found.warnings
                );
                if !found.warnings.is_empty() {
                    wrong.push(format!("{name}, {method}, {photons}: {:?}", found.warnings));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn faults_are_warned_of_with_their_size() {
    let truth = Truth::cylinder(ELEVEN);
    let options = of_counts(Method::Gaussian);
    let moved = Truth::cylinder("{ from = \"-24 um\", to = \"26 um\", count = 11 }");
    let unsteady =
        ["-24.6", "-19.4", "-15.5", "-9.3", "-5.6", "0.2", "5.6", "9.6", "15.7", "19.8", "24.3"];
    let unsteady: Vec<String> = unsteady.iter().map(|at| format!("\"{at} um\"")).collect();
    let jitter = Truth::cylinder(&format!("[{}]", unsteady.join(", ")));
    let doses = [1.04, 0.95, 1.0, 1.05, 0.96, 1.03, 0.95, 1.0, 1.05, 0.97, 1.02_f32];
    for (photons, seed) in [(2e3, 1), (2e4, 2), (1e6, 3)] {
        let [flat, sample] = truth.counts(photons, seed);
        let record = |flat: &Array4<f32>, sample: &Array4<f32>| {
            let found = record(&truth.scene, [flat, sample], &options);
            println!("{photons}: {:?}, {:#?}", found.chi_square_beyond_flat, found.warnings);
            found
        };
        println!("swapped");
        warned(&record(&sample, &flat), &["flat and sample may be swapped (check --flat"]);
        println!("dose");
        let dimmed = Truth { sample: truth.sample.mapv(|y| 0.9 * y), ..truth.clone() };
        let [_, less] = dimmed.counts(photons, seed + 10);
        warned(&record(&flat, &less), &["the dose of the sample is -", "--empty-beam"]);
        println!("dose per step");
        let mut uneven = truth.clone();
        for mut view in uneven.sample.outer_iter_mut() {
            Zip::from(view.outer_iter_mut()).and(&doses).for_each(|mut frame, dose| frame *= *dose);
        }
        let [_, uneven] = uneven.counts(photons, seed + 20);
        warned(&record(&flat, &uneven), &["% (rms) from step to step", "monitor the dose"]);
        println!("drift");
        let [_, other] = moved.counts(photons, seed + 30);
        warned(&record(&flat, &other), &["a mask drifted by", "--empty-beam"]);
        println!("jitter");
        let [_, other] = jitter.counts(photons, seed + 40);
        warned(&record(&flat, &other), &["or the mask offsets are off by", "check --offsets"]);
        println!("divided");
        let mut divided = sample.clone();
        for mut view in divided.outer_iter_mut() {
            Zip::from(&mut view).and(&flat.index_axis(Axis(0), 0)).for_each(|s, f| {
                *s /= f.max(1.0);
            });
        }
        warned(&record(&flat, &divided), &["not frames that were divided by the flat"]);
    }
}

/// Doses that vary by 0.4 % from step to step give air a dark field.
#[test]
fn small_changes_of_the_dose_are_warned_of_with_the_remedy() {
    let truth = Truth::cylinder(ELEVEN);
    let doses =
        [3.0, -2.0, 5.0, 4.0, -4.0, -6.0, -3.0, 5.0, 2.0, -5.0, 4.0].map(|e| 1.0 + 1e-3 * e);
    let mut uneven = truth.clone();
    for mut view in uneven.sample.outer_iter_mut() {
        Zip::from(view.outer_iter_mut()).and(&doses).for_each(|mut frame, dose| frame *= *dose);
    }
    for method in [Method::Gaussian, Method::ExactCurve] {
        let [flat, _] = truth.counts(2e5, 21);
        let [_, sample] = uneven.counts(2e5, 22);
        let found = record(&truth.scene, [&flat, &sample], &of_counts(method));
        println!("{method}: {:#?}", found.warnings);
        warned(
            &found,
            &["% (rms) from step to step", "air has a dark field of", "--correct dose (or steps)"],
        );
        // 0.4 % rms, of which the fits follow a part.
        let text = &found.warnings[0];
        let number = text.split("the dose varies by ").nth(1).unwrap().split(' ').next().unwrap();
        assert!((0.25..0.65).contains(&number.parse::<f64>().unwrap()), "{number}");
    }
}

/// One step is lost in flat and sample alike: chi squared beyond the residuals of the flat does not show it.
#[test]
fn offsets_that_are_even_across_a_lost_step_are_warned_of() {
    let truth = Truth::cylinder(ELEVEN);
    // A list without its last offset makes the curve so narrow that exact curves are refused.
    let [gaussian, exact] = [Method::Gaussian, Method::ExactCurve];
    for (lost, even, methods) in [
        (4, [-25.0, 25.0], vec![gaussian, exact]),
        (6, [-25.0, 20.0], vec![gaussian]),
        (2, [-25.0, 25.0], vec![gaussian, exact]),
    ] {
        let kept: Vec<usize> = (0..11).filter(|step| *step != lost).collect();
        let mut scene = truth.scene.clone();
        let [from, to] = even;
        scene.scan.mask_offsets =
            (0..10).map(|k| 1e-6 * (from + (to - from) * f64::from(k) / 9.0)).collect();
        for method in methods {
            let frames = truth.counts(2e4, 31).map(|stack| stack.select(Axis(1), &kept));
            let [flat, sample] = &frames;
            for options in [of_counts(method), of_counts(method).with_gain_assumed(true)] {
                let found = record(&scene, [flat, sample], &options);
                println!(
                    "step {lost}, {method}: {:?}, {:#?}",
                    found.reduced_chi_square, found.warnings
                );
                warned(&found, &["a frame may be missing", "check --offsets"]);
                assert_eq!(found.warnings.len(), 1, "{:?}", found.warnings);
            }
        }
    }
}

#[test]
fn swapped_stacks_without_noise_are_warned_of() {
    let weak = "shape = { cylinder = { radius = \"0.4 mm\", height = \"30 mm\" } }";
    let truth = Truth::of(scene(PIXELS, ELEVEN, PAPER, weak));
    let flat = truth.flat.clone().insert_axis(Axis(0));
    let plain = free_gaussian().with_gain(1.0).with_gain_assumed(true);
    let swapped = record(&truth.scene, [&truth.sample, &flat], &plain);
    warned(&swapped, &["flat and sample may be swapped (check --flat"]);
    warned(&record(&truth.scene, [&flat, &truth.sample], &plain), &[]);
    let mut other = truth.scene.clone();
    other.detector.pixels = [63, 16];
    let found = record(&other, [&flat, &truth.sample], &plain);
    warned(&found, &["the geometry has 63 x 16 pixels, the frames 64 x 16"]);
    // Counts as flat, shares of open beam as sample.
    let counts = flat.mapv(|value| 2e4 * value);
    let record = record(&truth.scene, [&counts, &truth.sample], &plain);
    warned(&record, &["transmission is below 0.001 in", "different units or exposures"]);
}

#[test]
fn values_of_8_bits_are_warned_of() {
    let truth = Truth::cylinder(ELEVEN);
    let [flat, sample] = truth.counts(2e4, 5);
    let place = tempfile::tempdir().unwrap();
    let most = sample.iter().copied().fold(0.0, f32::max);
    let bytes = sample.mapv(|y| (255.0 * y / most) as u8);
    write_npy(place.path().join("flat.npy"), &flat).unwrap();
    write_npy(place.path().join("sample.npy"), &bytes).unwrap();
    let open = |name: &str| StackFile::open(place.path().join(name)).unwrap();
    let options = of_counts(Method::Gaussian);
    let stacks = [open("flat.npy"), open("sample.npy")];
    let found = of_stacks(&truth.scene, stacks, &options);
    warned(&found, &["sample.npy: has values of 8 bits, unlike the other stack"]);
}

#[test]
fn noise_above_that_of_counts_is_warned_of_where_the_gain_is_known() {
    let truth = Truth::cylinder(ELEVEN);
    let [flat, sample] = truth.counts(2e4, 6).map(|stack| stack.mapv(|y| 7.0 * y));
    let options = of_counts(Method::Gaussian);
    warned(&record(&truth.scene, [&flat, &sample], &options), &["check --gain"]);
    let guessed = options.with_gain_assumed(true);
    let found = record(&truth.scene, [&flat, &sample], &guessed);
    warned(&found, &[]);
    // The quotient of the gains.
    let ratio = found.chi_square_beyond_flat.unwrap();
    assert!((ratio / 7.0 - 1.0).abs() < 0.15, "{ratio}");
    let sevenfold = guessed.with_gain(7.0).with_gain_assumed(false);
    let found = record(&truth.scene, [&flat, &sample], &sevenfold);
    warned(&found, &[]);
    assert!((found.chi_square_beyond_flat.unwrap() - 1.0).abs() < 0.15);
}

#[test]
fn an_empty_beam_reports_dose_and_drift() {
    let truth = Truth::cylinder(ELEVEN);
    let moved = Truth::cylinder("{ from = \"-24.5 um\", to = \"25.5 um\", count = 11 }");
    let options = of_counts(Method::Gaussian).with_empty_beam(Region::new(2..16, 1..15));
    let [flat, sample] = truth.counts(5e4, 7);
    let sound = record(&truth.scene, [&flat, &sample], &options);
    warned(&sound, &[]);
    let empty = sound.empty_beam.unwrap();
    assert_eq!((empty.columns, empty.rows), ([2, 16], [1, 15]));
    let of_view = &empty.views[0];
    for (pair, expected) in [
        (of_view.transmission.unwrap(), 1.0),
        (of_view.refraction.unwrap(), 0.0),
        (of_view.drift.unwrap(), 0.0),
    ] {
        assert!((pair[0] - expected).abs() < 4.0 * pair[1], "{pair:?}");
    }
    assert_eq!(of_view.dose.len(), 11);
    assert!(of_view.dose.iter().all(|[dose, sigma]| (dose - 1.0).abs() < 4.5 * sigma));

    // A drift of 0.5 um towards smaller offsets and nine tenths of the dose, by steps that differ.
    let doses: Vec<f32> = (0..11).map(|k| 0.9 + 0.02 * (k % 3) as f32).collect();
    let mut faulty = moved.clone();
    for mut view in faulty.sample.outer_iter_mut() {
        Zip::from(view.outer_iter_mut()).and(&doses).for_each(|mut frame, dose| frame *= *dose);
    }
    let [_, sample] = faulty.counts(5e4, 8);
    let found = record(&truth.scene, [&flat, &sample], &options);
    warned(
        &found,
        &["transmission of the empty beam is 0.9", "a mask drifted by -0.", "the dose varies by "],
    );
    let of_view = &found.empty_beam.unwrap().views[0];
    let [drift, sigma] = of_view.drift.unwrap();
    println!("drift {drift:e} +- {sigma:e}, doses {:?}", of_view.dose);
    // Doses that differ move the centre by up to 0.1 um.
    assert!((drift + 0.5e-6).abs() < 0.1e-6 && sigma < 0.02e-6, "{drift}");
    for ([dose, sigma], put_in) in of_view.dose.iter().zip(doses) {
        // A drift of 0.05 um that is left is 1.4 % of the light on a slope at 2.8 sigma of the curve.
        let error = (dose / f64::from(put_in) - 1.0).abs();
        assert!(error < 4.0 * sigma + 0.02, "{dose} for {put_in}");
    }
    for (region, word) in [
        (Region::new(60..65, None), "columns 60:65; allowed: columns from 0 to 64"),
        (Region::new(0..4, 16..17), "rows 16:17"),
    ] {
        let options = options.clone().with_empty_beam(region);
        let error = measured(&truth.scene, [&flat, &sample], &options).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    }
}
