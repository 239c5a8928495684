//! The flat of a retriever: its curves, which serve the views that follow.

use super::super::background_term::BackgroundTerm;
use super::super::beamlets::Beamlets;
use super::super::curves::Curves;
use super::super::images::Images;
use super::super::misfit;
use super::super::model::of_slits;
use super::super::noise_factors::NoiseFactors;
use super::super::options::ReadRows;
use super::view_scan::ViewScan;
use super::{Retriever, part};
use beamlet_core::cancel::Cancel;
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, numbers, reserve};
use ndarray::{Array2, ArrayView3};

/// Curves of the flat and the extent of its images.
#[derive(Debug)]
pub(super) struct Flat {
    pub(crate) curves: Curves,
    pub(crate) rows: usize,
    /// Curves along a row: pixels, or beamlets.
    pub(crate) columns: usize,
    /// Pixels along a row of the frames.
    pub(super) frame_columns: usize,
    /// Median width of the curves, m; `None` where no curve has one.
    pub(super) width: Option<f64>,
    /// Noise of the values.
    noise: NoiseFactors,
}

impl Retriever {
    /// Curves of the flat, counted over rows; `None` before it was taken.
    #[must_use]
    pub(crate) fn flat_curves(&self) -> Option<&Curves> {
        self.flat.as_ref().map(|flat| &flat.curves)
    }

    /// Residual of the method's fit to the curve of the masks at the flat's offsets, rms over the height: 0
    /// for methods that fit this curve.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`].
    pub(in crate::retrieve) fn misfit_of_masks(&self) -> Result<f64> {
        let (Some(fitter), Some(model), Some(flat)) =
            (&self.fitter, self.shape.model(), self.flat_curves())
        else {
            return Ok(0.0);
        };
        let middle = |of: &[f32]| misfit::median(of.iter().copied().map(f64::from).collect());
        let (centre, height) = (middle(&flat.centre), middle(&flat.amplitude));
        let centre = centre.unwrap_or(0.0);
        let p = of_slits([1.0, centre, self.shape.spread(), 0.0]);
        let places = std::iter::once(centre).chain(self.offsets.iter().copied());
        let found = model.values(places, &p);
        let scale = height.unwrap_or(1.0) / found[0][0];
        let values = Array2::from_shape_fn((self.offsets.len(), 1), |(step, _)| {
            numbers::single(scale * found[1 + step][0])
        });
        let fit = fitter.fit(values.view(), &Cancel::default())?;
        Ok(f64::from(fit.residual[0] / fit.amplitude[0]))
    }

    /// Advice where curves of neighbouring apertures overlap and their background is an unknown; `None` elsewhere.
    pub(in crate::retrieve) fn overlap_of_curves(&self) -> Option<String> {
        let width = self.shape.width()?;
        let overlaps = !self.shape.is_separate() && self.shape.background == BackgroundTerm::Free;
        overlaps.then(|| {
            format!(
                "curves overlap: the masks repeat after {:.1} standard deviations of a curve, so that no offset has the \
                 background alone; use background leak or a number with exact-curve",
                self.shape.period / width
            )
        })
    }

    /// Noise of the values of the flat.
    pub(in crate::retrieve) fn flat_noise(&self) -> NoiseFactors {
        self.flat.as_ref().map_or(NoiseFactors::ONE, |flat| flat.noise)
    }

    /// Images of the flat; `None` before it was taken.
    pub(in crate::retrieve) fn images_of_flat(&self) -> Option<Images> {
        let flat = self.flat.as_ref()?;
        let [names, _] = self.names_of_images();
        let mut images = Images::new(names, flat.rows, flat.columns);
        images.take_flat(|at| Some(flat.curves.curve(at)));
        Some(images)
    }

    /// Takes the flat, `rows` rows of `columns` pixels.
    ///
    /// # Errors
    /// As `read`; [`Error::Scene`] where the frames do not fit the offsets or the set-up;
    /// [`Error::Interrupted`].
    pub fn set_flat(
        &mut self,
        rows: u32,
        columns: usize,
        read: &mut ReadRows<'_>,
        control: &mut RowsControl<'_>,
    ) -> Result<()> {
        self.set_flat_with(rows, columns, NoiseFactors::ONE, read, control)
    }

    /// As [`Retriever::set_flat`], of values with this noise.
    ///
    /// # Errors
    /// As [`Retriever::set_flat`].
    pub(in crate::retrieve) fn set_flat_with(
        &mut self,
        rows: u32,
        columns: usize,
        noise: NoiseFactors,
        read: &mut ReadRows<'_>,
        control: &mut RowsControl<'_>,
    ) -> Result<()> {
        if let Some(beamlets) = &self.beamlets
            && beamlets.columns() != columns
        {
            return Err(Error::scene(
                "detector.pixels",
                format!("{} columns for frames of {columns}", beamlets.columns()),
                "all columns of the frames, which beamlets need",
            ));
        }
        let across = self.beamlets.as_ref().map_or(columns, Beamlets::count);
        // The curves of the flat, and the images of a view.
        let numbers = (Curves::NUMBERS + self.names().len()) as u64;
        let bytes = 4 * numbers * u64::from(rows) * across as u64;
        let purpose = format!("the images of a view of {rows} x {across}");
        reserve::ask(bytes, &purpose, "retrieve frames with fewer pixels")?;
        let mut all = Curves::new(rows as usize * across);
        let scan = ViewScan::of(&self.offsets, noise, self.fitter.as_ref(), noise.is_one())?;
        self.bands(rows, columns, self.offsets.len(), control, |band, control| {
            let curves = self.curves(read(band.clone())?, &scan, None, &control.cancel)?;
            all.put(band.start as usize * across, &curves);
            Ok(())
        })?;
        let widths = all.width.iter().map(|width| f64::from(*width)).collect();
        self.flat = Some(Flat {
            width: misfit::median(widths),
            curves: all,
            rows: rows as usize,
            columns: across,
            frame_columns: columns,
            noise,
        });
        Ok(())
    }

    /// The flat, from an array `[step][row][column]`.
    ///
    /// # Errors
    /// As [`Retriever::set_flat`].
    pub fn set_flat_array(&mut self, flat: ArrayView3<'_, f32>) -> Result<()> {
        let (_, rows, columns) = flat.dim();
        let rows = u32::try_from(rows)
            .map_err(|_| Error::argument("flat", format!("{rows} rows"), "fewer than 2^32"))?;
        self.set_flat(rows, columns, &mut |band| Ok(part(flat, &band)), &mut RowsControl::default())
    }
}
