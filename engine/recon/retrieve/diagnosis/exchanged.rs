//! Neighbouring steps whose frames are exchanged.

use crate::retrieve::curve_model::CurveModel;
use crate::retrieve::fit::fit_slits;
use crate::retrieve::quadrature;
use crate::retrieve::scan::{Scan, along};
use crate::retrieve::value_noise::ValueNoise;
use beamlet_core::numbers::single;
use rayon::prelude::*;

/// Most pixels whose curves are fitted with exchanged steps.
const MOST: usize = 256;
/// Excess of the reduced chi squared of the sample over the flat's from which on exchanges are tried.
pub(super) const EXCESS: f64 = 1.03;
/// Least decrease of the squares by an exchange, and the same over the squares of a value by noise.
const LOWER: f64 = 0.03;
const SIGNIFICANT: f64 = 25.0;
/// Decrease that shows an exchange in flat and sample alike, where a curve of another shape makes smaller ones.
const OF_BOTH: f64 = 0.5;

/// Two neighbouring steps that are exchanged.
#[derive(Debug, Clone, Copy)]
pub(super) struct Exchanged {
    /// The first of them, from 0.
    pub(super) step: usize,
    /// True if the frames of the flat are exchanged as well: the offsets are.
    pub(super) of_flat: bool,
    /// Relative decrease of the squares of the residuals.
    pub(super) lower: f64,
}

impl Exchanged {
    /// The exchange that lowers the residuals of the sample most; `None` where noise, or a curve of another shape than the
    /// fitted one, explains it. `pixels`: values of flat and sample.
    pub(super) fn of(
        model: &CurveModel,
        offsets: &[[f64; 2]],
        noise: ValueNoise,
        pixels: &[[&[f64]; 2]],
    ) -> Option<Self> {
        let x = along(offsets, 0);
        let scan = Scan::along_x(&x, quadrature::trapezoids(&x), noise, model.background);
        let pixels: Vec<_> = pixels.iter().step_by(pixels.len().div_ceil(MOST).max(1)).collect();
        let squares = |of: usize, exchanged: Option<usize>| -> f64 {
            let of_pixel = |pixel: &&[&[f64]; 2]| {
                let mut values: Vec<f32> = pixel[of].iter().map(|value| single(*value)).collect();
                if let Some(step) = exchanged {
                    values.swap(step, step + 1);
                }
                let fit = fit_slits(&model.model, &scan, values.into_iter(), None);
                let square = fit.residual.powi(2) * offsets.len() as f64;
                if square.is_finite() { square } else { 0.0 }
            };
            pixels.par_iter().map(of_pixel).sum()
        };
        let own = squares(1, None);
        let of_step = |step: usize| (step, squares(1, Some(step)));
        let (step, least) =
            (0..offsets.len() - 1).map(of_step).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let freedom = (offsets.len() - model.equations().count()) * pixels.len();
        let lower = 1.0 - least / own;
        if !(lower > LOWER && (own - least) * freedom as f64 > SIGNIFICANT * least) {
            return None;
        }
        let of_flat = 1.0 - squares(0, Some(step)) / squares(0, None);
        match (of_flat > 0.0, lower.min(of_flat) > OF_BOTH) {
            (false, _) => Some(Self { step, of_flat: false, lower }),
            (true, true) => Some(Self { step, of_flat: true, lower }),
            (true, false) => None,
        }
    }
}
