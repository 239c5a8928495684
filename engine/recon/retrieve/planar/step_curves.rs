//! Curves of pixels over mask steps along x and z.

use super::super::background_term::BackgroundTerm;
use super::super::curves::Curve;
use super::super::model::Model;
use super::super::options::RetrieveOptions;
use super::super::scan::along;
use super::super::value_noise::ValueNoise;
use super::fit::{NEEDED, PlanarModel};
use super::models::{Centres, curve_model, known_curve, of_view, without_periods};
use super::offsets;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_model::scene::Scene;
use ndarray::ArrayView3;
use rayon::prelude::*;

/// A curve in each pixel.
#[derive(Debug)]
pub(crate) struct StepCurves {
    pub(in crate::retrieve) model: PlanarModel,
    /// Centres of the curves of a list of apertures; `None` of curves with one peak.
    centres: Option<Centres>,
    /// The curve of the masks, where the scene knows it and it has one peak.
    truth: Option<PlanarModel>,
    /// Offsets along z with whole periods, m.
    pub(in crate::retrieve) offsets_z: Vec<f64>,
}

impl StepCurves {
    /// The model of curves over these offsets, m, and the offsets without whole periods of the sample mask.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`] for offsets that do not determine a curve; [`beamlet_core::Error::Argument`] for a
    /// mask whose apertures are not known.
    pub(crate) fn of(
        scene: &Scene,
        options: &RetrieveOptions,
        pairs: &[[f64; 2]],
    ) -> Result<(Self, Vec<[f64; 2]>)> {
        offsets::check(pairs, NEEDED)?;
        let offsets = without_periods(scene, pairs);
        let model = curve_model(scene, options, &offsets)?;
        let centres = Centres::of(scene, &offsets);
        let truth = match centres {
            Some(_) => None,
            None => known_curve(scene, options, &offsets)?,
        };
        let offsets_z = along(pairs, 1);
        Ok((Self { model, centres, truth, offsets_z }, offsets))
    }

    /// Offsets of a view with steps at these places along x, less the whole periods of the sample mask that place them
    /// nearest to the flat's. `flat`: offsets of the flat with and without whole periods.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Scene`] for offsets that do not determine a curve.
    pub(crate) fn offsets_of_view(
        scene: &Scene,
        x: &[f64],
        flat: [&[[f64; 2]]; 2],
    ) -> Result<Vec<[f64; 2]>> {
        let offsets = of_view(scene, x, flat);
        offsets::check(&offsets, NEEDED)?;
        Ok(offsets)
    }

    /// True for curves of a list of apertures, whose place depends on the pixel.
    pub(crate) const fn is_of_list(&self) -> bool {
        self.centres.is_some()
    }

    /// The curve of the masks with the background of the fits, or the model of the fits where the scene does not know it.
    pub(in crate::retrieve) fn of_masks(&self) -> PlanarModel {
        let truth = self.truth.as_ref().unwrap_or(&self.model);
        PlanarModel { background: self.model.background, ..truth.clone() }
    }

    /// Model, variances of the blur and background of the curve of the masks; `None` where it is not known.
    pub(in crate::retrieve) fn truth(&self) -> Option<(Model, [f64; 2], BackgroundTerm)> {
        let truth = self.truth.as_ref()?;
        Some((truth.model.clone(), truth.blur.unwrap_or_default(), truth.background))
    }

    /// Fits frames `[step][row][column]` of rows from row `first` on. `flat`: curves of the same pixels of the flat,
    /// `None` for the flat itself.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Interrupted`].
    pub(crate) fn fits(
        &self,
        (frames, first): (ArrayView3<'_, f32>, usize),
        (offsets, noise): (&[[f64; 2]], ValueNoise),
        flat: Option<&[Option<Curve>]>,
        cancel: &Cancel,
    ) -> Result<Vec<Option<Curve>>> {
        let (steps, rows, columns) = frames.dim();
        let scan = self.model.scan(offsets.to_vec(), noise);
        let fit = |at: usize| {
            cancel.check()?;
            let (row, column) = (at / columns, at % columns);
            let curve = (0..steps).map(|step| frames[[step, row, column]]);
            let centre = self.centres.map(|centres| centres.at(first + row, column));
            let of_flat = flat.and_then(|flat| flat[at].as_ref());
            Ok(Some(self.model.fit(&scan, curve, of_flat, centre)))
        };
        (0..rows * columns).into_par_iter().map(fit).collect()
    }
}
