//! Values of the pixels of a view, and the curves of their flat.

use super::equations::Unknowns;
use crate::retrieve::background_term::BackgroundTerm;
use crate::retrieve::curve_model::CurveModel;
use crate::retrieve::diagnosis::FittedCurve;
use crate::retrieve::fit::fit_slits;
use crate::retrieve::misfit::median;
use crate::retrieve::retriever::Layout;
use crate::retrieve::scan::{Scan, along};
use crate::retrieve::value_noise::{NoiseFactors, ValueNoise, Weights};
use crate::retrieve::{RetrieveOptions, flags, quadrature};
use beamlet_core::numbers;
use beamlet_core::random::GOLDEN;
use rayon::prelude::*;
use std::ops::Range;

/// Most pixels of empty beam, and of the rest, whose values are kept; of the rest fewer by the square of the number of
/// axes, since a fit in two directions takes ten times as long.
const MOST: [usize; 2] = [4096, 128];
/// Fewest frames for pixels with a curve of their own.
const FRAMES: usize = 6;

/// Rows and columns of a rectangle.
pub(crate) type Rectangle = [Range<usize>; 2];

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
    pub(crate) offsets: &'a [[f64; 2]],
    /// Median widths and centre of the curves of the empty beam along x and z, m.
    pub(super) widths: [f64; 2],
    pub(super) centre: [f64; 2],
    curves: &'a CurveModel,
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
        offsets: &[[f64; 2]],
        curves: &CurveModel,
        options: &RetrieveOptions,
    ) -> Vec<Option<Self>> {
        let scan = scan(curves, offsets, options);
        let of = |values: Vec<f64>| {
            let is_whole = values.iter().all(|value| value.is_finite());
            let curve = is_whole.then(|| fit(curves, &scan, &values, None)).flatten()?;
            Some(Self { curve, values })
        };
        values.into_par_iter().map(of).collect()
    }

    /// Difference of the values from the curve at the offsets of the sample; 0 where the flat has others.
    fn residual(&self, [of_flat, offsets]: [&[[f64; 2]]; 2]) -> Vec<f64> {
        match of_flat == offsets {
            true => {
                let fitted = self.curve.at(offsets);
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
        offsets: [&'a [[f64; 2]]; 2],
        curves: &'a CurveModel,
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
        let middle = |of: fn(&FittedCurve) -> [f64; 2]| {
            [0, 1].map(|axis| {
                let all = of_empty.iter().map(|pixel| of(&pixel.curve)[axis]).collect();
                median(all).unwrap_or(f64::NAN)
            })
        };
        let (widths, centre) = (middle(|curve| curve.widths), middle(FittedCurve::centre));
        let (empty, inner) = (of_empty, of_inner);
        Self { empty, inner, offsets: offsets[1], widths, centre, curves, options }
    }

    /// Variance of a value by the noise of photons and of reading; of intensities in arbitrary units.
    pub(super) fn variance(&self, value: f64) -> f64 {
        let noise = self.options.read_noise;
        libm::fma(self.options.gain.unwrap_or(1.0), value, noise * noise)
    }

    /// The curve of a pixel of the sample in frames of these doses and displacements.
    pub(super) fn fitted(&self, pixel: &Pixel, of: Unknowns, at: &[f64]) -> Option<FittedCurve> {
        let offsets = of.displaced(at, self.offsets, self.widths);
        let values: Vec<f64> =
            pixel.values.iter().enumerate().map(|(k, y)| y * (-at[of.dose(k)]).exp()).collect();
        let scan = scan(self.curves, &offsets, self.options);
        fit(self.curves, &scan, &values, Some(&pixel.curve))
    }
}

/// Curves of the pixels of frames, by the masks where the scene knows them; `None` of beamlets, of one mask of slits and
/// of lists of apertures.
pub(super) fn curves_of(layout: &Layout) -> Option<CurveModel> {
    match layout {
        Layout::Pixels(slits) => {
            let (model, spread) = (slits.shape.model()?, slits.shape.spread());
            Some(CurveModel::of_slits(model, BackgroundTerm::Free, spread))
        }
        Layout::Steps(curves) if curves.is_of_list() => None,
        Layout::Steps(curves) => Some(curves.of_masks()),
        Layout::Beamlets(_) | Layout::Lattice(..) => None,
    }
}

/// Values of pixels at these offsets.
fn scan(curves: &CurveModel, offsets: &[[f64; 2]], options: &RetrieveOptions) -> Scan {
    let noise = ValueNoise {
        saturation: f64::INFINITY,
        weights: Weights::None,
        ..ValueNoise::of(options, NoiseFactors::ONE)
    };
    if curves.is_planar {
        return curves.scan(offsets.to_vec(), noise);
    }
    let x = along(offsets, 0);
    Scan::along_x(&x, quadrature::trapezoids(&x), noise, curves.background)
}

/// The curve through values: of slits five or more determine its blur; fewer take the blur of the geometry. `near`:
/// a curve near it, as the flat's.
fn fit(
    curves: &CurveModel,
    scan: &Scan,
    values: &[f64],
    near: Option<&FittedCurve>,
) -> Option<FittedCurve> {
    let curve = values.iter().map(|value| numbers::single(*value));
    let found = match near {
        _ if !curves.is_planar => {
            let blur = curves.blur.filter(|_| values.len() < 5).map(|[xx, _]| xx);
            fit_slits(&curves.model, scan, curve, blur)
        }
        Some(near) => curves.fit_from(scan, curve, near.unknowns()),
        None => curves.fit(scan, curve, None, None),
    };
    let odd = flags::NO_ANSWER | flags::OUTSIDE;
    (found.flags & odd == 0).then(|| FittedCurve::new(curves, &found)).flatten()
}

/// Pixels of empty beam by columns, then pixels of the rest, counted over rows, with the number of the first.
pub(super) fn chosen_pixels(
    [rows, columns]: [usize; 2],
    empty: &[Rectangle],
    axes: usize,
) -> (Vec<usize>, usize) {
    let is_empty = |pixel: usize| {
        let (row, column) = (pixel / columns, pixel % columns);
        empty.iter().any(|[rows, columns]| rows.contains(&row) && columns.contains(&column))
    };
    let (of_empty, rest): (Vec<usize>, Vec<usize>) =
        (0..rows * columns).partition(|pixel| is_empty(*pixel));
    let mut pixels = spread(of_empty, MOST[0]);
    // Column by column, for groups of neighbours.
    pixels.sort_by_key(|pixel| (pixel % columns, pixel / columns));
    let count = pixels.len();
    pixels.extend(spread(rest, MOST[1] / (axes * axes)));
    (pixels, count)
}

/// At most `most` of these, evenly over rows and columns.
fn spread(mut pixels: Vec<usize>, most: usize) -> Vec<usize> {
    let count = pixels.len();
    if count > most {
        // A step near the golden section of the count passes through all columns.
        let place = |at: usize| {
            let share = (at as f64 * GOLDEN).fract();
            numbers::whole::<u32>(share * count as f64) as usize
        };
        let mut places: Vec<usize> = (0..most).map(|at| place(at).min(count - 1)).collect();
        places.sort_unstable();
        places.dedup();
        pixels = places.into_iter().map(|at| pixels[at]).collect();
    }
    pixels
}
