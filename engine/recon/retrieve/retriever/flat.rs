//! The flat of a retriever: its curves, which serve the views that follow.

use super::super::background_term::BackgroundTerm;
use super::super::curves::Fits;
use super::super::images::Images;
use super::super::misfit::median;
use super::super::options::ReadRows;
use super::super::value_noise::NoiseFactors;
use super::layout::Layout;
use super::{Retriever, part};
use beamlet_core::rows_control::RowsControl;
use beamlet_core::{Error, Result, reserve};
use ndarray::ArrayView3;

/// Curves of the flat and the extent of its images.
#[derive(Debug)]
pub(super) struct Flat {
    pub(super) curves: Fits,
    /// Rows and columns of the images: pixels, or beamlets.
    pub(super) shape: [usize; 2],
    /// Rows and columns of the frames.
    pub(super) frame_rows: usize,
    pub(super) frame_columns: usize,
    /// Median widths of the curves along x and z, m; NaN where no curve has one.
    pub(super) widths: [f64; 2],
    /// Median residual of the curves, rms over the height; 0 where none has one.
    pub(super) misfit: f64,
    /// Noise of the values.
    noise: NoiseFactors,
}

impl Retriever {
    /// Curves of the flat, counted over rows; `None` before it was taken.
    #[must_use]
    pub(in crate::retrieve) fn flat_curves(&self) -> Option<&Fits> {
        self.flat.as_ref().map(|flat| &flat.curves)
    }

    /// Advice where curves of neighbouring apertures overlap and their background is an unknown; `None` elsewhere.
    pub(in crate::retrieve) fn overlap_of_curves(&self) -> Option<String> {
        let shape = &self.layout.slits()?.shape;
        let width = shape.width()?;
        let overlaps = !shape.is_separate() && shape.background == BackgroundTerm::Free;
        overlaps.then(|| {
            format!(
                "curves overlap: the masks repeat after {:.1} standard deviations of a curve, so that no offset has the \
                 background alone; use background leak or a number with exact-curve",
                shape.period / width
            )
        })
    }

    /// Rows and columns of the images; 0 before a flat was taken.
    pub(in crate::retrieve) fn shape(&self) -> [usize; 2] {
        self.flat.as_ref().map_or([0; 2], |flat| flat.shape)
    }

    /// Median widths of the curves of the flat along x and z, m; NaN where no curve has one, and before it was taken.
    pub(in crate::retrieve) fn flat_widths(&self) -> [f64; 2] {
        self.flat.as_ref().map_or([f64::NAN; 2], |flat| flat.widths)
    }

    /// Noise of the values of the flat.
    pub(in crate::retrieve) fn flat_noise(&self) -> NoiseFactors {
        self.flat.as_ref().map_or(NoiseFactors::ONE, |flat| flat.noise)
    }

    /// Images of the flat; `None` before it was taken.
    pub(in crate::retrieve) fn images_of_flat(&self) -> Option<Images> {
        let flat = self.flat.as_ref()?;
        let [names, _] = self.names_of_images();
        let mut images = Images::new(names, flat.shape[0], flat.shape[1]);
        images.take_flat(|at| flat.curves.curve(at));
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
        if let Some(beamlets) = self.layout.beamlets()
            && beamlets.columns() != columns
        {
            return Err(Error::scene(
                "detector.pixels",
                format!("{} columns for frames of {columns}", beamlets.columns()),
                "all columns of the frames, which beamlets need",
            ));
        }
        let frame = [rows as usize, columns];
        if let Layout::Lattice(design, beamlets) = &mut self.layout
            && beamlets.as_ref().is_none_or(|beamlets| beamlets.frame() != frame)
        {
            *beamlets = Some(design.find(read(0..rows)?.view())?);
        }
        let shape = self.layout.shape(frame);
        let count = shape[0] * shape[1];
        // The curves of the flat, and the images of a view.
        let bytes = self.layout.bytes() + 4 * self.names().len();
        let purpose = format!("the images of a view of {} x {}", shape[0], shape[1]);
        reserve::ask((bytes * count) as u64, &purpose, "retrieve frames with fewer pixels")?;
        let mut all = self.layout.unknown(count);
        let scan = self.scan_at(None, noise)?;
        self.bands(rows, columns, control, |band, control| {
            let data = (read(band.clone())?, band.start);
            let curves = self.curves(data, &scan, None, &control.cancel)?;
            all.put(band.start as usize * shape[1], curves);
            Ok(())
        })?;
        let misfits = all.known().map(|curve| curve.residual / curve.amplitude).collect();
        self.flat = Some(Flat {
            misfit: median(misfits).unwrap_or(0.0),
            widths: [0, 1].map(|axis| median(all.widths(axis)).unwrap_or(f64::NAN)),
            curves: all,
            shape,
            frame_rows: frame[0],
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
