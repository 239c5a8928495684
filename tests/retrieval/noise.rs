//! Uncertainties of counts against the scatter of pixels: flats that are interpolated between views, and
//! noise of reading.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::draws::Draws;
use crate::stacks::{even, retrieved, sheets, stack};
use crate::support::free_gaussian;
use beamlet::retrieve::{Input, Method, RetrieveOptions, Weights};
use beamlet::scene::{Counts, Scene};
use ndarray::{Array3, Array4};
use std::collections::BTreeMap;

const UM: f64 = 1e-6;
pub(super) const ROWS: usize = 24;
pub(super) const COLUMNS: usize = 64;
/// Deviations that a ratio of scatter and uncertainty may have.
const SIGMAS: f64 = 4.0;
const QUANTITIES: [&str; 3] = ["transmission", "refraction", "dark_field"];

/// The paper's masks as sheets, with these views and offsets in um.
fn scene(views: usize, offsets: &[f64]) -> Scene {
    Scene::from_toml(&scene_text(views, offsets), ".").unwrap()
}

pub(super) fn scene_text(views: usize, offsets: &[f64]) -> String {
    let angles = format!("angles = {{ from = \"0 deg\", to = \"180 deg\", count = {views} }}\n");
    sheets([COLUMNS, ROWS], offsets) + &angles
}

/// Counts `[view][step][row][column]` of a curve with this peak, plus noise of reading.
pub(super) fn counts(
    views: usize,
    offsets: &[f64],
    [peak, read]: [f64; 2],
    seed: u64,
) -> Array4<f32> {
    let blur = 0.5 * 30.0 * UM * 0.424_660_900_144_009_5;
    let at = |x: f64| blurred_overlap(1.5 * x * UM, 30.0 * UM, 30.0 * UM, blur);
    let mut draws = Draws(seed);
    Array4::from_shape_fn((views, offsets.len(), ROWS, COLUMNS), |(_, step, ..)| {
        let photons = draws.poisson(peak * at(offsets[step]) / at(0.0));
        let normal = (-2.0 * draws.uniform().ln()).sqrt()
            * (2.0 * std::f64::consts::PI * draws.uniform()).cos();
        libm::fma(read, normal, photons) as f32
    })
}

/// Options for counts: weights where the method has them.
fn options(method: Method) -> RetrieveOptions {
    let weights = if method == Method::Gaussian { Weights::Poisson } else { Weights::None };
    free_gaussian().with_method(method).with_weights(weights).with_gain(1.0)
}

/// Holds the scatter of the pixels of each view over their uncertainty to 1, within four deviations of
/// the scatter of a sample of this size, and a share `of_fit` for what is not linear in the noise.
fn hold(images: &BTreeMap<String, Array3<f32>>, of_fit: f64, what: &str) {
    for name in QUANTITIES {
        let sigmas = &images[&format!("{name}_sigma")];
        for (view, (values, sigmas)) in
            images[name].outer_iter().zip(sigmas.outer_iter()).enumerate()
        {
            let pairs = values.iter().zip(sigmas).filter(|(v, s)| v.is_finite() && s.is_finite());
            let pairs: Vec<[f64; 2]> = pairs.map(|(v, s)| [*v, *s].map(f64::from)).collect();
            let count = pairs.len() as f64;
            assert!(count > 0.9 * (ROWS * COLUMNS) as f64, "{what}, {name}: {count} values");
            let mean = pairs.iter().map(|[v, _]| v).sum::<f64>() / count;
            let squares: f64 = pairs.iter().map(|[v, s]| ((v - mean) / s).powi(2)).sum();
            let ratio = (squares / count).sqrt();
            println!("{what}, view {view}, {name}: scatter over uncertainty {ratio:.3}");
            let allowed = SIGMAS / (2.0 * count).sqrt() + of_fit;
            assert!((ratio - 1.0).abs() < allowed, "{what}, view {view}, {name}: {ratio:.3}");
        }
    }
}

/// Without the weights of the interpolation uncertainties of these views are up to 15 % too large.
#[test]
fn uncertainties_between_two_flats_have_the_noise_of_interpolated_values() {
    let offsets = even(11, 25.0);
    for (method, seed) in [(Method::Gaussian, 1), (Method::ExactCurve, 2), (Method::Moments, 3)] {
        let offsets = if method == Method::Moments { even(17, 40.0) } else { offsets.clone() };
        let noise = [5e3, 30.0];
        let options = options(method).with_read_noise(noise[1]);
        // Flats in the middle between views, and as simulated ones with every second view.
        let flats = |count| stack("flat", counts(count, &offsets, noise, seed));
        let sample = |count| stack("sample", counts(count, &offsets, noise, seed + 10));
        let measured = Input::measured(&scene(3, &offsets), flats(4), sample(3), None).unwrap();
        let found = retrieved(measured.with_flats_every(Some(1)), &options).unwrap();
        hold(&found.images, 0.02, &format!("{method}, measured"));
        if method == Method::ExactCurve {
            // The median of 1,536 values of chi squared with 7 degrees of freedom scatters by 1.7 %.
            let beyond = found.record.chi_square_beyond_flat.unwrap();
            assert!((beyond - 1.0).abs() < SIGMAS * 0.017, "{beyond}");
        }
        let mut simulated = scene(4, &offsets);
        simulated.scan.flats_every = Some(2);
        simulated.detector.counts = Some(Counts::of_photons(2.5e4));
        let input = Input::simulated_counts(&simulated, flats(3), sample(4), None).unwrap();
        let found = retrieved(input, &options).unwrap();
        hold(&found.images, 0.02, &format!("{method}, simulated"));
    }
}

/// Noise of reading as large as the noise of the photons at the peak, by the command line.
#[cfg(feature = "cli")]
#[test]
fn every_method_takes_the_noise_of_reading_on_the_command_line() {
    use crate::support::program::done;
    use ndarray::Axis;
    let place = tempfile::tempdir().unwrap();
    let here = place.path();
    let noise = [4e4, 200.0];
    for (method, offsets) in [
        ("exact-curve", even(11, 25.0)),
        ("three-step", even(3, 10.0)),
        ("moments", even(17, 40.0)),
        ("gaussian --weights poisson", even(11, 25.0)),
    ] {
        let of = |seed| counts(1, &offsets, noise, seed);
        ndarray_npy::write_npy(here.join("flat.npy"), &of(7).index_axis(Axis(0), 0)).unwrap();
        ndarray_npy::write_npy(here.join("sample.npy"), &of(8)).unwrap();
        std::fs::write(here.join("set_up.toml"), scene_text(1, &offsets)).unwrap();
        done(
            here,
            &format!(
                "retrieve --flat flat.npy --sample sample.npy --geometry set_up.toml --format npy \
                 -o images --overwrite -q --gain 1 --read-noise 200 --method {method}"
            ),
        );
        let maps = beamlet::stack::Maps::open(here.join("images")).unwrap();
        let mut images = BTreeMap::new();
        for name in QUANTITIES.iter().flat_map(|name| [(*name).to_owned(), format!("{name}_sigma")])
        {
            let image = maps.map(&name, 0).unwrap().insert_axis(Axis(0));
            images.insert(name, image);
        }
        hold(&images, 0.03, method);
        // Noise of reading at the ends of the scan is no curve that goes on beyond (`moments`).
        let flags = maps.map("flags", 0).unwrap();
        let odd = flags.iter().filter(|bits| **bits > 0.0).count();
        assert!(odd * 100 < flags.len(), "{method}: {odd} pixels with a flag");
    }
}
