//! Errors of the method `moments` at the offsets of a scan, by the curve of the masks.

use crate::retrieve::curves::Fits;
use crate::retrieve::model::{Model, of_slits};
use crate::retrieve::quadrature;
use crate::retrieve::scan::along;
use crate::retrieve::shape::CurveGeometry;

/// Displacement of the curve that stands for a refraction angle, in widths of the curve.
const SHIFT: f64 = 0.1;
/// Share by which its variance grows for a dark field.
const DARK_FIELD: f64 = 0.05;
/// Relative errors of the angle and of the dark field from which on a warning says them.
const LIMITS: [f64; 2] = [0.01, 0.05];
/// Shares of the flat's curves with a smaller centre, of the centres that are examined.
const CENTRES: [f64; 3] = [0.05, 0.5, 0.95];

/// Offsets at which curves of the masks are sampled.
#[derive(Debug)]
pub(super) struct MomentsCheck {
    model: Model,
    spread: f64,
    flat: Vec<f64>,
    /// Centres of the flat's curves, m.
    centres: Vec<f64>,
    /// The offsets of the last view, and its errors.
    last: Option<(Vec<f64>, MomentsErrors)>,
}

/// Relative errors at the offsets of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct MomentsErrors {
    /// Error of an angle that displaces the curve by a tenth of its width, over this angle.
    pub(super) angle: f64,
    /// Error of a dark field of a twentieth of the variance of the curve, over this dark field.
    pub(super) dark_field: f64,
}

impl MomentsErrors {
    /// True where a warning is due.
    fn is_large(self) -> bool {
        self.angle.abs() > LIMITS[0] || self.dark_field.abs() > LIMITS[1]
    }
}

impl MomentsCheck {
    /// Flats at these offsets, m; `None` for masks without a curve.
    pub(super) fn of(geometry: &CurveGeometry, flat: &[f64]) -> Option<Self> {
        let (model, spread) = (geometry.model()?, geometry.spread());
        Some(Self { model, spread, flat: flat.to_vec(), centres: Vec::new(), last: None })
    }

    /// Errors at the offsets of a view, m, where they are large.
    pub(super) fn view(&mut self, flat: &Fits, offsets: &[[f64; 2]]) -> Option<MomentsErrors> {
        if self.centres.is_empty() {
            self.centres = centres(flat);
        }
        let offsets = along(offsets, 0);
        let known = self.last.as_ref().filter(|(at, _)| *at == offsets).map(|(_, errors)| *errors);
        let errors = match known {
            Some(errors) => errors,
            None => self.errors(&offsets),
        };
        self.last = Some((offsets, errors));
        errors.is_large().then_some(errors)
    }

    /// The largest errors over the centres.
    fn errors(&self, offsets: &[f64]) -> MomentsErrors {
        let mut most = MomentsErrors { angle: 0.0, dark_field: 0.0 };
        let keep = |most: &mut f64, error: f64| {
            if error.abs() > most.abs() {
                *most = error;
            }
        };
        let width = self.model.width(&of_slits([1.0, 0.0, self.spread, 0.0]));
        let more = DARK_FIELD * width * width;
        for centre in &self.centres {
            let [from, of_flat] = self.found(&self.flat, [*centre, self.spread]);
            for shift in [-SHIFT * width, SHIFT * width] {
                let [to, _] = self.found(offsets, [centre + shift, self.spread]);
                keep(&mut most.angle, (to - from) / shift - 1.0);
            }
            let [_, widened] = self.found(offsets, [*centre, self.spread + more]);
            keep(&mut most.dark_field, (widened - of_flat) / more - 1.0);
        }
        most
    }

    /// Centre and variance that the method finds of a curve with this centre and spread at these offsets.
    fn found(&self, offsets: &[f64], [centre, spread]: [f64; 2]) -> [f64; 2] {
        let values =
            self.model.values(offsets.iter().copied(), &of_slits([1.0, centre, spread, 0.0]));
        let weights = quadrature::weights(offsets);
        let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
            let terms = offsets.iter().zip(&values).zip(&weights);
            terms.map(|((x, value), weight)| weight * value[0] * of(*x)).sum()
        };
        let light = sum(&|_| 1.0);
        let found = sum(&|x| x) / light;
        [found, (sum(&|x| (x - found).powi(2)) / light).max(0.0)]
    }
}

/// Quantiles of the centres of curves.
fn centres(flat: &Fits) -> Vec<f64> {
    let mut all: Vec<f64> = flat.known().map(|curve| curve.centre[0]).collect();
    all.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index =
            beamlet_core::numbers::whole::<usize>(share * all.len().saturating_sub(1) as f64);
        all.get(index).copied()
    };
    CENTRES.into_iter().filter_map(at).collect()
}
