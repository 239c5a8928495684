//! Beam tracking: what `beamlet` makes of beamlets whose contrasts are known, at every place of
//! them on the pixels.

use crate::reference::closed_form::blurred_overlap;
use crate::reference::draws::Draws;
use crate::reference::normal::{SIGMA_PER_FWHM, nodes};
use crate::stacks::images_of;
use crate::support::{Checked, Worst, engine_of};
use beamlet::retrieve::{Images, Method, RetrieveOptions, Weights, flags};
use beamlet::scene::Scene;
use ndarray::Array3;

const UM: f64 = 1e-6;
/// Rotation centre to detector, m, and how much larger masks are there.
const ARM: f64 = 0.59;
const MAGNIFICATION: f64 = 1.5;

/// A sample mask alone before a detector, lengths in um: pixel, period and aperture as projected,
/// full width of the spot, place of the middle beamlet beside its own.
#[derive(Debug, Clone, Copy)]
struct Tracking {
    pixel: f64,
    period: f64,
    aperture: f64,
    spot: f64,
    shift: f64,
}

/// Transmission, refraction angle and dark field.
type Contrasts = [f64; 3];

impl Tracking {
    /// Nine periods and more, an even number of columns.
    fn columns(&self) -> usize {
        2 * ((9.0 * self.period / self.pixel / 2.0).ceil() as usize)
    }

    fn scene(&self, rows: usize) -> Scene {
        let Self { pixel, spot, aperture, .. } = self;
        let [period, offset] = [self.period, self.shift].map(|length| length / MAGNIFICATION);
        let text = format!(
            "[source]\ndistance = \"1.21 m\"\nspot = [\"{spot} um\", \"26 um\"]\nenergy = \"30 keV\"\n\
             [detector]\ndistance = \"1.8 m\"\npixels = [{}, {rows}]\npitch = \"{pixel} um\"\n\
             [sample_mask]\ndistance = \"1.2 m\"\nperiod = \"{period:.15} um\"\ntransmission = 0.0\n\
             projected_aperture = \"{aperture} um\"\noffset = \"{offset:.15} um\"\n",
            self.columns()
        );
        Scene::from_toml(&text, ".").unwrap()
    }

    /// Light of a column behind an object of these contrasts: a hard aperture behind a Gaussian
    /// spot and scatter, displaced, over a pixel.
    fn light(&self, column: usize, [t, alpha, dark]: Contrasts) -> f64 {
        let of_spot = 0.5 * self.spot * UM * SIGMA_PER_FWHM;
        let blur = (of_spot * of_spot + dark * ARM * ARM).sqrt();
        let x = (column as f64 + 0.5 - self.columns() as f64 / 2.0) * self.pixel * UM;
        // Apertures lie at odd halves of the period.
        let from = |k: f64| x - alpha * ARM - (self.period * (k + 0.5) + self.shift) * UM;
        let nearest = (from(0.0) / (self.period * UM)).round();
        let near = (-3..=3).map(|k| from(nearest + f64::from(k)));
        let [aperture, pixel] = [self.aperture * UM, self.pixel * UM];
        t * near.map(|x| blurred_overlap(x, aperture, pixel, blur)).sum::<f64>() / pixel
    }

    /// Flat and sample, a row for each of these contrasts.
    fn frames(&self, contrasts: &[Contrasts]) -> [Array3<f32>; 2] {
        let frame = |of: &dyn Fn(usize) -> Contrasts| {
            Array3::from_shape_fn((1, contrasts.len(), self.columns()), |(_, row, column)| {
                self.light(column, of(row)) as f32
            })
        };
        [frame(&|_| [1.0, 0.0, 0.0]), frame(&|row| contrasts[row])]
    }

    fn retrieve(&self, engine: &Checked, [flat, sample]: [&Array3<f32>; 2]) -> Images {
        self.retrieve_with(engine, [flat, sample], &RetrieveOptions::default())
    }

    fn retrieve_with(
        &self,
        engine: &Checked,
        [flat, sample]: [&Array3<f32>; 2],
        options: &RetrieveOptions,
    ) -> Images {
        let scene = self.scene(flat.dim().1);
        let options = options.clone().with_method(Method::Beamlet);
        images_of(engine, &scene, &options, [flat.view(), sample.view()])
    }
}

fn engine() -> Checked {
    engine_of(beamlet::EngineOptions::default())
}

/// Transmission, refraction, dark field and flags of a beamlet.
fn values(images: &Images, at: [usize; 2]) -> ([f64; 3], u32) {
    let value = |name: &str| f64::from(images.get(name).unwrap()[at]);
    (["transmission", "refraction", "dark_field"].map(value), value("flags") as u32)
}

/// Refraction and dark field over these of beamlets of the table in docs/retrieval.md.
pub(crate) fn of_the_table(engine: &Checked, alpha: f64, dark: f64) -> [f64; 2] {
    let of = Tracking { pixel: 15.0, period: 150.0, aperture: 30.0, spot: 30.0, shift: 0.0 };
    let [flat, sample] = of.frames(&[[1.0, alpha, 0.0], [1.0, 0.0, dark]]);
    let images = of.retrieve(engine, [&flat, &sample]);
    let ([_, shift, _], _) = values(&images, [0, 4]);
    let ([_, _, blur], _) = values(&images, [1, 4]);
    [shift / alpha, blur / dark]
}

/// Pixel, period, aperture of set-ups whose pixels determine the centres of all beamlets.
const SET_UPS: [[f64; 3]; 9] = [
    [5.0, 100.0, 30.0],
    [5.0, 150.0, 60.0],
    [10.0, 100.0, 60.0],
    [10.0, 150.0, 30.0],
    [15.0, 100.0, 30.0],
    [15.0, 100.0, 60.0],
    [15.0, 150.0, 30.0],
    [15.0, 400.0, 60.0],
    [55.0, 400.0, 60.0],
];

/// Each set-up behind both spots, moved over a pixel in steps.
fn all_phases(of: [f64; 3]) -> impl Iterator<Item = Tracking> {
    let [pixel, period, aperture] = of;
    [0.0, 30.0].into_iter().flat_map(move |spot| {
        (0..6).map(move |k| {
            let shift = pixel * f64::from(k) / 6.0;
            Tracking { pixel, period, aperture, spot, shift }
        })
    })
}

#[test]
fn light_of_beamlets_is_the_integral_over_spot_and_pixel() {
    // A sum over the spot in steps of 0.02 deviations of boxes that overlap.
    let of = Tracking { pixel: 15.0, period: 100.0, aperture: 30.0, spot: 30.0, shift: 4.0 };
    let spot = nodes(15.0 * UM * SIGMA_PER_FWHM, 801, 8.0);
    for column in 20..40 {
        let x = (column as f64 + 0.5 - of.columns() as f64 / 2.0) * 15.0 * UM - 2e-6 * ARM;
        let mut sum = 0.0;
        for k in -6..6 {
            let middle = (100.0 * (f64::from(k) + 0.5) + 4.0) * UM;
            for (at, weight) in &spot {
                let [low, high] = [middle + at - 15.0 * UM, middle + at + 15.0 * UM];
                let overlap = (x + 7.5 * UM).min(high) - (x - 7.5 * UM).max(low);
                sum += weight * overlap.max(0.0) / (15.0 * UM);
            }
        }
        assert!((of.light(column, [0.7, 2e-6, 0.0]) - 0.7 * sum).abs() < 1e-5, "{column}: {sum}");
    }
}

#[test]
fn beamlets_give_back_angle_and_transmission_at_every_place_on_the_pixels() {
    // Frames hold 6e-8 of the peak, which is 6e-8 pixels: 6e-12 rad at 55 um. The shape of the fit
    // is that of the light.
    // A point source has no blur; of an edge on a border of pixels the fit knows the side to 1e-3 of
    // the shift.
    let engine = engine();
    let mut angle = Worst::new("refraction of beamlets over the truth, less 1", 1e-4);
    let mut of_points = Worst::new("the same of a point source", 1e-3);
    let mut transmission = Worst::new("transmission of beamlets over the truth, less 1", 1e-4);
    let contrasts: Vec<Contrasts> = [1e-7, -1e-7, 5e-7, -1e-6, 2e-6, -5e-6, 5e-6]
        .map(|alpha| [0.8, alpha, 0.0])
        .into_iter()
        .chain([[0.3, 3e-6, 0.0]])
        .collect();
    for of in SET_UPS.into_iter().flat_map(all_phases) {
        let [flat, sample] = of.frames(&contrasts);
        let images = of.retrieve(&engine, [&flat, &sample]);
        let (rows, count) = images.get("refraction").unwrap().dim();
        assert!(rows == contrasts.len() && count >= 7, "{count} beamlets");
        for at in (0..rows).flat_map(|row| (0..count).map(move |beamlet| [row, beamlet])) {
            let ([t, alpha, _], bits) = values(&images, at);
            let [truth_t, truth_alpha, _] = contrasts[at[0]];
            let about = || format!("{of:?}, {truth_alpha} rad, beamlet {at:?}, flags {bits}");
            let worst = if of.spot > 0.0 { &mut angle } else { &mut of_points };
            worst.take((alpha - truth_alpha) / truth_alpha, about);
            transmission.take(t / truth_t - 1.0, about);
        }
    }
    angle.holds();
    of_points.holds();
    transmission.holds();
}

#[test]
fn scatter_widens_beamlets_by_its_own_variance() {
    // Where pixels resolve the width 6e-8 of the peak is 1e-5 of it.
    let engine = engine();
    let contrasts = [[0.8, 2e-6, 4e-11], [0.6, -1e-6, 1e-10], [1.0, 0.0, 4e-10]];
    let mut worst = Worst::new("dark field of beamlets over the truth, less 1", 1e-3);
    let mut angle = Worst::new("refraction of scattering beamlets (rad)", 1e-10);
    for set_up in SET_UPS {
        let mut resolved = 0;
        for of in all_phases(set_up).filter(|of| of.spot > 0.0) {
            let [flat, sample] = of.frames(&contrasts);
            let images = of.retrieve(&engine, [&flat, &sample]);
            let (rows, count) = images.get("refraction").unwrap().dim();
            for at in (0..rows).flat_map(|row| (0..count).map(move |beamlet| [row, beamlet])) {
                let ([_, alpha, dark], bits) = values(&images, at);
                let [_, truth_alpha, truth] = contrasts[at[0]];
                let about = || format!("{of:?}, dark field {truth}, beamlet {at:?}, flags {bits}");
                angle.take(alpha - truth_alpha, about);
                assert!(dark.is_finite() || bits & flags::UNRESOLVED != 0, "{}", about());
                if dark.is_finite() {
                    resolved += 1;
                    worst.take(dark / truth - 1.0, about);
                }
            }
        }
        assert!(resolved > 0, "{set_up:?}");
    }
    worst.holds();
    angle.holds();
}

#[test]
fn pixels_that_do_not_determine_a_beamlet_are_flagged() {
    let engine = engine();
    let contrasts = [[0.8, 2e-6, 0.0]];
    // A point source, edges within pixels: no width. Then all light in one pixel: no centre.
    let point = Tracking { pixel: 15.0, period: 150.0, aperture: 30.0, spot: 0.0, shift: 5.0 };
    let wide = Tracking { pixel: 55.0, period: 385.0, aperture: 30.0, spot: 6.0, shift: 0.0 };
    for (of, has_angle) in [(point, true), (wide, false)] {
        let [flat, sample] = of.frames(&contrasts);
        let images = of.retrieve(&engine, [&flat, &sample]);
        for beamlet in 0..images.get("flags").unwrap().ncols() {
            let ([t, alpha, dark], bits) = values(&images, [0, beamlet]);
            assert_ne!(bits & flags::UNRESOLVED, 0, "{of:?}, beamlet {beamlet}: flags {bits}");
            assert!((t / 0.8 - 1.0).abs() < 1e-3 && dark.is_nan(), "{of:?}: {t}, {dark}");
            let right = if has_angle { (alpha / 2e-6 - 1.0).abs() < 1e-2 } else { alpha.is_nan() };
            assert!(right, "{of:?}, beamlet {beamlet}: {alpha}");
        }
    }
}

/// Means of (value - truth) / sigma and of its square, over draws and beamlets: of transmission,
/// refraction and dark field.
fn normalised(images: &Images, truth: Contrasts) -> [[f64; 2]; 3] {
    let names = ["transmission", "refraction", "dark_field"];
    std::array::from_fn(|k| {
        let of = |name: &str| images.get(name).unwrap();
        let sigmas = of(&format!("{}_sigma", names[k]));
        let pairs = of(names[k]).iter().zip(sigmas).zip(of("flags"));
        let scores: Vec<f64> = pairs
            .filter(|(_, flags)| **flags as u32 & !flags::MISFIT == 0)
            .map(|((value, sigma), _)| (f64::from(*value) - truth[k]) / f64::from(*sigma))
            .collect();
        assert!(2 * scores.len() > sigmas.len(), "{} answers of {}", scores.len(), sigmas.len());
        let mean = |f: &dyn Fn(f64) -> f64| {
            scores.iter().map(|score| f(*score)).sum::<f64>() / scores.len() as f64
        };
        [mean(&|score| score), mean(&|score| score * score)]
    })
}

#[test]
fn uncertainties_of_beamlets_are_the_scatter_of_their_draws() {
    // 200 draws of 7 to 9 beamlets: a deviation is known to 2 %, a mean to 0.03 deviations.
    let engine = engine();
    let mut scatter = Worst::new("scatter of beamlets over their uncertainty, less 1", 0.1);
    let mut bias = Worst::new("bias of beamlets in their uncertainties", 0.15);
    let truth = [0.8, 2e-6, 1e-11];
    let mut draws = Draws(42);
    let set_ups =
        [[5.0, 100.0, 30.0], [10.0, 150.0, 30.0], [15.0, 100.0, 30.0], [55.0, 400.0, 60.0]];
    for [pixel, period, aperture] in set_ups {
        // The phase at which all beamlets of 55 um have an edge near a border.
        let shift = if pixel > 50.0 { 0.0 } else { 3.0 };
        let of = Tracking { pixel, period, aperture, spot: 30.0, shift };
        let [flat, sample] = of.frames(&[truth; 200]);
        let mut counted =
            |frame: &Array3<f32>| frame.mapv(|mean| draws.poisson(2e5 * f64::from(mean)) as f32);
        let (flat, sample) = (counted(&flat), counted(&sample));
        for weights in [Weights::None, Weights::Poisson] {
            let options = RetrieveOptions::default().with_gain(1.0).with_weights(weights);
            let images = of.retrieve_with(&engine, [&flat, &sample], &options);
            let found = normalised(&images, truth);
            for ([mean, square], name) in found.into_iter().zip(["T", "angle", "dark field"]) {
                let about = || format!("{name} at {pixel} um, weights {weights:?}");
                bias.take(mean, about);
                scatter.take((square - mean * mean).sqrt() - 1.0, about);
            }
        }
    }
    scatter.holds();
    bias.holds();
}

/// Beamlets on the borders of pixels of half a period: two values determine transmission and angle. Wider spots and
/// apertures leave light of neighbours.
#[test]
fn two_pixels_of_a_beamlet_give_transmission_and_angle() {
    let engine = engine();
    let mut worst = Worst::new("contrasts of two pixels over theirs, less 1", 2e-3);
    for [pixel, period, aperture, spot] in
        [[75.0, 150.0, 60.0, 30.0], [75.0, 150.0, 30.0, 60.0], [50.0, 100.0, 40.0, 0.0]]
    {
        let of = Tracking { pixel, period, aperture, spot, shift: 0.0 };
        let contrasts = [[0.8, 2e-6, 0.0], [0.5, -6e-6, 0.0]];
        let [flat, sample] = of.frames(&contrasts);
        let images = of.retrieve(&engine, [&flat, &sample]);
        assert!(images.get("dark_field").is_none());
        for (row, [t, alpha, _]) in contrasts.into_iter().enumerate() {
            for beamlet in 1..images.get("flags").unwrap().ncols() - 1 {
                let value = |name: &str| f64::from(images.get(name).unwrap()[[row, beamlet]]);
                let at = || format!("{of:?}, row {row}, beamlet {beamlet}");
                worst.take(value("transmission") / t - 1.0, at);
                worst.take(value("refraction") / alpha - 1.0, at);
            }
        }
    }
    worst.holds();
}
