//! Samples with more light than the flat, or divided by it.

use super::fitted::is_usable;
use super::watched::Watched;
use crate::retrieve::images::{FLAGS, Images};
use beamlet_core::numbers;

/// Least difference of a transmission from 1 that counts, as refraction at edges and the bias of a
/// Gaussian make.
const SLACK: f32 = 0.01;
/// Transmission below which a sample is opaque, or its values have another unit.
const FAINT: f32 = 1e-3;
/// Standard deviations from which on pixels are compared in number, and from which on one is bright.
const SIGMAS: [f32; 2] = [2.0, 4.0];
/// Part of the flat's contrast over mask offsets (beamlets: over pixels) below which a sample has none.
const CONTRAST: f64 = 0.2;

/// Pixels whose transmission is not 1, beyond their uncertainty where it is known.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LightCounts {
    /// Pixels above 1 by two deviations, as `below`: noise makes equal numbers of both.
    pub(super) above: u64,
    pub(super) below: u64,
    /// Above 1 by four deviations.
    pub(super) bright: u64,
    /// With next to no light.
    pub(super) faint: u64,
    pub(super) pixels: u64,
}

impl LightCounts {
    /// Adds the pixels of a view that count. `noise`: share of their uncertainties that is noise.
    pub(super) fn add(&mut self, images: &Images, noise: f32) {
        let (Some(values), Some(bits)) = (images.get("transmission"), images.get(FLAGS)) else {
            return;
        };
        let sigmas = images.get("transmission_sigma");
        for (at, value) in values.indexed_iter() {
            if !is_usable(numbers::whole::<u32>(f64::from(bits[at]))) || value.is_nan() {
                continue;
            }
            let sigma = sigmas.map_or(0.0, |sigmas| sigmas[at]);
            let sigma = if sigma.is_nan() { 0.0 } else { noise * sigma };
            let [slack, certain] = SIGMAS.map(|sigmas| sigmas.mul_add(sigma, SLACK));
            self.pixels += 1;
            self.above += u64::from(*value > 1.0 + slack);
            self.below += u64::from(*value < 1.0 - slack);
            self.bright += u64::from(*value > 1.0 + certain);
            self.faint += u64::from(*value < FAINT);
        }
    }
}

/// True if the values of the sample do not follow the flat: frames that were divided by it already.
pub(super) fn is_divided(flat: &Watched, sample: &Watched) -> bool {
    let pairs: Vec<Vec<[f64; 2]>> = flat
        .iter()
        .zip(sample.iter())
        .filter(|((_, f), (_, s))| f.len() == s.len())
        .map(|((_, f), (_, s))| {
            let pairs = f.into_iter().zip(s).map(|(f, s)| [f, s]);
            pairs.filter(|pair| pair.iter().all(|value| value.is_finite())).collect()
        })
        .collect();
    let all = mean(pairs.iter().flatten());
    // A scan compares the steps of a pixel, one frame its pixels.
    let is_scan = pairs.iter().any(|pixel| pixel.len() > 1);
    let (mut products, mut count) = ([0.0; 3], 0.0);
    for pixel in &pairs {
        let [f0, s0] = if is_scan { mean(pixel.iter()) } else { all };
        for [f, s] in pixel {
            let [f, s] = [f - f0, s - s0];
            products = [products[0] + f * f, products[1] + f * s, products[2] + s * s];
            count += 1.0;
        }
    }
    let [flat_square, product, sample_square] = products;
    let [of_flat, of_sample] = all;
    if count < 16.0 || flat_square <= 0.0 || of_flat <= 0.0 || of_sample <= 0.0 {
        return false;
    }
    let slope = product / flat_square;
    let noise = ((sample_square - slope * product).max(0.0) / count / flat_square).sqrt();
    (slope + 4.0 * noise) * of_flat / of_sample < CONTRAST
}

fn mean<'a>(pairs: impl Iterator<Item = &'a [f64; 2]>) -> [f64; 2] {
    let (sum, count) =
        pairs.fold(([0.0; 2], 0.0), |([a, b], count), [x, y]| ([a + x, b + y], count + 1.0));
    sum.map(|sum| sum / count)
}
