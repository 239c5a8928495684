//! Images of a view in two directions.

use super::super::curves::Curve;
use super::super::flags;
use super::super::images::{FLAGS, Images};
use super::fit::PlanarFit;
use beamlet_core::numbers::single;
use ndarray::Array2;

/// Images of the contrasts.
pub(super) const CONTRASTS: [&str; 6] =
    ["transmission", "refraction", "refraction_z", "dark_field", "dark_field_z", "dark_field_xz"];
/// Their uncertainties.
pub(super) const SIGMAS: [&str; 6] = [
    "transmission_sigma",
    "refraction_sigma",
    "refraction_z_sigma",
    "dark_field_sigma",
    "dark_field_z_sigma",
    "dark_field_xz_sigma",
];
/// Images of the curves of the flat and of the sample.
const OF_CURVES: [[&str; 8]; 2] = [
    [
        "flat_amplitude",
        "flat_centre",
        "flat_centre_z",
        "flat_width",
        "flat_width_z",
        "flat_covariance_xz",
        "flat_background",
        "residual_flat",
    ],
    [
        "sample_amplitude",
        "sample_centre",
        "sample_centre_z",
        "sample_width",
        "sample_width_z",
        "sample_covariance_xz",
        "sample_background",
        "residual_sample",
    ],
];

/// Names of the images of flat and of sample; `has_sigmas`: values are counts.
pub(crate) fn names(has_sigmas: bool) -> [Vec<&'static str>; 2] {
    let sigmas = SIGMAS.into_iter().filter(|_| has_sigmas);
    let [of_flat, of_sample] = OF_CURVES;
    let sample = CONTRASTS.into_iter().chain(sigmas).chain([FLAGS]).chain(of_sample);
    [of_flat.to_vec(), sample.collect()]
}

/// Values of a curve in the order of its images.
fn values(curve: &Curve) -> [f64; 8] {
    let [xx, zz, xz] = curve.moments;
    [
        curve.amplitude,
        curve.centre[0],
        curve.centre[1],
        xx.sqrt(),
        zz.sqrt(),
        xz,
        curve.background,
        curve.residual,
    ]
}

/// Contrasts and their uncertainties: of the area, the centre, and the second moments. `angle_per_shift`:
/// refraction angle per shift of the centre.
pub(super) fn contrasts(flat: &PlanarFit, sample: &PlanarFit, angle_per_shift: f64) -> [f64; 12] {
    let (f, s) = (&flat.curve, &sample.curve);
    let square = angle_per_shift * angle_per_shift;
    let transmission = s.area / f.area;
    let angle = |axis: usize| angle_per_shift * (s.centre[axis] - f.centre[axis]);
    let angle_sigma =
        |axis: usize| angle_per_shift.abs() * f.centre_sigma[axis].hypot(s.centre_sigma[axis]);
    let resolved = |k: usize| match k {
        0 | 1 => !sample.unresolved[k],
        _ => !(sample.unresolved[0] || sample.unresolved[1]),
    };
    let by = |k: usize| if resolved(k) { square } else { f64::NAN };
    let dark = |k: usize| by(k) * (s.moments[k] - f.moments[k]);
    let dark_sigma = |k: usize| by(k) * f.moments_sigma[k].hypot(s.moments_sigma[k]);
    [
        transmission,
        angle(0),
        angle(1),
        dark(0),
        dark(1),
        dark(2),
        transmission * f.area_sigma.hypot(s.area_sigma),
        angle_sigma(0),
        angle_sigma(1),
        dark_sigma(0),
        dark_sigma(1),
        dark_sigma(2),
    ]
}

/// An image `[row][column]` of a value of curves, by its name.
fn image(
    shape: [usize; 2],
    fits: &[Option<PlanarFit>],
    of: impl Fn(usize, &PlanarFit) -> f64,
) -> Array2<f32> {
    Array2::from_shape_fn((shape[0], shape[1]), |(row, column)| {
        let at = row * shape[1] + column;
        fits.get(at).and_then(Option::as_ref).map_or(f32::NAN, |fit| single(of(at, fit)))
    })
}

/// Images of the flat.
pub(crate) fn of_flat(shape: [usize; 2], flat: &[Option<PlanarFit>]) -> Images {
    Images::of(of_curves(OF_CURVES[0], shape, flat).collect())
}

/// Images of curves by their names.
fn of_curves(
    names: [&'static str; 8],
    shape: [usize; 2],
    fits: &[Option<PlanarFit>],
) -> impl Iterator<Item = (&'static str, Array2<f32>)> {
    let value = move |(k, name)| {
        let of = |_: usize, fit: &PlanarFit| {
            if fit.curve.has_answer() { values(&fit.curve)[k] } else { f64::NAN }
        };
        (name, image(shape, fits, of))
    };
    names.into_iter().enumerate().map(value)
}

/// Images of a view. Places of the image without a beamlet hold NaN, and no flag.
pub(super) fn of_view(
    shape: [usize; 2],
    [flat, sample]: [&[Option<PlanarFit>]; 2],
    angle_per_shift: f64,
    has_sigmas: bool,
) -> Images {
    let of_flat = |at: usize| flat.get(at).and_then(Option::as_ref);
    let all: Vec<[f64; 12]> = sample
        .iter()
        .enumerate()
        .map(|(at, fit)| match (of_flat(at), fit) {
            (Some(of_flat), Some(fit)) if of_flat.curve.has_answer() && fit.curve.has_answer() => {
                contrasts(of_flat, fit, angle_per_shift)
            }
            _ => [f64::NAN; 12],
        })
        .collect();
    let contrast = |k: usize| image(shape, sample, |at, _| all[at][k]);
    let mut images: Vec<(&'static str, Array2<f32>)> = Vec::new();
    let sigmas = SIGMAS.into_iter().enumerate().map(|(k, name)| (6 + k, name));
    let names = CONTRASTS.into_iter().enumerate().chain(sigmas.filter(|_| has_sigmas));
    images.extend(names.map(|(k, name)| (name, contrast(k))));
    let bits = image(shape, sample, |at, fit| {
        let of_flat = of_flat(at).map_or(0, |fit| fit.curve.flags);
        f64::from(flags::of_pixel(of_flat, fit.curve.flags))
    });
    images.push((FLAGS, bits.mapv(|bits| if bits.is_nan() { 0.0 } else { bits })));
    images.extend(of_curves(OF_CURVES[1], shape, sample));
    Images::of(images)
}
