//! Values of the pixels of a view, and the curves of their flat.

use super::equations::Unknowns;
use crate::retrieve::diagnosis::FittedCurve;
use crate::retrieve::fit::fit_slits;
use crate::retrieve::fitter::Weights;
use crate::retrieve::misfit::median;
use crate::retrieve::scan::Scan;
use crate::retrieve::shape::CurveGeometry;
use crate::retrieve::value_noise::ValueNoise;
use crate::retrieve::{RetrieveOptions, flags, quadrature};
use rayon::prelude::*;

/// Fewest frames for pixels with a curve of their own.
const FRAMES: usize = 6;

/// A pixel of a view.
pub(super) struct Pixel {
    /// Curve of the flat.
    pub(super) curve: FittedCurve,
    /// Difference of the flat from its curve at the offsets of the sample; 0 where the flat has others.
    pub(super) residual: Vec<f64>,
    /// Values of the sample.
    pub(super) values: Vec<f64>,
}

/// Pixels of a view with what their fits need.
pub(super) struct PixelSet<'a> {
    /// Pixels of empty beam.
    pub(crate) empty: Vec<Pixel>,
    /// Pixels of the rest of the image.
    pub(crate) inner: Vec<Pixel>,
    /// Mask offsets of the sample as they were set, m.
    pub(crate) offsets: &'a [f64],
    /// Median width and centre of the curves of the empty beam, m.
    pub(super) width: f64,
    pub(super) centre: f64,
    geometry: &'a CurveGeometry,
    options: &'a RetrieveOptions,
}

/// A pixel of the flat: its values, and the curve of the masks through these.
#[derive(Debug)]
pub(super) struct FlatPixel {
    curve: FittedCurve,
    values: Vec<f64>,
}

impl FlatPixel {
    /// Pixels with values at these offsets (m); `None` without a value in a frame, or without a curve.
    pub(super) fn all(
        values: Vec<Vec<f64>>,
        offsets: &[f64],
        geometry: &CurveGeometry,
        options: &RetrieveOptions,
    ) -> Vec<Option<Self>> {
        let scan = scan(offsets, geometry, options);
        let of = |values: Vec<f64>| {
            let is_whole = values.iter().all(|value| value.is_finite());
            let curve = is_whole.then(|| fit(geometry, &scan, &values)).flatten()?;
            Some(Self { curve, values })
        };
        values.into_par_iter().map(of).collect()
    }

    /// Difference of the values from the curve at the offsets of the sample; 0 where the flat has others.
    fn residual(&self, [of_flat, offsets]: [&[f64]; 2]) -> Vec<f64> {
        match of_flat == offsets {
            true => {
                let fitted = self.curve.at(offsets.iter().copied());
                self.values.iter().zip(fitted).map(|(y, [value, ..])| y - value).collect()
            }
            false => vec![0.0; offsets.len()],
        }
    }
}

impl<'a> PixelSet<'a> {
    /// Set of pixels of the flat and the values of the sample there; the first `empty` are empty beam, the others
    /// are taken with `inner`. Pixels
    /// without a value in a frame, or without a curve of the flat, are left out. `offsets`: of flat and
    /// sample, m.
    pub(super) fn of(
        flat: &[Option<FlatPixel>],
        sample: Vec<Vec<f64>>,
        empty: usize,
        inner: bool,
        offsets: [&'a [f64]; 2],
        geometry: &'a CurveGeometry,
        options: &'a RetrieveOptions,
    ) -> Self {
        let frames = offsets[1].len();
        let (mut of_empty, mut of_inner) = (Vec::new(), Vec::new());
        for (at, (flat, values)) in flat.iter().zip(sample).enumerate() {
            let Some(flat) = flat else { continue };
            if !values.iter().all(|value| value.is_finite()) {
                continue;
            }
            let (curve, residual) = (flat.curve.clone(), flat.residual(offsets));
            let pixel = Pixel { curve, residual, values };
            if at < empty {
                of_empty.push(pixel);
            } else if frames >= FRAMES && inner {
                of_inner.push(pixel);
            }
        }
        let middle = |of: fn(&FittedCurve) -> f64| {
            median(of_empty.iter().map(|pixel| of(&pixel.curve)).collect()).unwrap_or(f64::NAN)
        };
        let (width, centre) = (middle(|curve| curve.width), middle(FittedCurve::centre));
        Self {
            empty: of_empty,
            inner: of_inner,
            offsets: offsets[1],
            width,
            centre,
            geometry,
            options,
        }
    }

    /// Variance of a value by the noise of photons and of reading; of intensities in arbitrary units.
    pub(super) fn variance(&self, value: f64) -> f64 {
        let noise = self.options.read_noise;
        libm::fma(self.options.gain.unwrap_or(1.0), value, noise * noise)
    }

    /// The curve of a pixel of the sample in frames of these doses and displacements.
    pub(super) fn fitted(&self, pixel: &Pixel, of: Unknowns, at: &[f64]) -> Option<FittedCurve> {
        let offsets: Vec<f64> = (0..of.frames)
            .map(|k| libm::fma(at[of.of(k)[1]], self.width, self.offsets[k]))
            .collect();
        let values: Vec<f64> =
            pixel.values.iter().enumerate().map(|(k, y)| y * (-at[of.of(k)[0]]).exp()).collect();
        fit(self.geometry, &scan(&offsets, self.geometry, self.options), &values)
    }
}

fn scan(offsets: &[f64], geometry: &CurveGeometry, options: &RetrieveOptions) -> Scan {
    let noise = ValueNoise {
        saturation: f64::INFINITY,
        gain: options.gain,
        read_noise: options.read_noise,
        weights: Weights::None,
    };
    Scan::along_x(offsets, quadrature::trapezoids(offsets), noise, geometry.background)
}

/// The curve of the masks through values: five or more determine its blur; fewer take the blur of the geometry.
fn fit(geometry: &CurveGeometry, scan: &Scan, values: &[f64]) -> Option<FittedCurve> {
    let model = geometry.model()?;
    let curve = values.iter().map(|value| beamlet_core::numbers::single(*value));
    let blur = (values.len() < 5).then(|| geometry.spread());
    let found = fit_slits(&model, scan, curve, blur);
    let odd = flags::NO_ANSWER | flags::OUTSIDE;
    if found.flags & odd != 0 {
        return None;
    }
    let numbers = [found.amplitude, found.centre[0], found.width(), found.background];
    FittedCurve::new(&model, numbers, scan.background)
}
