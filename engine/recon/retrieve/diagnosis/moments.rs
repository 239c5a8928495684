//! Errors of the method `moments` at the offsets of a scan, by the curve of the masks.

use crate::retrieve::Retriever;
use crate::retrieve::background_term::BackgroundTerm;
use crate::retrieve::curve_model::CurveModel;
use crate::retrieve::response::Probe;
use beamlet_core::{Result, numbers};

/// Displacement of the curve that stands for a refraction angle, in widths of the curve.
const SHIFT: f64 = 0.1;
/// Share by which its variance grows for a dark field.
const DARK_FIELD: f64 = 0.05;
/// Relative errors of the angle and of the dark field from which on a warning says them.
const LIMITS: [f64; 2] = [0.01, 0.05];
/// Shares of the flat's curves with a smaller centre, of the centres that are examined.
const CENTRES: [f64; 3] = [0.05, 0.5, 0.95];

/// Relative errors at the offsets of a view.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MomentsErrors {
    /// Error of an angle that displaces the curve by a tenth of its width, over this angle.
    pub(super) angle: f64,
    /// Error of a dark field of a twentieth of the variance of the curve, over this dark field.
    pub(super) dark_field: f64,
}

/// Errors of the views of a retrieval.
#[derive(Debug, Default)]
pub(super) struct MomentsCheck {
    /// Centres of the flat's curves, m.
    centres: Vec<f64>,
    /// The offsets of the last view, and its errors.
    last: Option<(Vec<[f64; 2]>, MomentsErrors)>,
}

impl MomentsCheck {
    /// Errors at the offsets of a view, m, where they are large; `None` for masks without a curve.
    ///
    /// # Errors
    /// As [`Retriever::response`].
    pub(super) fn view(
        &mut self,
        retriever: &Retriever,
        offsets: &[[f64; 2]],
    ) -> Result<Option<MomentsErrors>> {
        let Some(truth) = CurveModel::of_masks(retriever.layout()) else { return Ok(None) };
        if self.centres.is_empty() {
            self.centres = centres(retriever);
        }
        let errors = match &self.last {
            Some((at, errors)) if at == offsets => *errors,
            _ => self.errors(retriever, truth, offsets)?,
        };
        self.last = Some((offsets.to_vec(), errors));
        let is_large = errors.angle.abs() > LIMITS[0] || errors.dark_field.abs() > LIMITS[1];
        Ok(is_large.then_some(errors))
    }

    /// The largest errors over the centres, of light that the masks do not leak.
    fn errors(
        &self,
        retriever: &Retriever,
        truth: CurveModel,
        offsets: &[[f64; 2]],
    ) -> Result<MomentsErrors> {
        let truth = CurveModel { background: BackgroundTerm::Value(0.0), ..truth };
        let mut most = MomentsErrors::default();
        // A curve without an answer, which the offsets do not reach, is lost.
        let keep = |most: &mut f64, response: f64| {
            let error = if response.is_nan() { -1.0 } else { response - 1.0 };
            if error.abs() > most.abs() {
                *most = error;
            }
        };
        for (centre, shift) in self.centres.iter().flat_map(|at| [(at, -SHIFT), (at, SHIFT)]) {
            let probe = Probe { centre: [*centre, 0.0], shift, widened: DARK_FIELD };
            let response = retriever.response_to(&truth, probe, Some(offsets))?;
            keep(&mut most.angle, response.refraction);
            keep(&mut most.dark_field, response.dark_field.unwrap_or(1.0));
        }
        Ok(most)
    }
}

/// Quantiles of the centres of the flat's curves.
fn centres(retriever: &Retriever) -> Vec<f64> {
    let known = retriever.flat_curves().into_iter().flat_map(|flat| flat.known());
    let mut all: Vec<f64> = known.map(|curve| curve.centre[0]).collect();
    all.sort_by(f64::total_cmp);
    let at = |share: f64| {
        all.get(numbers::whole::<usize>(share * all.len().saturating_sub(1) as f64)).copied()
    };
    CENTRES.into_iter().filter_map(at).collect()
}
