//! Uncertainties against the scatter of draws.

use super::super::super::method::Method;
use super::super::super::options::RetrieveOptions;
use super::super::super::value_noise::Weights;
use super::super::{Aperture, Lattice};
use super::light::{Blurred, Contrasts};
use super::{NAMES, Tracking};
use ndarray::Array3;

const UM: f64 = 1e-6;
const OBJECT: Contrasts = Contrasts([0.8, 1.5e-6, -0.9e-6, 9e-11, 5e-11, 3e-11]);

/// Draws of a linear congruential generator (Knuth), made normal by a sum of twelve.
pub(super) struct Draws(pub(super) u64);

impl Draws {
    fn unit(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A count of this mean, normal to the nearest whole number: means of hundreds and more, and few of less.
    pub(super) fn count(&mut self, mean: f64) -> f32 {
        if mean < 60.0 {
            // Knuth's product of uniform numbers.
            let (limit, mut product, mut count) = ((-mean).exp(), self.unit(), 0);
            while product > limit {
                product *= self.unit();
                count += 1;
            }
            return count as f32;
        }
        let normal: f64 = (0..12).map(|_| self.unit()).sum::<f64>() - 6.0;
        (mean + mean.sqrt() * normal).round() as f32
    }

    pub(super) fn counts(&mut self, frame: &Array3<f32>, open: f64) -> Array3<f32> {
        frame.mapv(|mean| self.count(open * f64::from(mean)))
    }
}

/// Share of values within one uncertainty, mean deviation, and number, of each contrast over draws.
fn coverage(of: &Tracking, options: &RetrieveOptions, draws: usize) -> [(f64, f64); 6] {
    let options = options.clone().with_gain(1.0);
    let mut random = Draws(7);
    let frames = [of.frame(&Contrasts::EMPTY), of.frame(&OBJECT)];
    let mut scores: [Vec<f64>; 6] = Default::default();
    for _ in 0..draws {
        let [flat, sample] = [0, 1].map(|k| random.counts(&frames[k], 2e4));
        let found = of.images(&options, [&flat, &sample]);
        for (k, name) in NAMES.into_iter().enumerate() {
            let sigmas = found.get(&format!("{name}_sigma")).unwrap();
            for (value, sigma) in found.get(name).unwrap().iter().zip(sigmas) {
                if value.is_finite() {
                    scores[k].push((f64::from(*value) - OBJECT.0[k]) / f64::from(*sigma));
                }
            }
        }
    }
    scores.map(|scores| {
        let count = scores.len() as f64;
        assert!(count > 450.0, "{count} values");
        let within = scores.iter().filter(|score| score.abs() < 1.0).count() as f64 / count;
        (within, scores.iter().sum::<f64>() / count)
    })
}

#[test]
fn uncertainties_of_fits_and_moments_cover_68_per_cent_of_draws() {
    // 900 values: a share of 0.683 is known to 0.016.
    let lattice = Lattice::parse("73 um, 81 um, 2 deg").unwrap();
    let blur = [(9.0 * UM).powi(2), (8.0 * UM).powi(2), 0.0];
    let size = [20.0 * UM, 16.0 * UM];
    let beamlet = RetrieveOptions::default()
        .with_method(Method::Beamlet)
        .with_aperture(Aperture::Rectangle(size));
    let gaussian = RetrieveOptions::default();
    let moments = RetrieveOptions::default().with_method(Method::Moments);
    let cases = [
        ("gaussian", gaussian.clone(), Blurred::gaussian(blur)),
        ("gaussian by counts", gaussian.with_weights(Weights::Poisson), Blurred::gaussian(blur)),
        (
            "beamlet by counts",
            beamlet.with_weights(Weights::Poisson),
            Blurred::rectangle(size, blur),
        ),
        ("moments", moments, Blurred::gaussian(blur.map(|part| 0.4 * part))),
    ];
    for (name, options, light) in cases {
        let of = Tracking { lattice, origin: [1.3 * UM, 0.4 * UM], light, shape: [58, 58] };
        let found = coverage(&of, &options, 25);
        for (k, (within, mean)) in found.into_iter().enumerate() {
            assert!((within - 0.683).abs() < 0.05, "{name}, {}: {within} within", NAMES[k]);
            assert!(mean.abs() < 0.15, "{name}, {}: bias {mean} deviations", NAMES[k]);
        }
    }
}
