//! Transmission, refraction, dose and drift in pixels with nothing in the beam.

use super::estimate::Estimate;
use super::fitted::{FittedCurve, is_usable};
use super::watched::Watched;
use crate::retrieve::images::Images;
use beamlet_core::numbers;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Results in the pixels of an empty beam. Nothing is corrected by them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EmptyBeam {
    /// First column, and the one behind the last.
    pub columns: [usize; 2],
    /// First row, and the one behind the last.
    pub rows: [usize; 2],
    /// Values of each view.
    pub views: Vec<EmptyBeamOfView>,
}

/// Medians over the pixels of empty beam of a view, with their one-sigma uncertainties from the scatter
/// of the pixels. `None` where fewer than two pixels have an answer.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EmptyBeamOfView {
    /// Transmission: 1 where the dose of flat and sample is one.
    pub transmission: Option<[f64; 2]>,
    /// Refraction, rad: 0 where nothing moved between flat and sample.
    pub refraction: Option<[f64; 2]>,
    /// Displacement of the curve between flat and sample that this refraction is, m of mask offset (of
    /// beamlets m on the detector).
    pub drift: Option<[f64; 2]>,
    /// Refraction along z, rad; `None` of slits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refraction_z: Option<[f64; 2]>,
    /// Displacement along z that this refraction is, as `drift`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift_z: Option<[f64; 2]>,
    /// Dose of each step over the flat's, without the drift; empty if flat and sample have other offsets.
    /// An error of an offset enters where the curve is steep.
    pub dose: Vec<[f64; 2]>,
}

/// A pixel of empty beam: values of flat and sample, and the curve of the flat where its method has one.
pub(super) struct EmptyPixel {
    pub(crate) flat: Vec<f64>,
    pub(crate) sample: Vec<f64>,
    pub(crate) curve: Option<FittedCurve>,
}

/// Values of an image in a rectangle, of pixels that count.
pub(super) fn values(images: &Images, name: &str, [rows, columns]: &[Range<usize>; 2]) -> Vec<f64> {
    let (Some(image), Some(bits)) = (images.get(name), images.get("flags")) else {
        return Vec::new();
    };
    let part = ndarray::s![rows.clone(), columns.clone()];
    let pairs = image.slice(part).into_iter().zip(bits.slice(part));
    let usable = pairs.filter(|(_, bits)| is_usable(numbers::whole::<u32>(f64::from(**bits))));
    usable.map(|(value, _)| f64::from(*value)).collect()
}

/// Pairs of the pixels' values; `flat` and `sample` watch the same pixels.
pub(super) fn pixels(
    flat: &Watched,
    sample: &Watched,
    curve: impl Fn(usize) -> Option<FittedCurve>,
) -> Vec<EmptyPixel> {
    let pairs = flat.iter().zip(sample.iter());
    pairs.map(|((at, flat), (_, sample))| EmptyPixel { flat, sample, curve: curve(at) }).collect()
}

impl EmptyBeamOfView {
    /// Empty beam in rectangles of the images, with the values of its pixels at these offsets of flat and sample (none
    /// where the offsets of both were to differ). `subtracted`: refraction angles along x and z that a correction took
    /// off the images, rad; the frames still have their displacement.
    pub(super) fn of(
        images: &Images,
        regions: &[[Range<usize>; 2]],
        angle_per_shift: f64,
        subtracted: [f64; 2],
        pixels: &[EmptyPixel],
        offsets: [&[[f64; 2]]; 2],
    ) -> Self {
        let of = |name: &str| {
            Estimate::of(regions.iter().flat_map(|region| values(images, name, region)).collect())
        };
        let pair = |found: Option<Estimate>| found.map(|found| [found.value, found.sigma]);
        let drift = |angle: Option<[f64; 2]>| {
            angle.map(|[value, sigma]| [value / angle_per_shift, (sigma / angle_per_shift).abs()])
        };
        let refractions = ["refraction", "refraction_z"].map(|name| pair(of(name)));
        let drifts = refractions.map(drift);
        let shift = [0, 1].map(|axis| {
            drifts[axis].map_or(0.0, |[by, _]| by) + subtracted[axis] / angle_per_shift
        });
        let steps = 0..offsets[0].len();
        let dose = steps.filter_map(|k| dose(pixels, k, offsets.map(|of| of[k]), shift)).collect();
        let [refraction, refraction_z] = refractions;
        let [drift, drift_z] = drifts;
        let transmission = pair(of("transmission"));
        Self { transmission, refraction, drift, refraction_z, drift_z, dose }
    }
}

/// Dose of a step over the flat's: quotient of the sums, the curve of the flat moved by `shift`. Half of
/// the change by the shift counts as uncertain: a fitted curve differs from the masks' curve in its
/// tails.
fn dose(
    pixels: &[EmptyPixel],
    step: usize,
    [of_flat, of_sample]: [[f64; 2]; 2],
    shift: [f64; 2],
) -> Option<[f64; 2]> {
    let change = |pixel: &EmptyPixel| {
        pixel.curve.as_ref().map_or(0.0, |curve| {
            let moved = [0, 1].map(|axis| of_sample[axis] - shift[axis]);
            let values = curve.at(&[moved, of_flat]);
            values[0][0] - values[1][0]
        })
    };
    let triples: Vec<[f64; 3]> = pixels
        .iter()
        .map(|pixel| [pixel.flat[step], pixel.sample[step], change(pixel)])
        .filter(|triple| triple.iter().all(|value| value.is_finite()))
        .collect();
    let sum = |of: usize| triples.iter().map(|triple| triple[of]).sum::<f64>();
    let [change, sample] = [sum(2), sum(1)];
    let flat = sum(0) + change;
    if triples.len() < 2 || flat <= 0.0 {
        return None;
    }
    let dose = sample / flat;
    let left = |[flat, sample, change]: &[f64; 3]| libm::fma(-dose, flat + change, *sample);
    let scatter = triples.iter().map(|triple| left(triple).powi(2)).sum::<f64>().sqrt();
    Some([dose, scatter.hypot(0.5 * dose * change) / flat])
}
