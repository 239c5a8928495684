//! Views that lost their refraction, in arrays.

use beamlet::ndarray::{Array2, Array3, ArrayView3};
use beamlet::reconstruct::{LostViews, Quantity, ScanGeometry, fill_images, reaching_ends};

/// Refraction angles with weights and attenuation of the same shape, `[view][row][column]`.
pub(crate) struct Angles<'a> {
    pub(crate) geometry: &'a ScanGeometry,
    pub(crate) values: ArrayView3<'a, f32>,
    pub(crate) weights: Option<ArrayView3<'a, f32>>,
    /// −ln of the transmission, which shows bodies that reach an end of a row.
    pub(crate) attenuation: Option<ArrayView3<'a, f32>>,
}

impl Angles<'_> {
    /// Views that lost their refraction.
    pub(crate) fn lost(&self) -> beamlet::Result<LostViews> {
        let (views, rows, _) = self.values.dim();
        let mut unknown = match self.attenuation {
            Some(attenuation) => reaching_ends(attenuation),
            None => Array2::default((views, rows)),
        };
        let known = self.weights.map(|weights| self.known(weights, &mut unknown)).transpose()?;
        let compared = known.as_ref().map_or(self.values, |known| known.view());
        LostViews::find(self.geometry, compared, Some(unknown.view()))
    }

    /// The angles, with values of weight 0, which may be anything, filled from the pixels beside them; views
    /// without any weight become unknown.
    fn known(
        &self,
        weights: ArrayView3<'_, f32>,
        unknown: &mut Array2<bool>,
    ) -> beamlet::Result<Array3<f32>> {
        let mut angles = self.values.to_owned();
        for (view, (mut image, weights)) in
            angles.outer_iter_mut().zip(weights.outer_iter()).enumerate()
        {
            if weights.iter().all(|weight| *weight == 0.0) {
                image.fill(0.0);
                unknown.row_mut(view).fill(true);
                continue;
            }
            image.zip_mut_with(&weights, |angle, weight| {
                if *weight == 0.0 {
                    *angle = f32::NAN;
                }
            });
        }
        let places = [&self.geometry.columns, &self.geometry.rows].map(Vec::as_slice);
        Ok(fill_images(places, Quantity::Delta, angles.view(), None)?.0)
    }
}
